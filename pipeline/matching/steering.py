"""Leading a motion along a path: where it is wanted to go, how it is turned towards that, and how fast it is played."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.matching.features import AHEAD
from motionlake.matching.recordings import FPS
from motionlake.motion.paths import GroundPath
from motionlake.motion.rotations import turn_on_ground

GAIN: Final = 3.0  # by which a wrong direction is turned away, a second
MOST_TURN: Final = math.radians(75)  # a second, at a body length a second and faster
SLIDE: Final = 0.08  # of the speed, that the root is moved to the side towards the path
RATES: Final = (0.85, 1.18)  # how slow and fast recordings are played to keep time
SEEN: Final = 1.0  # seconds: what is late is caught up in about that
CAUGHT: Final = 0.3  # of the speed, by which a motion that is late or early is wanted faster or slower
LEAST: Final = 0.1  # body lengths: a run that goes less far is not turned
LOOKED: Final = 0.6  # body lengths ahead in which the nearest point of the path is looked for


class Steering:
    """Where along a path a motion is.

    Args:
        path: metres.
        size: metres of a body length.
        place: [2] body lengths, where the path begins.
        heading: radians, in which it goes on there.
        speeds: [T] wanted, body lengths a second.
        facing: radians in the world that the body keeps facing; None: along the path.
    """

    def __init__(
        self,
        path: GroundPath,
        size: float,
        place: Float64Array,
        heading: float,
        speeds: Float64Array,
        facing: float | None = None,
    ) -> None:
        self._path = path.placed(place, heading, size)
        self._speeds, self._facing = speeds, facing
        self._due = np.concatenate([[0.0], np.cumsum(speeds)]) / FPS  # body lengths gone before each frame
        self._way = 0.0  # body lengths along the path

    def rate(self, t: int) -> float:
        """How fast recordings are played, so that the motion is where it should be by then."""
        late, speed = self._late(t)
        return min(max(1 + late / (SEEN * max(speed, 1e-6)), RATES[0]), RATES[1])

    def wanted(self, here: Float64Array, yaw: float, t: int) -> tuple[Float64Array, Float64Array]:
        """[6] places and [6] headings after 1/3, 2/3 and 1 s, as the root sees them."""
        late, speed = self._late(t)
        speed += min(max(late, -CAUGHT * speed), CAUGHT * speed)
        ways = [self._way + speed * ahead / FPS for ahead in AHEAD]
        apart = np.array([self._path.at(way) for way in ways]) - here
        places = np.stack(turn_on_ground(apart[:, 0], apart[:, 1], -yaw), axis=1).ravel()
        along = [self._path.heading(way) if self._facing is None else self._facing for way in ways]
        turned = np.array(along) - yaw
        return places, np.stack([np.sin(turned), np.cos(turned)], axis=1).ravel()

    def steered(self, here: Float64Array, yaw: float, ahead: Float64Array, t: int) -> tuple[Float64Array, float]:
        """Place [2] and heading of the root, turned and moved a little towards the path; `ahead` [6] as recorded."""
        self._way = self._path.nearest(here, self._way, LOOKED)
        speed = self._late(t)[1]
        left, forth = float(ahead[2]), float(ahead[3])  # after 2/3 s
        far = math.hypot(left, forth)
        if far > LEAST:
            x, z = self._path.at(self._way + far)
            wanted = math.atan2(x - here[0], z - here[1]) - (yaw + math.atan2(left, forth))
            wanted = (wanted + math.pi) % (2 * math.pi) - math.pi
            most = MOST_TURN * min(1.0, speed)
            yaw += min(max(GAIN * wanted, -most), most) / FPS
        x, z = self._path.at(self._way)
        off = np.array([x - here[0], z - here[1]])
        distance = math.hypot(*off)
        if distance > 0:
            here = here + off / distance * min(distance / FPS, SLIDE * speed / FPS)
        return here, yaw

    def _late(self, t: int) -> tuple[float, float]:
        """Body lengths by which the motion is behind where it should be, and the speed that is wanted."""
        return float(self._due[min(t, len(self._due) - 1)]) - self._way, float(
            self._speeds[min(t, len(self._speeds) - 1)]
        )
