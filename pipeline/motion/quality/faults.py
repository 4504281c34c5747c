"""What a check is given, what it finds, and ranges of frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np
from motionlake.arrays import BoolArray, Float64Array, FloatArray
from motionlake.motion.skeleton import INDEX, JOINTS

# Kinds of faults in the order in which they are told.
KINDS: Final = (
    "slide", "penetration", "floating", "jitter", "spike", "flip", "frozen", "missing", "limb_drift", "tpose_start",
    "tpose_end", "fps", "unit", "up", "swapped_sides", "seam",
)  # fmt: skip
RUNGS: Final = 2  # of each doubling of a threshold; the SQL macro `fault_rung` has the same
UPRIGHT: Final = 0.6  # of the body's height that its head is above its ankles


@dataclass(frozen=True, kw_only=True)
class Fault:
    """Something wrong in frames [start, stop) of a clip.

    Attributes:
        kind: of `KINDS`.
        joint: canonical joint; "" where it is the whole body.
        severity: slide: metres a second; penetration, floating, jitter, spike, seam: metres; flip: degrees; frozen,
            tpose_start, tpose_end, swapped_sides: seconds; missing: share of the frames; limb_drift: share of the
            length; fps: how many times too fast the clip plays; unit: metres of body height; up: degrees from upright.
    """

    kind: str
    joint: str = ""
    start: int
    stop: int
    severity: float

    def as_row(self) -> dict[str, Any]:
        return asdict(self)


@dataclass(frozen=True, kw_only=True)
class Level:
    """Frames [start, stop) of a joint in which a fault would be told at a multiple of its threshold.

    Attributes:
        kind, joint: as of a `Fault`.
        rung: the multiple is 2 to the power of rung / `RUNGS`; ranges of a higher rung lie within those of a lower.
        level: the highest multiple at which one would be told in there.
        severity: the same in the unit of the fault.
    """

    kind: str
    joint: str
    start: int
    stop: int
    rung: int
    level: float
    severity: float


class Found(NamedTuple):
    """What a check gives: measures by name, the faults above their thresholds, and how far above."""

    measures: dict[str, float]
    faults: list[Fault]
    levels: Sequence[Level] = ()


@dataclass(frozen=True)
class Recording:
    """A canonical motion as checks see it.

    Attributes:
        positions: [F, 21, 3] joints in the world, metres, y up.
        rotations: [F, 21, 4] local rotations (w, x, y, z), continuous in sign.
        fps: frames a second.
        twist: whether rotations were measured; False: they follow from positions.
        filled: joints that the file does not hold; what is wrong with them is not the recording's fault.
        repaired: frames whose gaps were filled when the file was read.
    """

    positions: Float64Array
    rotations: Float64Array
    fps: float
    twist: bool = True
    filled: tuple[str, ...] = ()
    repaired: int = 0

    @classmethod
    def of(
        cls,
        positions: FloatArray,
        rotations: FloatArray,
        fps: float,
        *,
        twist: bool,
        filled: tuple[str, ...],
        repaired: int = 0,
    ) -> Recording:
        return cls(positions.astype(np.float64), rotations.astype(np.float64), fps, twist, filled, repaired)

    def part(self, start: int, stop: int) -> Recording:
        """Frames [start, stop) of it."""
        return Recording(self.positions[start:stop], self.rotations[start:stop], self.fps, self.twist, self.filled)

    def __len__(self) -> int:
        return len(self.positions)

    def joint(self, name: str) -> Float64Array:
        """[F, 3] of a joint."""
        return self.positions[:, INDEX[name]]

    def frames(self, seconds: float, least: int = 1) -> int:
        """How many frames last so long."""
        return max(least, round(seconds * self.fps))

    @cached_property
    def measured(self) -> BoolArray:
        """[21] whether a joint is the recording's own."""
        return np.array([name not in self.filled for name in JOINTS])

    @cached_property
    def leg(self) -> float:
        """Metres from hip to ankle of a stretched leg, the mean of both."""
        bones = [("left_hip", "left_knee", "left_ankle"), ("right_hip", "right_knee", "right_ankle")]
        lengths = [
            np.median(np.linalg.norm(self.joint(a) - self.joint(b), axis=1))
            for hip, knee, ankle in bones
            for a, b in ((hip, knee), (knee, ankle))
        ]
        return float(sum(lengths)) / 2

    @cached_property
    def height(self) -> float:
        """Metres from the ankles to the head joint of a body that stands straight."""
        trunk = ("hips", "spine", "chest", "neck", "head")
        lengths = [np.median(np.linalg.norm(self.joint(a) - self.joint(b), axis=1)) for a, b in pairwise(trunk)]
        return self.leg + float(sum(lengths))

    @cached_property
    def lifted(self) -> Float64Array:
        """[F] how far the head is above the ankles, of the body's height: about 1 of a body that stands."""
        ankles = (self.joint("left_ankle")[:, 1] + self.joint("right_ankle")[:, 1]) / 2
        lifted: Float64Array = (self.joint("head")[:, 1] - ankles) / max(self.height, 1e-6)
        return lifted


def velocity(places: Float64Array, fps: float, seconds: float) -> Float64Array:
    """[F, ...] metres a second over about `seconds` around each frame; places [F, ...] of two frames at least."""
    reach = min(max(1, round(seconds * fps / 2)), len(places) - 1)
    frames = np.arange(len(places))
    before, after = np.maximum(frames - reach, 0), np.minimum(frames + reach, len(places) - 1)
    apart = (after - before).reshape(-1, *(1,) * (places.ndim - 1))
    moved: Float64Array = (places[after] - places[before]) * fps / apart
    return moved


def joint_name(joint: int) -> str:
    return JOINTS[joint]
