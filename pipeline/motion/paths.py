"""Ways on the ground that a motion is to follow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.rotations import turn_on_ground
from scipy.ndimage import gaussian_filter1d

RADIUS: Final = 3.0  # metres, of circles where none is said
STEP: Final = 0.02  # metres from point to point
ROUND: Final = 0.25  # metres: corners are rounded over about that
SHAPES: Final = ("circle", "eight")
_CLOSE: Final = 1e-6  # metres: the last point is the first


@dataclass(frozen=True)
class GroundPath:
    """A way on the ground.

    Attributes:
        points: [n, 2] (x, z), `step` apart; as it is made it begins at the origin and goes ahead (+z), in metres.
        closed: its end is its beginning; it goes round again then.
        step: from point to point.
    """

    points: Float64Array
    closed: bool
    step: float = STEP

    @cached_property
    def length(self) -> float:
        """Of one round."""
        return self.step * (len(self.points) - (0 if self.closed else 1))

    def placed(self, place: Float64Array, heading: float, metres: float) -> GroundPath:
        """The path from a place [2] on, in a heading (radians), in units of so many metres."""
        points = self.points / metres
        turned = np.stack(turn_on_ground(points[:, 0], points[:, 1], heading), axis=1)
        return GroundPath(place + turned, self.closed, self.step / metres)

    def at(self, way: float) -> tuple[float, float]:
        """Where one is after such a way; behind the end of an open path, straight on."""
        low, share = self._below(way)
        (x, z), (there_x, there_z) = self.points[low], self.points[(low + 1) % len(self.points)]
        return float(x + share * (there_x - x)), float(z + share * (there_z - z))

    def heading(self, way: float) -> float:
        """Radians to the left of +z in which it goes on there."""
        low, _ = self._below(way)
        x, z = self.points[(low + 1) % len(self.points)] - self.points[low]
        return math.atan2(x, z)

    def _below(self, way: float) -> tuple[int, float]:
        """The point before a way, and by how many steps it is behind that."""
        at = way / self.step
        low = math.floor(at)
        if self.closed:
            return low % len(self.points), at - low
        low = min(max(low, 0), len(self.points) - 2)
        return low, at - low

    def nearest(self, place: Float64Array, start: float, far: float) -> float:
        """The way, from `start` to so far behind it, after which the path is nearest to a place [2]."""
        low, count = math.floor(start / self.step), max(2, round(far / self.step))
        at = np.arange(low, low + count)
        at = at % len(self.points) if self.closed else at[at < len(self.points)]
        if not len(at):
            return start
        apart = self.points[at] - place
        return max(start, self.step * (low + int((apart * apart).sum(axis=1).argmin())))


def ground_path(points: Sequence[tuple[float, float]] | Float64Array) -> GroundPath:
    """The path through points [n, 2], metres (x, z): moved to begin at the origin, turned to go ahead, corners rounded.

    Raises:
        ValueError: fewer than two points that lie apart, or points that are not finite.
    """
    given = np.asarray(points, dtype=float).reshape(-1, 2)
    if not np.isfinite(given).all():
        raise ValueError("a point is not finite")
    if len(given):
        given = given[np.concatenate([[True], np.linalg.norm(np.diff(given, axis=0), axis=1) > _CLOSE])]
    if len(given) < 2:
        raise ValueError("it has one point; a path has two at least, that lie apart")
    closed = len(given) > 3 and float(np.linalg.norm(given[0] - given[-1])) <= ROUND
    if closed:
        given = np.concatenate([given[:-1], given[:1]])
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(given, axis=0), axis=1))])
    steps = max(2, round(way[-1] / STEP))
    even = np.linspace(0, way[-1], steps + 1)
    rows = np.stack([np.interp(even, way, given[:, axis]) for axis in range(2)], axis=1)
    rows = _rounded(rows[:-1] if closed else rows, closed)
    return GroundPath(_from_origin(_even(rows, closed)), closed)


def shape_path(name: str, radius: float = RADIUS) -> GroundPath:
    """ "circle" to the left, or "eight", a circle to the left and one to the right, of a radius in metres."""
    count = max(64, round(2 * math.pi * radius / STEP))
    angle = np.arange(count) * (2 * math.pi / count)
    left = np.stack([radius * (1 - np.cos(angle)), radius * np.sin(angle)], axis=1)
    rows = left if name == "circle" else np.concatenate([left, left * np.array([-1.0, 1.0])])
    return GroundPath(_even(rows, True), True)


def _rounded(rows: Float64Array, closed: bool) -> Float64Array:
    """Rows with corners rounded; the ends of an open path stay where they are."""
    width = ROUND / STEP
    if closed:
        return np.asarray(gaussian_filter1d(rows, width, axis=0, mode="wrap"))
    reach = min(len(rows) - 1, round(4 * width))
    padded = np.pad(rows, ((reach, reach), (0, 0)), mode="reflect", reflect_type="odd")
    return np.asarray(gaussian_filter1d(padded, width, axis=0)[reach : reach + len(rows)])


def _even(rows: Float64Array, closed: bool) -> Float64Array:
    """Points `STEP` apart along rows; of a closed path the last is a step before the first."""
    whole = np.concatenate([rows, rows[:1]]) if closed else rows
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(whole, axis=0), axis=1))])
    count = max(3, round(way[-1] / STEP))
    even = np.linspace(0, way[-1], count + 1)
    found = np.stack([np.interp(even, way, whole[:, axis]) for axis in range(2)], axis=1)
    return found[:-1] if closed else found


def _from_origin(rows: Float64Array) -> Float64Array:
    """Rows moved and turned so that they begin at the origin and go ahead."""
    moved = rows - rows[0]
    ahead = moved[min(len(moved) - 1, round(ROUND / STEP))]
    return np.stack(turn_on_ground(moved[:, 0], moved[:, 1], -math.atan2(ahead[0], ahead[1])), axis=1)
