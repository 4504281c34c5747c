"""Damaged files are read or rejected with a reason: no crash, no hang, no flood of memory."""

from __future__ import annotations

import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import numpy as np
import pytest
from motionlake.errors import ClipError
from motionlake.formats import is_clip, read_clips
from motionlake.motion.canonicalise import canonicalise
from motionlake.motion.kinematics import solve
from motionlake.motion.rigs import identify, load_rigs
from numpy.typing import NDArray

from tests.damage import damaged_files, gather
from tests.lakes import motionlake, query, quick_lake

COUNT = 500
SEED = 20
SECONDS_PER_FILE = 20
EXTRA_MEMORY = 2 * 1024**3


@contextmanager
def limited_memory(extra: int) -> Iterator[None]:
    """Let the process's address space grow by `extra` bytes at most, so that a flood is a MemoryError."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + extra, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


class TooSlowError(BaseException):
    """Not an `Exception`, so that no reader takes it for a fault of the file."""


def too_slow(signum: int, frame: FrameType | None) -> None:
    raise TooSlowError(f"still reading after {SECONDS_PER_FILE} s")


@contextmanager
def limited_time(seconds: int) -> Iterator[None]:
    before = signal.signal(signal.SIGALRM, too_slow)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def finite(values: NDArray[np.floating]) -> bool:
    return bool(np.isfinite(values).all())


@pytest.mark.recordings
def test_damaged_files_are_read_or_rejected_with_a_reason(recordings: Path, tmp_path: Path) -> None:
    gather(recordings, tmp_path / "good")
    for path in sorted((tmp_path / "good").iterdir()):
        if is_clip(path):
            read_clips(path)
    paths = damaged_files(tmp_path / "good", tmp_path / "damaged", COUNT, SEED)
    rigs = load_rigs()
    rejected: dict[str, int] = {}
    surprises = []
    for path in paths:
        name = str(path.relative_to(tmp_path / "damaged"))
        if not is_clip(path):
            surprises.append(f"{name}: passed over in silence")
        try:
            with limited_memory(EXTRA_MEMORY), limited_time(SECONDS_PER_FILE):
                for clip in read_clips(path):
                    motion = solve(clip)
                    canonical = canonicalise(clip, motion, identify(clip.hierarchy.joints, rigs))
                    if not all(map(finite, (motion.positions, canonical.positions, canonical.rotations))):
                        surprises.append(f"{name}: positions or rotations that are not finite")
        except ClipError as error:
            rejected[path.name.split(".", 1)[1]] = rejected.get(path.name.split(".", 1)[1], 0) + 1
            if "\n" in str(error) or not 3 < len(str(error)) < 300 or "Error:" in str(error):
                surprises.append(f"{name}: {error}")
        except (Exception, TooSlowError) as error:
            surprises.append(f"{name}: {type(error).__name__}: {error}")
    assert len(paths) == COUNT
    assert not surprises, "\n".join(surprises[:20])
    assert COUNT / 3 < sum(rejected.values()) < COUNT
    assert len(rejected) > 5


@pytest.mark.recordings
def test_damage_is_the_same_for_the_same_seed(recordings: Path, tmp_path: Path) -> None:
    gather(recordings, tmp_path / "good")
    first, again, other = (
        [path.read_bytes() for path in damaged_files(tmp_path / "good", tmp_path / name, 24, seed)]
        for name, seed in (("first", 1), ("again", 1), ("other", 2))
    )
    assert first == again
    assert first != other


@pytest.mark.recordings
def test_a_folder_of_damaged_files_does_not_stop_a_run(recordings: Path, tmp_path: Path, scheduler: str) -> None:
    gather(recordings, tmp_path / "good")
    paths = damaged_files(tmp_path / "good", tmp_path / "damaged", COUNT, SEED)
    lake = quick_lake(tmp_path / "lake")
    run = motionlake("ingest", tmp_path / "damaged", "--lake", lake, "--scheduler", scheduler, "--json")
    assert run.status == 1, run.err
    assert run.json["failed"] == 0
    taken = {r[0] for r in query(lake, "SELECT DISTINCT path FROM clips")}
    rejected = {r[0] for r in query(lake, "SELECT path FROM rejects")}
    assert not taken & rejected
    assert taken | rejected == {p.relative_to(tmp_path / "damaged").as_posix() for p in paths}
    assert len(rejected) == run.json["rejected"]
    assert all(reason for (reason,) in query(lake, "SELECT reason FROM rejects"))
    run = motionlake("run", "all", "--lake", lake, "--scheduler", scheduler)
    assert run.status == 1, run.err
    assert query(lake, "SELECT count(*) FROM clips ANTI JOIN signatures USING (clip)") == [(0,)]
