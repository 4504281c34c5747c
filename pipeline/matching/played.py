"""What a motion has played already: not again at once, and of the recordings of a class not one for long alone."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, Int64Array
from motionlake.matching.database import MotionDatabase

AGAIN: Final = 150  # frames until what was played may be played again at no cost
BESIDE: Final = 8  # frames about one that count as played with it
PLAYED: Final = 4.0  # tolerances that a frame costs which was played just now
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
