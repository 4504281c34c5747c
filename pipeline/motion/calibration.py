"""Calibration poses at the ends of recordings: T-poses, and frames from which the joints jump."""

from __future__ import annotations

from typing import Final, NamedTuple, TypeVar

import numpy as np
from motionlake.arrays import BoolArray, Float64Array, FloatArray
from motionlake.motion.quality_config import QualityConfig
from motionlake.motion.runs import runs
from motionlake.motion.skeleton import INDEX
from numpy.typing import NDArray

Value = TypeVar("Value", bound=np.generic)
DEGREES: Final = QualityConfig.tpose_degrees
SEAM: Final = QualityConfig.seam
LONGEST: Final = 5.0  # seconds of a T-pose that belongs to an end
EDGE: Final = 0.1  # seconds at an end within which a jump parts a calibration pose from the motion
STEPS: Final = 3.0  # times the steps of the frames around, that a jump is
AROUND: Final = 3  # frames
SETTLED: Final = 1.5  # times the greatest of the steps that follow, within which the joints have settled
SLOW: Final = 0.2  # metres a second, mean over the joints, of a pose that is held
HELD: Final = 0.25  # seconds, at least, of a pose that is held: slow arms pass through one
STILL: Final = 0.002  # metres: steps that are no motion


class Jump(NamedTuple):
    """Steps [start, stop) that are jumps, step i from frame i to frame i + 1, and the largest in metres."""

    start: int
    stop: int
    metres: float


def tposes(positions: FloatArray, degrees: float = DEGREES) -> BoolArray:
    """[F] whether arms are stretched sideways and legs downwards, of joints [F, 21, 3]."""
    bones = positions[:, _ENDS].astype(np.float64) - positions[:, _STARTS]
    bones /= np.maximum(np.linalg.norm(bones, axis=2, keepdims=True), 1e-9)
    left, down, limbs = bones[:, :1], bones[:, 1:2], bones[:, 2:]
    wanted = np.concatenate([left, left, -left, -left, down, down], axis=1)
    return np.asarray(((limbs * wanted).sum(axis=2) > np.cos(np.radians(degrees))).all(axis=1))


# To the left, downwards, the two bones of the left arm and of the right one, the left leg and the right one.
_BONES: Final = (
    ("right_shoulder", "left_shoulder"), ("neck", "hips"),
    ("left_shoulder", "left_elbow"), ("left_elbow", "left_wrist"),
    ("right_shoulder", "right_elbow"), ("right_elbow", "right_wrist"),
    ("left_hip", "left_ankle"), ("right_hip", "right_ankle"),
)  # fmt: skip
_STARTS, _ENDS = ([INDEX[bone[end]] for bone in _BONES] for end in (0, 1))


def jumps(positions: FloatArray, seam: float = SEAM) -> list[Jump]:
    """Where the whole body moves, in one step, by far more than in the steps around it.

    Args:
        positions: [F, 21, 3] joints, metres.
        seam: metres, mean over the joints, by which such a step is longer than those around it.
    """
    if len(positions) < 2 * AROUND + 2:
        return []
    steps = np.linalg.norm(np.diff(positions.astype(np.float64), axis=0), axis=2)
    mean = steps.mean(axis=1)
    if not (mean > seam).any():
        return []
    around = _greatest_beside(mean[:, None])[:, 0]
    jumped = (mean > STEPS * around) & (mean - around > seam)
    if not jumped.any():
        return []
    jumped &= (steps > 2 * _greatest_beside(steps)).mean(axis=1) > 0.5
    return [Jump(start, stop, float(mean[start:stop].max())) for start, stop in runs(jumped, 1)]


def _greatest_beside(steps: Float64Array) -> Float64Array:
    """[S, n] the greatest of the `AROUND` rows before and after each of [S, n]; at the ends the rows are mirrored."""
    padded = np.concatenate([steps[AROUND:0:-1], steps, steps[-2 : -AROUND - 2 : -1]])
    beside = [padded[AROUND + by : AROUND + by + len(steps)] for by in range(-AROUND, AROUND + 1) if by]
    return np.asarray(np.maximum.reduce(beside), np.float64)


def recorded_range(positions: FloatArray, fps: float) -> tuple[int, int]:
    """The frames [start, stop) of a recording that lie between the calibration poses at its ends.

    Such a pose is a T-pose of at most `LONGEST` seconds that begins or ends the recording and is held still for `HELD`
    seconds, or from which the joints leap; or whatever lies beyond a jump of the joints within `EDGE` seconds of that.
    The frames next to it in which the joints still settle, `EDGE` seconds at most, belong to it: a filter smears a
    jump. A recording that holds nothing else is whole.

    Args:
        positions: [F, 21, 3] canonical joints, metres, y up.
        fps: frames a second.
    """
    start, stop = _beginning(positions, fps), len(positions) - _beginning(positions[::-1], fps)
    return (start, stop) if stop - start >= 2 else (0, len(positions))


def _beginning(positions: FloatArray, fps: float) -> int:
    """How many frames a calibration pose takes at the beginning."""
    edge, most = max(1, round(EDGE * fps)), round(LONGEST * fps)
    positions = positions[: most + 6 * edge + 4 * AROUND]  # no more of them are looked at
    stretched = bool(tposes(positions[:1]).any())  # most recordings begin with no T-pose, and no more is looked at
    start = run_of(tposes(positions) & _still(positions, fps), most) if stretched else 0
    start = start if start >= HELD * fps else 0
    near = jumps(positions[: start + edge + 2 * AROUND + 2])
    start = max([start, *(jump.stop for jump in near if jump.stop <= start + edge)])
    if not start and not stretched:
        return 0
    steps = np.linalg.norm(np.diff(positions[start : start + 4 * edge].astype(np.float64), axis=0), axis=2).mean(axis=1)
    if len(steps) <= edge:
        return start
    usual = max(float(steps[edge:].max()), STILL)
    if not start and not steps[0] > STEPS * usual:
        return 0
    restless = np.flatnonzero(steps[:edge] > SETTLED * usual)
    return start + (int(restless[-1]) + 1 if len(restless) else 0)


def _still(positions: FloatArray, fps: float) -> BoolArray:
    """[F] whether the joints hardly move towards a frame or from it: who dances with arms spread calibrates nothing."""
    steps = np.linalg.norm(np.diff(positions.astype(np.float64), axis=0), axis=2).mean(axis=1) * fps
    return np.asarray(np.minimum(np.r_[np.inf, steps], np.r_[steps, np.inf])[: len(positions)] < SLOW)


def run_of(mask: BoolArray, most: int) -> int:
    """How many frames a mask [F] begins with; none where these are more than `most`."""
    first = len(mask) if mask.all() else int(np.argmin(mask))
    return first if first <= most else 0


def recorded(positions: Float64Array, fps: float) -> Float64Array:
    """The frames of `recorded_range`."""
    start, stop = recorded_range(positions, fps)
    return positions[start:stop]


def held(values: NDArray[Value], kept: tuple[int, int]) -> NDArray[Value]:
    """[F, ...] values of the frames where those outside `kept` have the values of the nearest frame inside."""
    start, stop = kept
    return values[np.clip(np.arange(len(values)), start, stop - 1)]
