"""What rows cost beside their distance: those that were played, that end too soon or late, that come from elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.matching.database import APART, MotionDatabase
from motionlake.matching.recordings import FPS
from motionlake.matching.search import distances

AGAIN: Final = 150  # frames until what was played may be played again at no cost
BESIDE: Final = 8  # frames about one that count as played with it
PLAYED: Final = 4.0  # tolerances that a frame costs which was played just now
REST: Final = 30  # frames that should follow where a run begins
SHORT: Final = 3.0  # tolerances that a run costs of which nothing is left
LEAST: Final = 4  # frames that must follow
LATE: Final = 4.0  # tolerances that a run of an action costs which ends a second before the motion does, or after it
IN_TIME: Final = 15  # frames about the end of a motion in which an action may end that comes to rest
STRETCH: Final = 1.15  # times as fast or slow that another action is played at most, to end with the motion
BEFORE: Final = 0.5  # weight of the frames a tenth of a second before
UNEVEN: Final = 2.0  # tolerances that a recording costs which was played for `AGAIN` frames more than its share


class Played:
    """The frames of a database that a motion has played, and when."""

    def __init__(self, database: MotionDatabase) -> None:
        self._data = database
        self._last = np.full(len(database), -np.inf)
        self._frames = np.zeros(len(database.pieces))  # played of each piece
        self._lengths = (database.pieces[:, 1] - database.pieces[:, 0]).astype(float)

    def mark(self, frame: int, t: int) -> None:
        """A frame is played at a time."""
        self._last[max(0, frame - BESIDE) : frame + BESIDE] = t
        self._frames[self._data.piece_of[frame]] += 1

    def costs(self, frames: Int64Array, target: int, t: int, *, even: bool) -> Float64Array:
        """[n] tolerances that frames of a class cost; where `even`, more of recordings that had more than their share.

        A motion that goes on where poses are nearest stays in the recordings that are like the one that it began in.
        """
        costs = PLAYED * np.maximum(1 - (t - self._last[frames]) / AGAIN, 0)
        if even:
            own = self._data.pieces[:, 2] == target
            share = np.where(own, self._lengths, 0) / self._lengths[own].sum()
            over = np.maximum(self._frames - share * self._frames[own].sum(), 0) / AGAIN
            costs += UNEVEN * over[self._data.piece_of[frames]]
        return np.asarray(costs)


def costs_of_short(database: MotionDatabase, rows: Int64Array, rest: float = REST) -> Float64Array:
    """[n] what rows cost after which less than `rest` frames are left of the recording."""
    left = database.left[rows % len(database)]
    cost = SHORT * database.tolerance * np.clip(1 - left / max(rest, 1.0), 0, None) ** 2
    return np.where(left >= min(LEAST, rest), cost, np.inf)


@dataclass(frozen=True)
class Ending:
    """How the last action of a motion ends with it.

    Attributes:
        database: that is played.
        target: class of the last part of the motion.
        whole: it is an action, and there is time for half of it at least.
        rests: it comes to rest.
    """

    database: MotionDatabase
    target: int
    whole: bool
    rests: bool

    @classmethod
    def of(cls, database: MotionDatabase, target: int, frames: float) -> Ending:
        """Of a motion whose last part has time for so many frames."""
        pieces = database.pieces[database.pieces[:, 2] == target]
        half = np.median(pieces[:, 1] - pieces[:, 0]) / 2
        whole = bool(frames >= half and database.is_action(target))
        return cls(database, target, whole, whole and database.is_resting(target))

    def costs(self, remaining: float) -> Float64Array:
        """[n] what rows of the class cost whose recordings do not end when so many frames are over."""
        rows = self.database.rows[self.target]
        if not self.whole:
            return np.zeros(len(rows))
        off = np.abs(self.database.left[rows % len(self.database)] - remaining)
        return np.asarray(LATE * self.database.tolerance * np.minimum(off / FPS, 1.0))

    def pace(self, left: float, remaining: float) -> float | None:
        """How fast an action of which so many frames are left is played, to end with the motion; None if it cannot.

        One that comes to rest is played as recorded, and may end up to `IN_TIME` frames after the motion; where it ends
        before, what it rests for is played slower, so that no body is frozen.
        """
        if not self.whole:
            return None
        if remaining < 1:
            return 1.0
        if self.rests:
            if abs(left - remaining) > IN_TIME:
                return None
            return 1.0 if left >= min(remaining, IN_TIME) else left / remaining
        pace = left / remaining
        return pace if 1 / STRETCH <= pace <= STRETCH else None


def costs_of_before(database: MotionDatabase, target: int, before: Float32Array, weights: Float32Array) -> Float64Array:
    """[n] what rows of a class cost where the frames a tenth of a second before them are unlike a given one.

    Args:
        database: N frames.
        target: class.
        before: [48] features of the given frame.
        weights: [48] by which features are compared.

    The first rows of a recording, which have no such frame, are compared themselves.
    """
    rows = database.rows[target]
    frames = rows % len(database)
    there = frames - APART >= database.pieces[database.piece_of[frames], 0]
    out = np.empty(len(rows), dtype=np.float32)
    distances(database.compared, np.where(there, rows - APART, rows), before, weights, out)
    return BEFORE * out.astype(float)
