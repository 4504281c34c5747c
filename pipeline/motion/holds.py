"""Where a recording holds a pose as no body can: it stops within one frame, or goes off within one."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray
from motionlake.motion.runs import runs

STILL: Final = 1e-4  # metres by which no joint of a pose that is held moves in a frame
AT_ONCE: Final = 0.2  # metres a second, mean over the joints, of the frame before that or after
SHORTEST: Final = 2  # steps: a frame that comes twice is no hold
OFTEN: Final = 1.0  # a second: the frames of a slower recording, each several times, are no holds


def held_ranges(positions: FloatArray, fps: float) -> list[tuple[int, int]]:
    """Ranges [first, last] of frames that are one pose, which the body gets into or out of within one frame.

    Args:
        positions: [F, 21, 3] joints, metres.
        fps: frames a second.
    """
    steps = np.linalg.norm(np.diff(positions.astype(np.float64), axis=0), axis=2)
    still = runs(np.asarray(steps.max(axis=1, initial=0.0) < STILL), 0, SHORTEST)
    found = [(a, b) for a, b in still if _speed_beside(steps, a, b) * fps > AT_ONCE]
    return found if len(found) * fps <= OFTEN * max(len(positions), fps) else []


def _speed_beside(steps: Float64Array, start: int, stop: int) -> float:
    """Metres a frame of the faster of the steps before and after some, of steps [S, 21]."""
    beside = [steps[i].mean() for i in (start - 1, stop) if 0 <= i < len(steps)]
    return float(max(beside, default=0.0))
