"""The windows of a clip that pieces of motion are compared with, in the clip's own frames."""

from __future__ import annotations

import numpy as np
from motionlake.deephums.descriptors.sequence import FPS
from motionlake.deephums.submotions.config import LONGEST, SHORT


def frames_of(n_frames: int, fps: float) -> int:
    """How many frames `clip_sequence` makes of so many at a rate."""
    return max(1, round((n_frames - 1) / fps * FPS) + 1)


def piece_windows(n_frames: int, fps: float) -> list[tuple[int, int]]:
    """Windows [start, stop) of a clip of so many frames at its own rate, in order: long ones, and short ones inside.

    Both reach from its first frame to its last; each starts at most half a window after the one before. Long ones have
    at most `LONGEST` frames at 30 a second, short ones `SHORT`. A clip that is no longer is one window.
    """
    found = {*_covering(n_frames, fps, LONGEST), *_covering(n_frames, fps, SHORT)}
    return sorted(found)


def _covering(n_frames: int, fps: float, longest: int) -> list[tuple[int, int]]:
    width = int((longest - 1) / FPS * fps) + 1
    if frames_of(n_frames, fps) <= longest or n_frames <= width:
        return [(0, n_frames)]
    count = int(np.ceil((n_frames - width) / (width / 2))) + 1
    starts = np.linspace(0, n_frames - width, count).round().astype(int).tolist()
    return [(start, start + width) for start in starts]
