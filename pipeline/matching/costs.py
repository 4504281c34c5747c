"""What rows of a database cost that a motion could play next: how far they are from what is wanted, and what else."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.matching.database import MotionDatabase
from motionlake.matching.played import REST, Ending, Played, costs_of_before, costs_of_short
from motionlake.matching.search import distances

# Tolerances that a frame costs by which flights do not fit: joined, they would be of another length.
FLIGHT: Final = 1.0
TOO_LONG: Final = 8.0  # tolerances that a frame costs from which a flight is longer than any that is recorded


class RowCosts:
    """Of one motion of some classes what rows cost; `style` [2 N] is what they cost beside all else (`style_costs`).

    Attributes:
        even: no manner is asked for, so that recordings are to be played alike.
        short: of each class [n] what rows cost after which little is left of the recording (`costs_of_short`).
    """

    def __init__(self, database: MotionDatabase, targets: Iterable[int], style: Float64Array | None = None) -> None:
        self._data, self._played, self.even = database, Played(database), style is None
        self._rows = {target: database.rows[target] for target in targets}
        self._frames = {target: rows % len(database) for target, rows in self._rows.items()}
        self._flights = {target: database.longest_flight(target) for target in self._rows}
        self._style = {target: np.zeros(1) if style is None else style[rows] for target, rows in self._rows.items()}
        self.short = {target: costs_of_short(database, rows) for target, rows in self._rows.items()}

    def mark(self, frame: int, t: int) -> None:
        """A frame is played at a time."""
        self._played.mark(frame, t)

    def of(
        self, target: int, query: Float32Array, weights: Float32Array, aloft: float, t: int, left: float,
        *, even: bool, ending: Ending | None = None, before: Float32Array | None = None,
    ) -> Float64Array:  # fmt: skip
        """[n] of the rows of a class.

        Args:
            target: class.
            query: [48] features that are wanted.
            weights: [48] by which features are compared.
            aloft: frames for which the body was in the air until then.
            t: frame of the motion.
            left: recorded frames for which there is time to its end.
            even: recordings that had more than their share cost more.
            ending: how the motion ends with the action; None: it does not.
            before: [48] features of the given frame a tenth of a second before, where the motion begins; None: of none.
        """
        rows, frames = self._rows[target], self._frames[target]
        out = np.empty(len(rows), dtype=np.float32)
        distances(self._data.compared, rows, query, weights, out)
        beside = self._played.costs(frames, target, t, even=even and self.even)
        beside += FLIGHT * np.abs(self._data.aloft[frames] - aloft)
        landing = self._data.landing[frames]
        beside += TOO_LONG * (aloft + landing > self._flights[target]) * (landing > 0)
        short = self.short[target] if left >= REST else costs_of_short(self._data, rows, left)
        late = 0.0 if ending is None else ending.costs(left)
        found = out + short + self._style[target] + late + self._data.tolerance * beside
        if before is not None:
            found += costs_of_before(self._data, target, before, self._data.pose_scales)
        return np.asarray(found)
