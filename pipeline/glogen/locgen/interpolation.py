"""Poses between sparse poses, on straight lines (equation 4.3) or smooth ones: what LocGen makes natural.

Equation 4.3 as printed, alpha X_i + (1 - alpha) X_{i+1} with alpha = j / M, runs from X_{i+1} back to X_i. Here the
poses run from X_i to X_{i+1}, as its text has it.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.glogen.trajectories.sparse import DURATION, HEIGHT, STEP, TURN
from scipy.interpolate import PchipInterpolator

WIDTH: Final = HEIGHT + 1 + 2 + 1 + 2  # joints, height, velocity, turning, where between two poses, seconds there


def between(first: Float64Array, second: Float64Array, count: int) -> Float64Array:
    """[M, d] M = `count` poses after the pose `first` [d], the last of them `second`: equation 4.3, forwards."""
    share = np.arange(1, count + 1)[:, None] / count
    poses: Float64Array = (1 - share) * first + share * second
    return poses


def times_of(rows: Float64Array) -> Float64Array:
    """[n] seconds of sparse poses [n, 65], the first at 0."""
    return np.concatenate([[0.0], np.cumsum(np.exp(rows[1:, DURATION]))])


def interpolated_motion(rows: Float64Array, times: Float64Array, at: Float64Array) -> Float64Array:
    """Sparse poses at given times.

    Args:
        rows: [n, 65] sparse poses.
        times: [n] seconds of them, ascending.
        at: [T] seconds, within.

    Returns:
        [T, 66]: 60 joint coordinates and height, by cubics that do not overshoot (Fritsch and Butland, 1984), which on
        recorded motion are nearer to it than straight lines; velocity of the hips (left, forward, body lengths a
        second) and turning (radians a second), even from pose to pose; how far between its two poses an instant is,
        0 to 1; the logarithm of the seconds between these.
    """
    index = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    seconds = times[index + 1] - times[index]
    share = ((at - times[index]) / seconds)[:, None]
    poses = PchipInterpolator(times, rows[:, : HEIGHT + 1])(at)
    left, forward = (rows[index + 1, STEP] / seconds[:, None]).T
    turned = rows[index + 1, TURN] * share[:, 0]
    cosine, sine = np.cos(turned), np.sin(turned)
    # Steps are seen from the pose before; the body has turned since.
    velocity = np.stack([left * cosine - forward * sine, forward * cosine + left * sine], axis=1)
    turning = (rows[index + 1, TURN] / seconds)[:, None]
    return np.concatenate([poses, velocity, turning, share, np.log(seconds)[:, None]], axis=1)
