"""Long clips in pieces, each with its sparse poses, as training takes them (section 4.3.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.glogen.trajectories.motion import BodyMotion, mirrored
from motionlake.glogen.trajectories.sparse import PIECE, SPARSE, SparseMotion, even_motion, even_poses, sparse_motion
from numpy.typing import NDArray

LONGEST: Final = 150  # frames, of a clip that is one piece
# A clip goes on where it ends if its last frames move at this share of its mean speed at least.
ENDING: Final = 5
MOVING: Final = 0.5


@dataclass(frozen=True)
class Piece:
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
    going: Sequence[bool] = (),
    again: int = 0,
) -> list[Piece]:
    """Clips of at most `LONGEST` frames as they are, longer ones in pieces of `PIECE`, one every `stride` frames.

    Args:
        motions: of two frames at least each.
        targets: class of each.
        count: of sparse poses of each piece.
        stride: frames; `PIECE`: contiguous pieces, as the thesis has them.
        mirror: adds every piece reflected left to right.
        going: whether each class goes on (`goes_on`); none by default. Clips of such classes are not cut, and have as
            many sparse poses as their length asks for (`even_motion`).
        again: frames from one piece of `PIECE` frames to the next that clips of such classes are read in, so that their
            sparse poses lie elsewhere in each; 0: they are read whole.
    """
    made = []
    for motion, target in zip(motions, targets, strict=True):
        on = bool(going) and going[target]
        for start, stop in overlapping(len(motion), again) if on else ranges(len(motion), stride):
            piece = motion.cut(start, stop)
            for one in (piece, mirrored(piece)) if mirror else (piece,):
                made.append(Piece(one, even_motion(one) if on else sparse_motion(one, count), target))
    return made


def overlapping(frames: int, again: int) -> list[tuple[int, int]]:
    """Pieces [start, stop) of `PIECE` frames of a clip, one every `again` frames; the whole clip where it is 0."""
    if not again or frames <= PIECE:
        return [(0, frames)]
    return [(start, start + PIECE) for start in range(0, frames - PIECE + 1, again)]


def goes_on(motions: Sequence[BodyMotion], targets: Sequence[int], classes: int) -> list[bool]:
    """[C] whether the motion of a class goes on, as walking does, or comes to its end, as a kick does.

    It goes on if the most of its clips end while they move, or are longer than `LONGEST`.
    """
    ended: list[list[bool]] = [[] for _ in range(classes)]
    for motion, target in zip(motions, targets, strict=True):
        speed = np.linalg.norm(np.diff(motion.joints, axis=0), axis=2).mean(axis=1)
        moving = float(speed[-ENDING:].mean()) >= MOVING * float(speed.mean()) > 0
        ended[target].append(not (moving or len(motion) > LONGEST))
    return [bool(several) and float(np.mean(several)) < 0.5 for several in ended]


def reach(
    motions: Sequence[BodyMotion], targets: Sequence[int], going: Sequence[bool], given: int, count: int = SPARSE
) -> list[int]:
    """[C] how many sparse poses after the `given` ones the motions of a class have, of `count` in all: their median.

    Of a class that comes to its end all; of clips too short to have any, one.
    """
    poses: list[list[int]] = [[] for _ in going]
    for motion, target in zip(motions, targets, strict=True):
        poses[target].append(even_poses(len(motion)) - given)
    return [
        max(1, min(count - given, int(np.median(own)))) if on and own else count - given
        for own, on in zip(poses, going, strict=True)
    ]


def ranges(frames: int, stride: int = PIECE) -> list[tuple[int, int]]:
    """The pieces [start, stop) of a clip; the last one ends with it."""
    if frames <= LONGEST:
        return [(0, frames)]
    starts = [*range(0, frames - PIECE, stride), frames - PIECE]
    return [(start, start + PIECE) for start in starts]


def rows_of(made: list[Piece]) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Sparse poses [n, count, 65] and classes [n]."""
    return np.stack([piece.sparse.rows for piece in made]).astype(np.float32), np.array([p.target for p in made])
