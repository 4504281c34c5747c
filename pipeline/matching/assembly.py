"""From a course through the database to poses of a body in the world."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from motionlake.arrays import BoolArray, Float64Array
from motionlake.matching.course import Course
from motionlake.matching.database import MotionDatabase
from motionlake.matching.inertia import GIVEN_HALF_LIFE, HALF_LIFE, joined_points, joined_rotations
from motionlake.matching.recordings import FPS, about_y
from motionlake.motion.rotations import conjugate, multiply, normalise, turn_on_ground
from motionlake.motion.skeleton import mirrored_rotations


@dataclass(frozen=True)
class Poses:
    """T poses from the root: rotations [T, 21, 4], hips [T, 3] in body lengths, stands [T, 4] of the feet's joints."""

    rotations: Float64Array
    hips: Float64Array
    stands: BoolArray


def read_poses(database: MotionDatabase, at: Float64Array, mirrored: bool) -> Poses:
    """The poses at fractional frames [T] of one piece."""
    low = np.floor(at).astype(int)
    last = database.pieces[database.piece_of[low], 1] - 1
    high, share = np.minimum(low + 1, last), at - low
    one, other = database.rotations[low].astype(float), database.rotations[high].astype(float)
    other = np.where((one * other).sum(axis=-1, keepdims=True) < 0, -other, other)
    rotations = normalise(one + share[:, None, None] * (other - one))
    hips = database.hips[low] * (1 - share[:, None]) + database.hips[high] * share[:, None]
    stands = database.stands[np.where(share > 0.5, high, low)]
    if not mirrored:
        return Poses(rotations, hips, stands)
    return Poses(
        np.asarray(mirrored_rotations(rotations), dtype=float),
        hips * np.array([-1.0, 1.0, 1.0]),
        stands[:, [2, 3, 0, 1]],
    )


def assembled(database: MotionDatabase, course: Course, shown: Poses | None) -> Poses:
    """The poses of a course, its runs joined.

    Args:
        database: that it goes through.
        course: T frames.
        shown: the last two poses before it; None: it begins as recorded.
    """
    count = len(course.at)
    rotations, hips = np.empty((count, 21, 4)), np.empty((count, 3))
    stands = np.empty((count, 4), dtype=np.bool_)
    for start, stop in pairwise([*course.jumps, count]):
        run = read_poses(database, course.at[start:stop], bool(course.mirrored[start]))
        stands[start:stop] = run.stands
        if start == 0 and shown is None:
            rotations[:stop], hips[:stop] = run.rotations, run.hips
            continue
        last = shown if start == 0 and shown is not None else None
        if last is None:
            first = max(0, start - 2)
            last = Poses(rotations[[first, start - 1]], hips[[first, start - 1]], stands[[first, start - 1]])
        before = _poses_before(database, float(course.at[start]), bool(course.mirrored[start]))
        half_life = GIVEN_HALF_LIFE if start == 0 else HALF_LIFE
        rotations[start:stop] = joined_rotations(last.rotations, run.rotations, before.rotations, FPS, half_life)
        hips[start:stop] = joined_points(last.hips, run.hips, before.hips, FPS, half_life)
    return Poses(rotations, hips, stands)


def _poses_before(database: MotionDatabase, row: float, mirrored: bool) -> Poses:
    """The poses one frame before a row and at it; before the first frame of a piece a body came as it goes on."""
    first, end = database.pieces[database.piece_of[int(row)], :2]
    if row - 1 >= first:
        return read_poses(database, np.array([row - 1, row]), mirrored)
    pair = read_poses(database, np.array([row, min(end - 1.0, row + 1)]), mirrored)
    (here, there), (at, to) = pair.rotations, pair.hips
    rotations = np.stack([multiply(multiply(here, conjugate(there)), here), here])
    return Poses(rotations, np.stack([2 * at - to, at]), pair.stands)


def in_world(poses: Poses, course: Course, size: float) -> tuple[Float64Array, Float64Array]:
    """Hips [T, 3], metres over the ground, and local rotations [T, 21, 4] in the world."""
    rotations = poses.rotations.copy()
    rotations[:, 0] = multiply(about_y(course.heading), rotations[:, 0])
    x, z = turn_on_ground(poses.hips[:, 0], poses.hips[:, 2], course.heading)
    hips = np.stack([course.place[:, 0] + x, poses.hips[:, 1], course.place[:, 1] + z], axis=1)
    return hips * size, rotations
