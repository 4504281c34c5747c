"""Clips as long as those of BONES-SEED out of shorter recordings: BVH at 120 frames a second, no two equal.

Each is a recording of cmu_bvh from a frame drawn by seed on, to its end and back and to its end again until it is as
long as drawn (gamma distribution of shape 2 and mean 7.3 s), at a pace between .8 and 1.25 that drifts within the
clip. Frames are taken as the file has them, the nearest in time, so that nothing is interpolated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.arrays import Int64Array

MEAN: Final = 7.3  # seconds
SHAPE: Final = 2.0
SHORTEST: Final = 1.0
FPS: Final = 120.0
SLOWEST, FASTEST = 0.8, 1.25


@dataclass(frozen=True)
class Recording:
    """A BVH file: what stands before its frames, and a line a frame."""

    name: str
    head: bytes
    frame_time: bytes
    frames: Sequence[bytes]


def read_recordings(data: Path) -> list[Recording]:
    """Every BVH file of cmu_bvh."""
    found = []
    for path in sorted((data / "cmu_bvh" / "clips").glob("*.bvh")):
        head, _, motion = path.read_bytes().partition(b"MOTION")
        lines = motion.strip().splitlines()
        found.append(Recording(path.stem, head, lines[1], [line for line in lines[2:] if line.strip()]))
    return found


def places(recorded: int, frames: int, rng: np.random.Generator) -> Int64Array:
    """[frames] which of so many recorded frames stands at each place: from one drawn on, there and back."""
    pace = np.interp(np.arange(frames), np.linspace(0, frames, 4), rng.uniform(SLOWEST, FASTEST, 4))
    walked = rng.integers(0, recorded) + np.cumsum(pace).round().astype(np.int64)
    turned = walked % max(1, 2 * recorded - 2)
    return np.minimum(turned, 2 * recorded - 2 - turned) if recorded > 1 else np.zeros(frames, dtype=np.int64)


def write_long_clips(recordings: Sequence[Recording], first: int, stop: int, folder: Path, mean: float = MEAN) -> int:
    """Write the clips numbered [first, stop) below a folder, a folder a thousand; returns how many frames they have.

    `mean`: seconds that a clip lasts in the mean.

    A clip depends on its number alone, so any cut into shards writes the same files.
    """
    written = 0
    for number in range(first, stop):
        rng = np.random.default_rng([7, number])
        recording = recordings[int(rng.integers(len(recordings)))]
        frames = round(max(SHORTEST, rng.gamma(SHAPE, mean / SHAPE)) * FPS)
        lines = [recording.frames[at] for at in places(len(recording.frames), frames, rng).tolist()]
        target = folder / f"{number // 1000:03}" / f"{recording.name}_{number:06}.bvh"
        target.parent.mkdir(parents=True, exist_ok=True)
        head = recording.head + b"MOTION\nFrames: %d\n" % frames + recording.frame_time + b"\n"
        target.write_bytes(head + b"\n".join([*lines, b""]))
        written += frames
    return written
