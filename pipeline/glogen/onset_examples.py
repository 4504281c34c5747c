"""How recorded bodies stood and moved, and what followed: what the onset of a motion is learned from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array, Int64Array
from motionlake.glogen.sparse import HEIGHT
from motionlake.glogen.trajectories import FPS, BodyMotion, mirrored
from motionlake.motion.resampling import interpolated
from motionlake.motion.sides import unlike_mirrored

KNOTS: Final = (1, 2, 3, 4, 6, 8, 10, 13, 16, 20, 25, 30, 37, 45)  # frames that are predicted; smooth curves in between
LEVELS: Final = (20, 30, 45)  # frames that a clip goes on for after an example, at least
# Spans before a frame, of which it is seen how the joints moved: frames, from the nearer to the further end.
RECENT: Final = ((0, 1), (0, 3), (3, 8))
EARLIEST: Final = 3  # frame of a clip that is an example
LATEST: Final = 90  # frames of an action that are told apart by their number
ROOT: Final = HEIGHT + 4  # joints, height, velocity, turning
FEATURES: Final = ROOT + len(RECENT) * HEIGHT + 1
FUTURE: Final = len(KNOTS) * ROOT
# What counts alike: joints and height in body lengths, velocity and turning a second, speeds of joints, and seconds
# since an action began. How joints move says more than where they are.
SCALES: Final = np.concatenate(
    [np.full(HEIGHT, 0.2), [0.1], [0.6, 0.6], [2.0], np.full(len(RECENT) * HEIGHT, 0.6), [0.2]]
)
COMPARED: Final = 1000  # states of a class by which it is told whether it is done with one side


def state_at(motion: BodyMotion, places: Float64Array, cyclic: bool = True) -> Float64Array:
    """[n, 245] how a body stands and moves at fractional frames, from these and those before alone.

    The last column is the time since an action began, in seconds; nothing where the class is `cyclic`.
    """
    rows = motion.rows
    now = interpolated(rows, places)
    # Velocity and turning are towards the next frame: those of the frame before are known.
    now[:, HEIGHT + 1 :] = interpolated(rows[:, HEIGHT + 1 :], np.maximum(places - 1, 0))
    moved = []
    for near, far in RECENT:
        later, before = np.maximum(places - near, 0), np.maximum(places - far, 0)
        gone = (later - before)[:, None]
        change = interpolated(rows[:, :HEIGHT], later) - interpolated(rows[:, :HEIGHT], before)
        moved.append(change / np.maximum(gone, 1e-9) * FPS * (gone > 1e-6))
    since = np.zeros(len(places)) if cyclic else np.minimum(places, LATEST) / FPS
    return np.concatenate([now, *moved, since[:, None]], axis=1)


@dataclass(frozen=True)
class Examples:
    """n examples of one class.

    Attributes:
        states: [n, 245] in `SCALES`.
        futures: [n, 896] rows at `KNOTS`, less that of the state; zero beyond `lasting`.
        lasting: [n] of `LEVELS`, for how many frames the clip goes on.
        clips: [n] which clip each is of, its mirror image counted as the same.
    """

    states: Float64Array
    futures: Float64Array
    lasting: Int64Array
    clips: Int64Array

    def __len__(self) -> int:
        return len(self.states)

    def of(self, rows: BoolArray | Int64Array | slice) -> Examples:
        """Some of them."""
        return Examples(*(each[rows] for each in vars(self).values()))


def examples_of(
    motions: Sequence[BodyMotion], cyclic: bool, most: int, *, both: bool = False, pace: float = 1.0
) -> Examples:
    """Frames of clips that enough others follow, evenly chosen.

    Args:
        motions: whole clips of one class.
        cyclic: whether the class is.
        most: examples.
        both: those of the mirror images of the clips, too.
        pace: how many times as fast clips are played.
    """
    clips = [played_at(motion, pace) for motion in motions]
    clips += [mirrored(motion) for motion in clips] if both else []
    counts = [max(0, len(motion) - LEVELS[0] - EARLIEST) for motion in clips]
    stride = max(1, -(-sum(counts) // most))
    made, before = [_none()], 0
    for number, (motion, count) in enumerate(zip(clips, counts, strict=True)):
        at = EARLIEST + np.arange(-before % stride, count, stride)
        before += count
        made.append(_examples(motion, at, cyclic, number % len(motions)))
    return joined(made)


def _none() -> Examples:
    nothing = np.zeros(0, dtype=np.int64)
    return Examples(np.zeros((0, FEATURES)), np.zeros((0, FUTURE)), nothing, nothing)


def joined(parts: Sequence[Examples]) -> Examples:
    """The examples of all."""
    return Examples(*(np.concatenate(each) for each in zip(*(vars(part).values() for part in parts), strict=True)))


def _examples(motion: BodyMotion, at: Int64Array, cyclic: bool, clip: int) -> Examples:
    known, rows, last = state_at(motion, at.astype(float), cyclic), motion.rows, len(motion) - 1
    # Velocity and turning of a frame are towards the next one.
    later = rows[np.minimum(at[:, None] + np.array(KNOTS), last)] - known[:, None, :ROOT]
    lasting = np.array(LEVELS)[np.searchsorted(LEVELS, last - at, side="right") - 1]
    later[np.array(KNOTS) > lasting[:, None]] = 0.0
    return Examples(known / SCALES, later.reshape(len(at), FUTURE), lasting, np.full(len(at), clip))


def played_at(motion: BodyMotion, pace: float) -> BodyMotion:
    """A motion so many times as fast; which feet stand is not told."""
    if pace == 1.0:
        return motion
    rows = interpolated(motion.rows, np.arange(0, len(motion) - 1, pace))
    rows[:, HEIGHT + 1 :] *= pace
    return BodyMotion.of_rows(rows, np.zeros((len(rows), 2)))


def one_sided(motions: Sequence[BodyMotion], cyclic: bool) -> bool:
    """Whether clips of a class are done with one side (`unlike_mirrored`, by states)."""
    own, mirror = (examples_of(each, cyclic, COMPARED) for each in (motions, [mirrored(one) for one in motions]))
    return unlike_mirrored(own.states, mirror.states, own.clips, own.states, own.clips)
