"""Many different clips out of few: real recordings cut to random ranges of their frames, in their own formats."""

from __future__ import annotations

import io
import re
import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.formats import read_clips

SECONDS: Final = (1.0, 2.0)
_AMC_FRAME: Final = re.compile(rb"^\d+\s*$", re.MULTILINE)
Cut = Callable[[int, int], bytes]


@dataclass(frozen=True)
class Recording:
    """A real clip ready to be cut.

    Attributes:
        name: of the set and the file.
        suffix: of files in its format.
        frames: how many it has.
        fps: frames a second.
        cut: the bytes of a file with frames [start, stop).
    """

    name: str
    suffix: str
    frames: int
    fps: float
    cut: Cut


def recordings_to_cut(data: Path, each: int = 40) -> list[Recording]:
    """Up to `each` clips of four sets (BVH of two rigs, AMC, positions), evenly spread over each set."""
    opened = (
        [_open(path, set_name, cut) for path in _spread(sorted((data / set_name / "clips").rglob(pattern)), each)]
        for set_name, pattern, cut in (
            ("hdm05", "*.amc", cut_amc),
            ("bandai1", "*.bvh", cut_bvh),
            ("cmu_bvh", "*.bvh", cut_bvh),
            ("utd_mhad", "*.npz", _npz),
        )
    )
    # One of each set in turn, so that every thousand clips holds the same mixture.
    return [recording for group in zip(*opened, strict=False) for recording in group]


def write_trimmed(recordings: Sequence[Recording], data: Path, count: int, folder: Path, seed: int = 0) -> int:
    """Write `count` clips of 1 to 2 s, each another range of frames, below `folder`; returns their bytes."""
    rng = np.random.default_rng(seed)
    folder.mkdir(parents=True)
    for skeleton in sorted((data / "hdm05" / "clips").glob("*.asf")):
        shutil.copy(skeleton, folder)
    written = 0
    for i in range(count):
        recording = recordings[i % len(recordings)]
        length = min(recording.frames, round(rng.uniform(*SECONDS) * recording.fps))
        start = int(rng.integers(0, recording.frames - length + 1))
        content = recording.cut(start, start + length)
        target = folder / f"{i // 1000:03}" / f"{recording.name}_{i:05}{recording.suffix}"
        target.parent.mkdir(exist_ok=True)
        target.write_bytes(content)
        written += len(content)
    return written


def _spread(paths: Sequence[Path], count: int) -> Iterator[Path]:
    yield from paths[:: max(1, len(paths) // count)][:count]


def _open(path: Path, set_name: str, cut: Callable[[Path], Cut]) -> Recording:
    clip = read_clips(path)[0]
    # An AMC's name must begin with its skeleton's: HDM_bd, HDM_bk, …
    name = path.stem if set_name == "hdm05" else f"{set_name}_{path.stem}"
    return Recording(name, path.suffix, len(clip.channels), clip.fps, cut(path))


def cut_bvh(path: Path) -> Cut:
    """Of a BVH file: the bytes of one with frames [start, stop)."""
    head, _, motion = path.read_bytes().partition(b"MOTION")
    lines = motion.strip().splitlines()
    frame_time, rows = lines[1], [line for line in lines[2:] if line.strip()]
    return lambda start, stop: b"\n".join(
        [head + b"MOTION", b"Frames: %d" % len(rows[start:stop]), frame_time, *rows[start:stop], b""]
    )


def cut_amc(path: Path) -> Cut:
    """Of an AMC file: the bytes of one with frames [start, stop)."""
    content = path.read_bytes()
    places = [match.start() for match in _AMC_FRAME.finditer(content)]
    frames = [content[a:b].partition(b"\n")[2] for a, b in zip(places, [*places[1:], len(content)], strict=True)]
    head = content[: places[0]]
    return lambda start, stop: (
        head + b"".join(b"%d\n%s" % (number, frame) for number, frame in enumerate(frames[start:stop], start=1))
    )


def _npz(path: Path) -> Cut:
    with np.load(path, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}

    def cut(start: int, stop: int) -> bytes:
        target = io.BytesIO()
        np.savez_compressed(target, **(arrays | {"positions": arrays["positions"][start:stop]}))
        return target.getvalue()

    return cut
