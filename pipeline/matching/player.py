"""Which recorded frames a motion plays one after the other, and where its root goes: the search of motion matching.

A run of recorded frames is played until another one fits better: where a path is to be followed, by pose and by where
the root goes within a second; else, from time to time and at the end of a run, one of those that are as near as poses
are that a tenth of a second lies between. Where the class changes, the cheapest way from the next frames is taken.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.matching.costs import RowCosts
from motionlake.matching.course import Course, Part, Start
from motionlake.matching.database import MotionDatabase
from motionlake.matching.features import AHEAD, HEADINGS, PLACES, POSE
from motionlake.matching.played import BESIDE, REST, SHORT, Ending
from motionlake.matching.recordings import FPS
from motionlake.matching.search import SPREAD, drawn
from motionlake.matching.steering import Steering

SEARCH: Final = 6  # frames between searches along a path
BETTER: Final = 0.25  # tolerances by which another run along a path is nearer
RUN: Final = (30, 105)  # frames of a run that no path asks to end
EXITS: Final = 15  # frames in which a transition to another class may begin
WAIT: Final = 0.02  # tolerances that a frame of waiting for it costs
FREE: Final = 0.2  # weight of the trajectory where no path says what is wanted
RAMP: Final = 0.8  # seconds in which a new class gets to its speed
ARRIVED: Final = 60  # frames in which a new class gets to its speed by other runs, where it does not at once
SETTLE: Final = 0.12  # seconds: half-life of a difference in the root's speed
LOOP: Final = 24  # frames before the first that a loop ends with


class Player:
    """Plays one motion; `run` may be called once. `style` [2 N] is what rows cost beside all else (`style_costs`)."""

    def __init__(
        self,
        database: MotionDatabase,
        parts: list[Part],
        frames: int,
        rng: np.random.Generator,
        *,
        pace: float = 1.0,
        temperature: float = 1.0,
        steering: Steering | None = None,
        loop: bool = False,
        style: Float64Array | None = None,
    ) -> None:
        self._data, self._parts, self._frames, self._rng = database, parts, frames, rng
        self._pace, self._temperature, self._steering, self._loop = pace, temperature, steering, loop
        self._scales = database.scales
        self._pose = self._scales.copy()
        self._pose[POSE:] *= FREE
        self._costs = RowCosts(database, {part.target for part in parts}, style)
        self._ending = Ending.of(database, parts[-1].target, (frames - parts[-1].first) * pace)
        self._at, self._mirrored = 0.0, False
        self._drift_speed = np.zeros(3)  # by which the root goes otherwise than the run that is played
        self._end, self._until, self._part = 0, 0, 0

    def run(self, start: Start, *, drawn: bool = False) -> Course:
        """The whole course; where it is `drawn`, what it begins with is chosen by chance and not by what is given."""
        count = self._frames
        at, mirrored = np.empty(count), np.empty(count, dtype=np.bool_)
        place, heading = np.empty((count, 2)), np.empty(count)
        jumps = [0]
        here, yaw = start.place.copy(), start.heading
        if drawn:
            self._begin_anywhere()
        else:
            self._begin(start)
        first = (self._at, self._mirrored)
        closing = self._closing(first) if self._loop else None
        change: int | None = None
        for t in range(count):
            if t:
                here, yaw = self._step(here, yaw, t)
                closes = closing is not None and t == closing
                following = self._part + 1 < len(self._parts)
                if following and change is None and t >= self._parts[self._part + 1].first - EXITS // 2:
                    change = t + self._best_exit(self._parts[self._part + 1], t)
                if closes:
                    self._jump(int(first[0]) + t - count + (len(self._data) if first[1] else 0), t)
                    jumps.append(t)
                elif change is not None and t >= change:
                    self._part, change = self._part + 1, None
                    self._jump(self._choose(self._query(here, yaw, t), self._aloft(), t, self._scales, 0.3), t)
                    jumps.append(t)
                elif closing is None or t < closing:
                    found = self._next(here, yaw, t)
                    if found is not None:
                        self._jump(found, t)
                        jumps.append(t)
            at[t], mirrored[t], place[t], heading[t] = self._at, self._mirrored, here, yaw
            self._costs.mark(int(self._at), t)
        return Course(at, mirrored, place, heading, jumps)

    def _begin_anywhere(self) -> None:
        target = self._parts[0].target
        rows = self._data.rows[target]
        frames = rows % len(self._data)
        before = frames - self._data.pieces[self._data.piece_of[frames], 0]
        fits = rows[(before >= min(LOOP, int(before.max()))) & np.isfinite(self._costs.short[target])]
        self._go(int(self._rng.choice(fits if len(fits) else rows)), 0)

    def _begin(self, start: Start) -> None:
        """Play what goes on from a start: the first frame is the one after the nearest to the last that is given."""
        query, target, aimed = start.query.copy(), self._parts[0].target, self._is_aimed(0)
        if aimed:
            self._aim(query, start.place, start.heading, float(np.hypot(*start.step[:2])), 0)
        weights = self._scales if aimed else self._data.pose_scales
        costs = self._costs_of(query, start.aloft, target, 0, weights, start.before)
        if self._costs.even and not aimed:
            pieces = self._data.piece_of[self._data.rows[target] % len(self._data)]
            costs += self._temperature * self._data.tolerance * self._data.begins[pieces]
        self._go(self._drawn(costs, SPREAD, one_of_each=True) + 1, 0)
        self._drift_speed = start.step - self._rates()

    def _closing(self, first: tuple[float, bool]) -> int:
        """The frame from which on what comes before the first frame is played."""
        low = int(first[0])
        before = low - int(self._data.pieces[self._data.piece_of[low], 0])
        return max(1, self._frames - min(LOOP, before))

    def _rates(self) -> Float64Array:
        """[3] step and turn of the frame that is played, a second, as recorded."""
        low = int(self._at)
        left, ahead = self._data.steps[low]
        turn = self._data.turns[low]
        if self._mirrored:
            left, turn = -left, -turn
        return np.array([left, ahead, turn], dtype=float)

    def _rate(self, t: int) -> float:
        """How many recorded frames lie between the frame before and this one."""
        ending = self._ends_at(t - 1)
        if ending is not None:
            return self._pace * ending
        return self._pace * (self._steering.rate(t) if self._steering is not None else 1.0)

    def _ends_at(self, t: int) -> float | None:
        """How fast the action that is played goes on to end with the motion; None where it does not."""
        if self._part + 1 < len(self._parts) or self._is_aimed(t):
            return None
        left = (self._end - 1 - self._at) / self._pace
        return self._ending.pace(left, self._frames - 1 - t)

    def _step(self, here: Float64Array, yaw: float, t: int) -> tuple[Float64Array, float]:
        rate = self._rate(t)
        y = 2 * math.log(2) / SETTLE
        drift = self._drift_speed * math.exp(-y * (t - self._since) / FPS) * (1 + y * (t - self._since) / FPS)
        left, ahead, turn = (self._rates() * rate + drift) / FPS
        cos, sin = math.cos(yaw), math.sin(yaw)
        there = here + np.array([left * cos + ahead * sin, ahead * cos - left * sin])
        yaw += turn
        if self._steering is not None:
            there, yaw = self._steering.steered(there, yaw, self._course_ahead(), t)
        self._at = min(self._at + rate, self._end - 1.0)
        return there, yaw

    def _course_ahead(self) -> Float64Array:
        """[6] where the run that is played goes within a second, as the root sees it."""
        low = int(self._at)
        ahead = self._data.features[low, PLACES].astype(float)
        if self._mirrored:
            ahead = ahead * np.array([-1.0, 1.0] * len(AHEAD))
        return ahead

    def _row(self) -> int:
        return int(self._at) + (len(self._data) if self._mirrored else 0)

    def _aloft(self) -> float:
        return float(self._data.aloft[int(self._at)])

    def _query(self, here: Float64Array, yaw: float, t: int) -> Float32Array:
        query: Float32Array = self._data.compared[self._row()].copy()
        speed = float(np.hypot(*self._rates()[:2])) * self._pace
        self._aim(query, here, yaw, speed, t)
        return query

    def _aim(self, query: Float32Array, here: Float64Array, yaw: float, speed: float, t: int) -> None:
        """Put into a query where the root is wanted to go, where anything is wanted."""
        if self._steering is not None:
            places, headings = self._steering.wanted(here, yaw, t)
            query[PLACES], query[HEADINGS] = places, headings
            return
        wanted = self._parts[self._part].speed
        if wanted is None or not self._is_aimed(t):
            return
        way = 0.0
        for i, ahead in enumerate(AHEAD):
            seconds = np.arange(1, ahead + 1) / FPS
            way = float((speed + (wanted - speed) * np.minimum(1, seconds / RAMP)).sum()) / FPS
            query[PLACES.start + 2 * i : PLACES.start + 2 * i + 2] = 0.0, way

    def _is_aimed(self, t: int) -> bool:
        """Whether a way or a speed is wanted, other than to go on as recorded."""
        part = self._parts[self._part]
        new = self._part > 0 and t < part.first + ARRIVED
        return self._steering is not None or (part.speed is not None and (part.held or new))

    def _costs_of(
        self, query: Float32Array, aloft: float, target: int, t: int, weights: Float32Array,
        before: Float32Array | None = None,
    ) -> Float64Array:  # fmt: skip
        """[n] of the rows of a class, after a frame that was so long in the air."""
        aimed, left = self._is_aimed(t), (self._frames - t) * self._pace
        ending = self._ending if self._part + 1 == len(self._parts) and not aimed else None
        return self._costs.of(target, query, weights, aloft, t, left, even=not aimed, ending=ending, before=before)

    def _choose(self, query: Float32Array, aloft: float, t: int, weights: Float32Array, spread: float) -> int:
        """A row among the nearest: the nearer the likelier, within `spread` tolerances."""
        return self._drawn(self._costs_of(query, aloft, self._parts[self._part].target, t, weights), spread)

    def _drawn(self, costs: Float64Array, spread: float, *, one_of_each: bool = False) -> int:
        """A row of the class, of costs [n], or one of each recording."""
        rows = self._data.rows[self._parts[self._part].target]
        width = spread * self._temperature * self._data.tolerance
        recordings = self._data.recordings[rows] if one_of_each else None
        return int(rows[drawn(costs, width, self._rng, recordings)])

    def _next(self, here: Float64Array, yaw: float, t: int) -> int | None:
        """The row to jump to in this frame, if to any."""
        ends = self._at >= self._end - 1.5
        if self._is_aimed(t):
            if not ends and t < self._until:
                return None
            self._until = t + SEARCH
            query, weights = self._query(here, yaw, t), self._scales
            if ends:
                return self._choose(query, self._aloft(), t, weights, 0.3)
            found = self._choose(query, self._aloft(), t, weights, 0.15)
            return found if self._nearer(found, query, weights, t) else None
        if (not ends and (t < self._until or self._temperature == 0)) or self._ends_at(t) is not None:
            return None
        query = self._query(here, yaw, t)
        if ends:
            return self._choose(query, self._aloft(), t, self._pose, SPREAD)
        self._until = t + SEARCH
        found = self._choose(query, self._aloft(), t, self._pose, SPREAD)
        apart = np.linalg.norm((self._data.compared[found] - query) * self._pose)
        return found if apart <= self._data.tolerance else None

    def _nearer(self, row: int, query: Float32Array, weights: Float32Array, t: int) -> bool:
        """Whether a run from a row on is better than to go on."""
        own = self._row()
        if row // len(self._data) == own // len(self._data) and abs(row - own) <= BESIDE:
            return False
        left = self._data.left[int(self._at)]
        on = float(np.linalg.norm((self._data.compared[own] - query) * weights))
        on += SHORT * self._data.tolerance * max(0.0, 1 - left / REST) ** 2 * 0.5
        there = float(np.linalg.norm((self._data.compared[row] - query) * weights))
        return bool(there + BETTER * self._data.tolerance < on)

    def _best_exit(self, part: Part, t: int) -> int:
        """In how many frames the way to a class is cheapest."""
        low, best = int(self._at), (math.inf, 0)
        before, self._part = self._part, self._part + 1
        for wait in range(min(EXITS, self._end - low)):
            query = self._data.compared[self._row() + wait].copy()
            if self._steering is None:
                speed = float(np.hypot(*self._data.steps[low + wait]))
                self._aim(query, np.zeros(2), 0.0, speed, part.first)
            costs = self._costs_of(query, float(self._data.aloft[low + wait]), part.target, t, self._scales)
            best = min(best, (float(costs.min()) + WAIT * self._data.tolerance * wait, wait))
        self._part = before
        return best[1]

    def _jump(self, row: int, t: int) -> None:
        """Play on from a row; the root's speed goes over to the new run's."""
        y = 2 * math.log(2) / SETTLE
        ago = (t - self._since) / FPS
        drift = self._drift_speed * math.exp(-y * ago) * (1 + y * ago)
        before = self._rates() + drift
        self._go(row, t)
        self._drift_speed = before - self._rates()
        self._until = t + self._length(t)

    def _go(self, row: int, t: int) -> None:
        size = len(self._data)
        self._at, self._mirrored, self._since = float(row % size), row >= size, t
        self._end = int(self._data.pieces[self._data.piece_of[row % size], 1])
        self._until = t + self._length(t)

    def _length(self, t: int) -> int:
        """Frames that a run is played at least."""
        if self._is_aimed(t):
            return SEARCH if self._steering is not None else 2 * SEARCH
        return int(self._rng.integers(*RUN))
