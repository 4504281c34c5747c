"""Sparse poses: a motion by a few poses, equally far apart in moved distance (section 4.3.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.glogen.trajectories.motion import FPS, JOINTS_GIVEN, BodyMotion, interpolated
from motionlake.motion.clip import FloatArray

POSES: Final = 500  # that a motion is brought to, at equal moved distances
SPARSE: Final = 20  # of them that stand for it
PIECE: Final = 100  # frames, of what long clips are broken into
# Columns of a sparse pose.
JOINT_COLUMNS: Final = slice(0, 3 * JOINTS_GIVEN)
HEIGHT: Final = 3 * JOINTS_GIVEN
STEP: Final = slice(HEIGHT + 1, HEIGHT + 3)
TURN: Final = HEIGHT + 3
DURATION: Final = HEIGHT + 4
WIDTH: Final = HEIGHT + 5
# A body that holds still moves on at this share of its mean speed, so that time does not stop there.
STILL: Final = 0.05
LEAST: Final = 1e-5  # body lengths a frame that any body counts as moving: rounding is no motion
SHORTEST: Final = 1e-3  # seconds between sparse poses


@dataclass(frozen=True)
class SparseMotion:
    """n sparse poses.

    Attributes:
        rows: [n, 65]: 20 joints, height of the hips, and from the pose before to this one: where the hips went to the
            left and forward (seen from the pose before, body lengths), how far the body turned (radians), and the
            logarithm of the seconds that took. The first pose repeats those of the second.
        places: [n] frames of the motion, fractional.
    """

    rows: FloatArray
    places: FloatArray


def uniform_places(motion: BodyMotion, count: int = POSES) -> FloatArray:
    """[count] fractional frames between which the joints move equally far, seen from the body."""
    moved = np.linalg.norm(np.diff(motion.joints, axis=0), axis=2).mean(axis=1)
    moved = moved + STILL * moved.mean() + LEAST
    distance = np.concatenate([[0.0], np.cumsum(moved)])
    places: FloatArray = np.interp(np.linspace(0, distance[-1], count), distance, np.arange(len(distance)))
    return places


def sparse_motion(motion: BodyMotion, count: int = SPARSE) -> SparseMotion:
    """The sparse poses of a motion of two frames at least: evenly among `POSES`, from its first frame to its last."""
    chosen = np.round(np.linspace(0, POSES - 1, count)).astype(int)
    return poses_at(motion, uniform_places(motion)[chosen])


def even_motion(motion: BodyMotion) -> SparseMotion:
    """Sparse poses as far apart on average, in time, as those of a piece of `PIECE` frames."""
    return poses_at(motion, uniform_places(motion, even_poses(len(motion))))


def even_poses(frames: int) -> int:
    """How many sparse poses `even_motion` has of a motion of so many frames."""
    return max(2, 1 + round((frames - 1) * (SPARSE - 1) / (PIECE - 1)))


def poses_at(motion: BodyMotion, places: FloatArray) -> SparseMotion:
    """Sparse poses at given frames, ascending; two at least."""
    joints = interpolated(motion.joints.reshape(len(motion), -1), places)
    height = interpolated(motion.height[:, None], places)
    yaw = np.concatenate([[0.0], np.cumsum(motion.turn[:-1]) / FPS])
    path = np.concatenate([np.zeros((1, 2)), np.cumsum(_rotated(motion.velocity, yaw)[:-1], axis=0) / FPS])
    there, facing = interpolated(path, places), interpolated(yaw[:, None], places)[:, 0]
    steps = _rotated(np.diff(there, axis=0), -facing[:-1])
    seconds = np.maximum(np.diff(places) / FPS, SHORTEST)
    between = np.concatenate([steps, np.diff(facing)[:, None], np.log(seconds)[:, None]], axis=1)
    rows = np.concatenate([joints, height, np.concatenate([between[:1], between])], axis=1)
    return SparseMotion(rows, places)


def _rotated(steps: FloatArray, yaw: FloatArray) -> FloatArray:
    """[n, 2] steps (left, forward) turned by yaw [n]."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    left, forward = steps[:, 0], steps[:, 1]
    return np.stack([left * cosine + forward * sine, forward * cosine - left * sine], axis=1)
