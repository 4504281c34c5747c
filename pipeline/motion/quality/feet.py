"""Feet that slide while they bear the body, bodies that sink into the ground, and bodies that hang above it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array
from motionlake.motion.quality.faults import UPRIGHT, Fault, Found, Level, Recording, velocity
from motionlake.motion.quality.levels import levels
from motionlake.motion.quality_config import QualityConfig
from motionlake.motion.runs import runs
from motionlake.motion.skeleton import INDEX

Measures = dict[str, float]
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
SHAKE: Final = 0.12  # seconds; of shorter moments of a velocity nothing is counted in a way
STANDS: Final = 0.5  # seconds of feet that stand, which tell whether the ground moves
ALIKE: Final = 0.35  # of the speed of the ground, by which feet that stand on it and a body that stays may differ
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
    """Measures `slide` (metres a second, the 95 % quantile where the body stands), `in_place` (metres a second of the
    ground under a body that walks in its place), `penetration` and `floating` (metres, the most), with the faults."""
    ground = Ground.of(recording)
    slides, slid, measures = _slides(recording, ground, config)
    sunk, sank, depth = _sunk(recording, ground, config)
    hung, height = _hung(recording, ground, config)
    return Found({**measures, "penetration": depth, "floating": height}, [*slides, *sunk, *hung], [*slid, *sank])


def _slides(recording: Recording, ground: Ground, config: QualityConfig) -> tuple[list[Fault], list[Level], Measures]:
    low = (np.abs(ground.above) < NEAR) & (np.abs(ground.rising) < RISING)
    down = (low[:, :2] & low[:, 2:]).any(axis=1)
    bears = down & (recording.lifted > UPRIGHT)
    belt = _belt(recording, _slowest(ground, low)[bears], config.slide)
    if belt.any():
        ground = replace(ground, moved=ground.moved - belt)
    moved = _slowest(ground, low)
    slowest = np.linalg.norm(moved, axis=1)
    gap, least = recording.frames(0.05), recording.frames(config.slide_seconds, 3)
    found = []
    slides = np.zeros(len(low), dtype=np.bool_)
    way = _way(moved, recording)
    for start, stop in runs(bears & (slowest > config.slide), gap, least):
        if np.hypot(*np.ptp(way[start:stop], axis=0)) < config.slide_way:
            continue  # it trembles in its place
        slides[start:stop] = True
        speed = float(np.median(slowest[start:stop]))
        foot = int(low[start:stop, :2].sum(axis=0).argmax())
        found.append(Fault(kind="slide", joint=POINTS[foot], start=start, stop=stop, severity=speed))
    borne = np.where(bears & slides, slowest, 0.0)[:, None]
    slide = float(np.quantile(slowest[bears], 0.95)) if bears.any() else 0.0
    measures = {"slide": slide, "in_place": float(np.linalg.norm(belt))}
    return found, levels("slide", borne, [config.slide], [""], gap, least), measures


def _belt(recording: Recording, borne: Float64Array, least: float) -> Float64Array:
    """[3] metres a second at which the ground moves under a body that walks in its place; 0 where it does not.

    On a treadmill, and where the way was taken out of a motion, all feet that stand move alike, and the body stays.

    Args:
        borne: [N, 3] velocities of what moves least of the feet that stand.
        least: metres a second; a slower belt is none.
    """
    still = np.zeros(3)
    if len(borne) < recording.frames(STANDS):
        return still
    belt = np.median(borne, axis=0) * np.array([1.0, 0.0, 1.0])
    speed = float(np.linalg.norm(belt))
    apart = float(np.median(np.linalg.norm(borne - belt, axis=1)))
    hips = recording.joint("hips")[[0, -1]]
    stays = np.hypot(*(hips[1] - hips[0])[[0, 2]]) * recording.fps / max(1, len(recording) - 1)
    return belt if speed > least and apart < ALIKE * speed and stays < ALIKE * speed else still


def _slowest(ground: Ground, low: BoolArray) -> Float64Array:
    """[F, 3] metres a second of what moves least of the feet that are down; infinite where none is.

    That is an ankle, a toe joint, or a point along the sole: feet that turn on the spot rest there. A foot in the air
    bears nothing, still as it may be.
    """
    each = np.where(low, np.linalg.norm(ground.moved, axis=2), np.inf)
    slowest, speed = ground.moved[np.arange(len(low)), each.argmin(axis=1)], each.min(axis=1)
    slowest = np.where(np.isfinite(speed)[:, None], slowest, np.inf)
    for ankle, toe in ((0, 2), (1, 3)):
        start = ground.moved[:, ankle]
        along = ground.moved[:, toe] - start
        place = -(start * along).sum(axis=1) / np.maximum((along * along).sum(axis=1), 1e-9)
        point = start + np.clip(place, *SOLE)[:, None] * along
        slower = low[:, ankle] & low[:, toe] & (np.linalg.norm(point, axis=1) < speed)
        slowest = np.where(slower[:, None], point, slowest)
        speed = np.where(slower, np.linalg.norm(point, axis=1), speed)
    return slowest


def _way(moved: Float64Array, recording: Recording) -> Float64Array:
    """[F, 2] the way over the ground, metres, of something with velocities [F, 3], without moments of noise."""
    from scipy.ndimage import median_filter

    over = np.where(np.isfinite(moved[:, [0, 2]]), moved[:, [0, 2]], 0.0)
    way: Float64Array = np.cumsum(median_filter(over, (recording.frames(SHAKE), 1)), axis=0) / recording.fps
    return way


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
