"""The clips of a frames part as stages read them; stages that run together on a part read it once."""

from __future__ import annotations

from collections.abc import Callable, Container, Hashable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any, Final, TypeVar

from motionlake.lake import frames
from motionlake.lake.integrity import is_listed, sound, sound_files
from motionlake.lake.layout import Lake
from motionlake.stages.stage import Shard

T = TypeVar("T")
# What stages that run together have read or worked out of their part; None where a stage runs alone.
_shared: Final[ContextVar[dict[Hashable, Any] | None]] = ContextVar("_shared", default=None)


@contextmanager
def read_together() -> Iterator[None]:
    """Within the block the clips of a part are read once, and stay in memory; for shards of one part."""
    token = _shared.set({})
    try:
        yield
    finally:
        _shared.reset(token)


def shared(key: Hashable, make: Callable[[], T]) -> T:
    """What `make` gives, within `read_together` made once for a key; whoever gets it does not change it."""
    known = _shared.get()
    if known is None:
        return make()
    if key not in known:
        known[key] = make()
    found: T = known[key]
    return found


def of_clips(
    lake: Lake, files: Mapping[str, str], clips: Mapping[str, str], read: Callable[[Path, Container[str]], dict[str, T]]
) -> dict[str, T]:
    """What a stage has made of some clips, each part read once.

    Args:
        lake: the lake.
        files: by frames part, what the stage makes of it; what is not made yet is left out.
        clips: the part of each clip.
        read: gives those of some clips of a file.

    Raises:
        DamagedError: a file is not as it was written.
    """
    wanted = by_file(lake, files, clips)
    # One after another: so little is read of each that threads would wait for one another.
    parts = map(read, sound_files(lake, wanted), wanted.values())
    return {clip: made for part in parts for clip, made in part.items()}


def by_file(lake: Lake, files: Mapping[str, str], clips: Mapping[str, str]) -> dict[str, set[str]]:
    """The same clips by file, in the order of the names of files."""
    made = {part: files[part] for part in set(clips.values()) if part in files and is_listed(lake, files[part])}
    wanted: dict[str, set[str]] = {}
    for clip, part in clips.items():
        if part in made:
            wanted.setdefault(made[part], set()).add(clip)
    return dict(sorted(wanted.items()))


def stored_clips(lake: Lake, shard: Shard, *, rotations: bool = True) -> Iterator[frames.Frames]:
    """Those of the clips that its spec names, of the frames part that a shard is derived from."""
    part = sound(lake, lake.frames_part(shard.dataset, shard.part))
    return frames.read_part(part, shard.spec["clips"], rotations=rotations)


def clips_of_shard(lake: Lake, shard: Shard, *, rotations: bool = True) -> Iterator[frames.Frames]:
    """The same without calibration poses at their ends (`Frames.recorded`); without rotations where none are used."""

    def read() -> Iterator[frames.Frames]:
        return (clip.recorded() for clip in stored_clips(lake, shard, rotations=rotations))

    if _shared.get() is None:
        return read()
    return iter(shared(("clips", rotations, *shard.spec["clips"]), lambda: list(read())))
