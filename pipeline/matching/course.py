"""What a motion plays: the classes and speeds it is to have, what it starts from, and the course that comes of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from motionlake.arrays import BoolArray, Float32Array, Float64Array

GIVEN: Final = 15  # frames that a motion goes on from


@dataclass(frozen=True)
class Part:
    """Frames from `first` on are of one class.

    Attributes:
        target: its index.
        first: frame.
        speed: body lengths a second that it gets to; None: as recorded.
        held: it is kept to that speed; else, once it had time to get to it, it goes as recorded.
    """

    target: int
    first: int
    speed: float | None = None
    held: bool = False


@dataclass(frozen=True)
class Start:
    """What is played on from.

    Attributes:
        query: [48] features of the last given frame.
        aloft: frames for which no foot was near the ground then.
        step: [3] of the root there: left, ahead, turn, a second.
        place: [2] body lengths, of the root in the first frame.
        heading: radians, likewise.
        before: [48] features of the given frame a tenth of a second before; None: none is given.
    """

    query: Float32Array
    aloft: float
    step: Float64Array
    place: Float64Array
    heading: float
    before: Float32Array | None = None


@dataclass(frozen=True)
class Course:
    """T frames of a motion.

    Attributes:
        at: [T] frames of the database, fractional.
        mirrored: [T].
        place: [T, 2] of the root, body lengths.
        heading: [T] radians.
        jumps: frames at which a run begins; the first is 0.
    """

    at: Float64Array
    mirrored: BoolArray
    place: Float64Array
    heading: Float64Array
    jumps: list[int]
