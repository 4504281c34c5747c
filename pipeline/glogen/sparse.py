"""Sparse poses: a motion by a few poses, equally far apart in moved distance (section 4.3.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.glogen.config import SPARSE
from motionlake.glogen.trajectories import FPS, JOINTS_GIVEN, BodyMotion, mirrored, turned_steps
from motionlake.motion.resampling import interpolated

POSES: Final = 500  # that a motion is brought to, at equal moved distances
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

    rows: Float64Array
    places: Float64Array


def uniform_places(motion: BodyMotion, count: int = POSES) -> Float64Array:
    """[count] fractional frames between which the joints move equally far, seen from the body."""
    moved = np.linalg.norm(np.diff(motion.joints, axis=0), axis=2).mean(axis=1)
    moved = moved + STILL * moved.mean() + LEAST
    distance = np.concatenate([[0.0], np.cumsum(moved)])
    places: Float64Array = np.interp(np.linspace(0, distance[-1], count), distance, np.arange(len(distance)))
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


def poses_at(motion: BodyMotion, places: Float64Array) -> SparseMotion:
    """Sparse poses at given frames, ascending; two at least."""
    poses = interpolated(motion.rows[:, : HEIGHT + 1], places)
    yaw = np.concatenate([[0.0], np.cumsum(motion.turn[:-1]) / FPS])
    path = np.concatenate([np.zeros((1, 2)), np.cumsum(turned_steps(motion.velocity, yaw)[:-1], axis=0) / FPS])
    there, facing = interpolated(path, places), interpolated(yaw[:, None], places)[:, 0]
    steps = turned_steps(np.diff(there, axis=0), -facing[:-1])
    seconds = np.maximum(np.diff(places) / FPS, SHORTEST)
    between = np.concatenate([steps, np.diff(facing)[:, None], np.log(seconds)[:, None]], axis=1)
    rows = np.concatenate([poses, np.concatenate([between[:1], between])], axis=1)
    return SparseMotion(rows, places)


LONGEST: Final = 150  # frames, of a clip that is one piece
# A clip goes on where it ends if its last frames move at this share of its mean speed at least.
ENDING: Final = 5
MOVING: Final = 0.5


@dataclass(frozen=True)
class TrainingPiece:
    """A motion to train on, its sparse poses, and which class it shows."""

    motion: BodyMotion
    sparse: SparseMotion
    target: int


def pieces(
    motions: Sequence[BodyMotion],
    targets: Sequence[int],
    *,
    count: int = SPARSE,
    stride: int = PIECE,
    mirror: bool = False,
    cyclic: Sequence[bool] = (),
    again: int = 0,
) -> list[TrainingPiece]:
    """Clips of at most `LONGEST` frames as they are, longer ones in pieces of `PIECE`, one every `stride` frames.

    Args:
        motions: of two frames at least each.
        targets: class of each.
        count: of sparse poses of each piece.
        stride: frames; `PIECE`: contiguous pieces, as the thesis has them.
        mirror: adds every piece reflected left to right.
        cyclic: whether each class is cyclic (`cyclic_classes`); none by default. Clips of such classes are not cut, and
            have as many sparse poses as their length asks for (`even_motion`).
        again: frames from one piece of `PIECE` frames to the next that clips of such classes are read in, so that their
            sparse poses lie elsewhere in each; 0: they are read whole.
    """
    made = []
    for motion, target in zip(motions, targets, strict=True):
        on = bool(cyclic) and cyclic[target]
        for start, stop in overlapping(len(motion), again) if on else ranges(len(motion), stride):
            piece = motion.cut(start, stop)
            for one in (piece, mirrored(piece)) if mirror else (piece,):
                made.append(TrainingPiece(one, even_motion(one) if on else sparse_motion(one, count), target))
    return made


def overlapping(frames: int, again: int) -> list[tuple[int, int]]:
    """Pieces [start, stop) of `PIECE` frames of a clip, one every `again` frames; the whole clip where it is 0."""
    if not again or frames <= PIECE:
        return [(0, frames)]
    return [(start, start + PIECE) for start in range(0, frames - PIECE + 1, again)]


def cyclic_classes(motions: Sequence[BodyMotion], targets: Sequence[int], classes: int) -> list[bool]:
    """[C] whether the motion of a class is cyclic, as walking, or an action with an end, as a kick.

    A class is cyclic if most of its clips end while they move, or are longer than `LONGEST`.
    """
    ended: list[list[bool]] = [[] for _ in range(classes)]
    for motion, target in zip(motions, targets, strict=True):
        speed = np.linalg.norm(np.diff(motion.joints, axis=0), axis=2).mean(axis=1)
        moving = float(speed[-ENDING:].mean()) >= MOVING * float(speed.mean()) > 0
        ended[target].append(not (moving or len(motion) > LONGEST))
    return [bool(several) and float(np.mean(several)) < 0.5 for several in ended]


def reach(
    motions: Sequence[BodyMotion], targets: Sequence[int], cyclic: Sequence[bool], given: int, count: int = SPARSE
) -> list[int]:
    """[C] how many sparse poses after the `given` ones the motions of a class have, of `count` in all: their median.

    Of a class that comes to its end all; of clips too short to have any, one.
    """
    poses: list[list[int]] = [[] for _ in cyclic]
    for motion, target in zip(motions, targets, strict=True):
        poses[target].append(even_poses(len(motion)) - given)
    return [
        max(1, min(count - given, int(np.median(own)))) if on and own else count - given
        for own, on in zip(poses, cyclic, strict=True)
    ]


def ranges(frames: int, stride: int = PIECE) -> list[tuple[int, int]]:
    """The pieces [start, stop) of a clip; the last one ends with it."""
    if frames <= LONGEST:
        return [(0, frames)]
    starts = [*range(0, frames - PIECE, stride), frames - PIECE]
    return [(start, start + PIECE) for start in starts]
