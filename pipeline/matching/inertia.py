"""Joining runs of recorded frames: what differs at a join dies away (inertialisation; Bollo 2018).

The difference of pose and of speed between what was shown last and the new run is carried on as a critically damped
spring that comes to rest, and added to the new run: nothing is blended, so that only one run is read at a time.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.rotations import conjugate, from_vectors, multiply, to_vectors

HALF_LIFE: Final = 0.1  # seconds
GIVEN_HALF_LIFE: Final = 0.15  # after given frames, which recordings are further from than from one another


def decayed(
    value: Float64Array, speed: Float64Array, seconds: Float64Array, half_life: float = HALF_LIFE
) -> Float64Array:
    """[T, ...] of a difference [...] and its change a second [...], after so many seconds [T]."""
    y = 2 * math.log(2) / half_life
    after = seconds.reshape(-1, *[1] * np.ndim(value))
    return np.asarray(np.exp(-y * after) * (value + (speed + value * y) * after))


def joined_rotations(
    shown: Float64Array, run: Float64Array, before: Float64Array, fps: float, half_life: float = HALF_LIFE
) -> Float64Array:
    """A run of rotations that goes on from what was shown.

    Args:
        shown: [2, J, 4] the last two frames shown.
        run: [T, J, 4] the frames that follow.
        before: [2, J, 4] the frame of the run before its first, and its first.
        fps: frames a second.
        half_life: seconds in which a difference that does not change has mostly died away.

    Returns:
        [T, J, 4].
    """
    value = to_vectors(multiply(shown[1], conjugate(before[0])))
    moved, wanted = (to_vectors(multiply(pair[1], conjugate(pair[0]))) * fps for pair in (shown, before))
    seconds = np.arange(1, len(run) + 1) / fps
    return multiply(from_vectors(decayed(value, moved - wanted, seconds, half_life)), run)


def joined_points(
    shown: Float64Array, run: Float64Array, before: Float64Array, fps: float, half_life: float = HALF_LIFE
) -> Float64Array:
    """As `joined_rotations`, of points: shown [2, 3], run [T, 3], before [2, 3]."""
    value, speed = shown[1] - before[0], (np.diff(shown, axis=0)[0] - np.diff(before, axis=0)[0]) * fps
    return np.asarray(run + decayed(value, speed, np.arange(1, len(run) + 1) / fps, half_life))
