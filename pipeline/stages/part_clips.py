"""The clips of a frames part as stages read them; stages that run together on a part read it once."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, Final, TypeVar

from motionlake.lake import frames
from motionlake.lake.integrity import sound
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
