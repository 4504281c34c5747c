"""Feet that slide while they bear the body, bodies that sink into the ground, and bodies that hang above it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array
from motionlake.motion.quality.faults import UPRIGHT, Fault, Found, Level, Recording, velocity
from motionlake.motion.quality.levels import levels
from motionlake.motion.quality_config import QualityConfig
from motionlake.motion.runs import runs
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
SOLE: Final = (-0.3, 1.4)  # from heel to tip, where 0 is the ankle and 1 the joint of the toes


@dataclass(frozen=True)
class Ground:
    """Where feet stand.

    Attributes:
        levels: [4] heights of `POINTS` while they stand, metres; those of a pair are one.
        points: [F, 4, 3] places of them.
        moved: [F, 4, 3] metres a second of them; `speeds`: [F, 4] over the ground; `rising`: [F, 4] upwards.
    """

    levels: Float64Array
    points: Float64Array
    moved: Float64Array
    speeds: Float64Array
    rising: Float64Array

    @classmethod
    def of(cls, recording: Recording) -> Ground:
        points = recording.positions[:, [INDEX[name] for name in POINTS]]
        moved = velocity(points, recording.fps, SPAN)
        speeds, rising = np.hypot(moved[..., 0], moved[..., 2]), moved[..., 1]
        still = (np.hypot(speeds, rising) < STILL) & (recording.lifted > UPRIGHT)[:, None]
        levels = np.array([_level(points[:, pair, 1], still[:, pair]) for pair in ((0, 1), (2, 3))])
        return cls(levels.repeat(2), points, moved, speeds, rising)

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


def check_feet(recording: Recording, config: QualityConfig) -> Found:
    """Measures `slide` (metres a second, the 95 % quantile where the body stands), `penetration` and `floating`
    (metres, the most), with the faults."""
    ground = Ground.of(recording)
    slides, slid, slide = _slides(recording, ground, config)
    sunk, sank, depth = _sunk(recording, ground, config)
    hung, height = _hung(recording, ground, config)
    measures = {"slide": slide, "penetration": depth, "floating": height}
    return Found(measures, [*slides, *sunk, *hung], [*slid, *sank])


def _slides(recording: Recording, ground: Ground, config: QualityConfig) -> tuple[list[Fault], list[Level], float]:
    low = (np.abs(ground.above) < NEAR) & (np.abs(ground.rising) < RISING)
    down = (low[:, :2] & low[:, 2:]).any(axis=1)
    # A foot in the air bears nothing, still as it may be.
    slowest = np.where(low, np.hypot(ground.speeds, ground.rising), np.inf).min(axis=1)
    slowest = np.minimum(slowest, _turning(ground, low))
    bears = down & (recording.lifted > UPRIGHT)
    gap, least = recording.frames(0.05), recording.frames(config.slide_seconds, 3)
    found = []
    for start, stop in runs(bears & (slowest > config.slide), gap, least):
        speed = float(np.median(slowest[start:stop]))
        foot = int(low[start:stop, :2].sum(axis=0).argmax())
        found.append(Fault(kind="slide", joint=POINTS[foot], start=start, stop=stop, severity=speed))
    borne = np.where(bears, slowest, 0.0)[:, None]
    slide = float(np.quantile(slowest[bears], 0.95)) if bears.any() else 0.0
    return found, levels("slide", borne, [config.slide], [""], gap, least), slide


def _turning(ground: Ground, low: BoolArray) -> Float64Array:
    """[F] metres a second of the slowest point along the soles that are down: feet that turn on the spot rest there."""
    slowest = np.full(len(low), np.inf)
    for ankle, toe in ((0, 2), (1, 3)):
        speed = ground.moved[:, ankle]
        along = ground.moved[:, toe] - speed
        place = -(speed * along).sum(axis=1) / np.maximum((along * along).sum(axis=1), 1e-9)
        point = np.linalg.norm(speed + np.clip(place, *SOLE)[:, None] * along, axis=1)
        slowest = np.where(low[:, ankle] & low[:, toe], np.minimum(slowest, point), slowest)
    return slowest


def _sunk(recording: Recording, ground: Ground, config: QualityConfig) -> tuple[list[Fault], list[Level], float]:
    floor = ground.levels[2:].min()
    others = recording.positions[:, [INDEX[name] for name in OTHERS], 1] - floor
    depths = np.concatenate([-ground.above, -others], axis=1)
    names = (*POINTS, *OTHERS)
    deepest = depths.max(axis=1)
    gap, least = recording.frames(BRIEF), recording.frames(BRIEF, 2)
    found = []
    for start, stop in runs(deepest > config.penetration, gap, least):
        joint = int(depths[start:stop].max(axis=0).argmax())
        depth = float(deepest[start:stop].max())
        found.append(Fault(kind="penetration", joint=names[joint], start=start, stop=stop, severity=depth))
    sank = levels("penetration", deepest[:, None], [config.penetration], [""], gap, least)
    return found, sank, max(0.0, float(deepest.max()))


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
