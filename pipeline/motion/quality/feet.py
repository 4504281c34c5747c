"""Feet that slide while they bear the body, bodies that sink into the ground, and bodies that hang above it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array
from motionlake.motion.quality.faults import UPRIGHT, Fault, Recording, runs, velocity
from motionlake.motion.quality_config import QualityConfig
from motionlake.motion.skeleton import INDEX

POINTS: Final = ("left_ankle", "right_ankle", "left_toe", "right_toe")
OTHERS: Final = ("hips", "head", "left_wrist", "right_wrist", "left_knee", "right_knee", "left_elbow", "right_elbow")
GRAVITY: Final = 9.81
SPAN: Final = 0.06  # seconds over which speeds are taken
STILL: Final = 0.2  # metres a second; a slower point of a foot rests on something
RESTING: Final = 0.4  # quantile of the heights of points that rest
NEAR: Final = 0.04  # metres above its level at which a point of a foot may stand
RISING: Final = 0.25  # metres a second, upwards or downwards, of a foot that does not stand
FLESH: Final = 0.12  # metres that other joints may be from what they lie on
BRIEF: Final = 0.1  # seconds


@dataclass(frozen=True)
class Ground:
    """Where feet stand.

    Attributes:
        levels: [4] heights of `POINTS` while they stand, metres; those of a pair are one.
        points: [F, 4, 3] places of them.
        speeds: [F, 4] metres a second over the ground; `rising`: [F, 4] upwards.
    """

    levels: Float64Array
    points: Float64Array
    speeds: Float64Array
    rising: Float64Array

    @classmethod
    def of(cls, recording: Recording) -> Ground:
        points = recording.positions[:, [INDEX[name] for name in POINTS]]
        moved = velocity(points, recording.fps, SPAN)
        speeds, rising = np.hypot(moved[..., 0], moved[..., 2]), moved[..., 1]
        still = (np.hypot(speeds, rising) < STILL) & (recording.lifted > UPRIGHT)[:, None]
        levels = np.array([_level(points[:, pair, 1], still[:, pair]) for pair in ((0, 1), (2, 3))])
        return cls(levels.repeat(2), points, speeds, rising)

    @property
    def above(self) -> Float64Array:
        """[F, 4] metres above the level."""
        return self.points[..., 1] - self.levels


def _level(heights: Float64Array, still: BoolArray) -> float:
    """The height at which a pair of points [F, 2] rests most of the time."""
    resting = heights[still]
    if len(resting) < 0.05 * heights.size:
        return float(np.quantile(heights.min(axis=1), 0.05))
    return float(np.quantile(resting, RESTING))


def check_feet(recording: Recording, config: QualityConfig) -> tuple[dict[str, float], list[Fault]]:
    """Measures `slide` (metres a second, the 95 % quantile where the body stands), `penetration` and `floating`
    (metres, the most), with the faults."""
    ground = Ground.of(recording)
    slides, slide = _slides(recording, ground, config)
    sunk, depth = _sunk(recording, ground, config)
    hung, height = _hung(recording, ground, config)
    return {"slide": slide, "penetration": depth, "floating": height}, [*slides, *sunk, *hung]


def _slides(recording: Recording, ground: Ground, config: QualityConfig) -> tuple[list[Fault], float]:
    low = (np.abs(ground.above) < NEAR) & (np.abs(ground.rising) < RISING)
    down = (low[:, :2] & low[:, 2:]).any(axis=1)
    # A foot in the air bears nothing, still as it may be.
    slowest = np.where(low, np.hypot(ground.speeds, ground.rising), np.inf).min(axis=1)
    bears = down & (recording.lifted > UPRIGHT)
    found = []
    for start, stop in runs(
        bears & (slowest > config.slide), recording.frames(0.05), recording.frames(config.slide_seconds, 3)
    ):
        speed = float(np.median(slowest[start:stop]))
        foot = int(low[start:stop, :2].sum(axis=0).argmax())
        found.append(Fault(kind="slide", joint=POINTS[foot], start=start, stop=stop, severity=speed))
    return found, float(np.quantile(slowest[bears], 0.95)) if bears.any() else 0.0


def _sunk(recording: Recording, ground: Ground, config: QualityConfig) -> tuple[list[Fault], float]:
    floor = ground.levels[2:].min()
    others = recording.positions[:, [INDEX[name] for name in OTHERS], 1] - floor
    depths = np.concatenate([-ground.above, -others], axis=1)
    names = (*POINTS, *OTHERS)
    deepest = depths.max(axis=1)
    found = []
    for start, stop in runs(deepest > config.penetration, recording.frames(BRIEF), recording.frames(BRIEF, 2)):
        joint = int(depths[start:stop].max(axis=0).argmax())
        depth = float(deepest[start:stop].max())
        found.append(Fault(kind="penetration", joint=names[joint], start=start, stop=stop, severity=depth))
    return found, max(0.0, float(deepest.max()))


def _hung(recording: Recording, ground: Ground, config: QualityConfig) -> tuple[list[Fault], float]:
    floor = ground.levels[2:].min()
    others = recording.positions[:, [INDEX[name] for name in OTHERS], 1] - floor - FLESH
    clear = np.minimum(ground.above.min(axis=1), others.min(axis=1))
    found, most = [], 0.0
    for start, stop in runs(clear > config.floating, 0, 2):
        height = float(clear[start:stop].max())
        flight = np.sqrt(8 * height / GRAVITY)
        if (stop - start) / recording.fps > 1.3 * flight + 0.15:
            middle = float(np.median(clear[start:stop]))
            most = max(most, middle)
            found.append(Fault(kind="floating", start=start, stop=stop, severity=middle))
    return found, most
