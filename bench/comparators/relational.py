"""Boolean relational features of Müller and Röder (2006): 39 of them, as bits of one integer a frame.

The paper tells them by joints, a kind (side of a plane, bent by an angle, moving in a direction, fast) and two
thresholds each: a feature begins above the strong one and ends below the weak one. Lengths are in humeri, shoulder
widths and hip widths. Of the 15 joints that every rig has there is no toe, no chest and no ground: the plane of the
frontal feature is level and goes through the ankles, the spine is the line from the hips to the neck, and what is
"raised" or "lowered" is measured from the lower ankle. The thresholds are to our knowledge the paper's, where its
joints are there, and unchecked.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array
from motionlake.kernels import njit
from numpy.typing import NDArray

from bench.comparators.seen import SIDES, Seen, along, angle, bend

COUNT: Final = 39
UP: Final = np.array([0.0, 1.0, 0.0])
# What is measured of each frame [T], above what the feature begins, and below what it ends.
Measured = tuple[Float64Array, float, float]


def relational(clip: Seen) -> BoolArray:
    """[T, 39] features of a clip."""
    rows = [begun(values, strong, weak) for values, strong, weak in _measured(clip)]
    return np.column_stack(rows)


def packed(features: BoolArray) -> NDArray[np.uint64]:
    """[T] features [T, n <= 64] as bits."""
    places = np.arange(features.shape[1], dtype=np.uint64)
    return np.asarray((features.astype(np.uint64) << places).sum(axis=1, dtype=np.uint64))


@njit(cache=True)
def begun(values: Float64Array, strong: float, weak: float) -> BoolArray:
    """[T] whether `values` [T] have been above `strong` since they were last below `weak`."""
    found = np.empty(len(values), dtype=np.bool_)
    on = False
    for i in range(len(values)):
        on = values[i] > strong or (on and values[i] >= weak)
        found[i] = on
    return found


def _bone(clip: Seen, a: str, b: str) -> float:
    return max(float(np.median(np.linalg.norm(clip.joint(a) - clip.joint(b), axis=1))), 1e-6)


def _measured(clip: Seen) -> Iterator[Measured]:
    humerus = (_bone(clip, "left_shoulder", "left_elbow") + _bone(clip, "right_shoulder", "right_elbow")) / 2
    shoulders, hips = _bone(clip, "left_shoulder", "right_shoulder"), _bone(clip, "left_hip", "right_hip")
    yield from _arms(clip, humerus, shoulders)
    yield from _legs(clip, humerus, hips)
    yield from _body(clip, humerus, shoulders)


def _arms(clip: Seen, humerus: float, shoulders: float) -> Iterator[Measured]:
    spine = clip.joint("neck")
    front = np.cross(clip.joint("left_hip") - clip.joint("right_hip"), spine)
    wrists = [clip.joint(f"{side}_wrist") for side in SIDES]
    speeds = [clip.velocity(f"{side}_wrist") for side in SIDES]
    between = wrists[1] - wrists[0]
    for wrist, speed, side in zip(wrists, speeds, SIDES, strict=True):
        yield along(speed, front) / humerus, 1.8, 1.3  # moves ahead
        yield along(wrist - spine, spine) / humerus, 0.2, 0.0  # above the neck
        yield along(speed, spine) / humerus, 1.8, 1.3  # moves upwards
        yield -bend(clip, side, "arm"), -110.0, -120.0
        yield along(speed, wrist) / humerus, 1.4, 1.2  # moves away from the hips
        yield np.linalg.norm(speed, axis=1) / humerus, 2.5, 2.0
    across = clip.joint("right_shoulder") - clip.joint("left_shoulder")
    yield along(between, across) / shoulders, 2.5, 2.0  # far apart
    yield -along(speeds[1] - speeds[0], between) / humerus, 1.4, 1.2  # come together


def _legs(clip: Seen, humerus: float, hips: float) -> Iterator[Measured]:
    ankles = [clip.joint(f"{side}_ankle") for side in SIDES]
    speeds = [clip.velocity(f"{side}_ankle") for side in SIDES]
    low = np.minimum(ankles[0][:, 1], ankles[1][:, 1])
    across = clip.joint("right_hip") - clip.joint("left_hip")
    for i, side in enumerate(SIDES):
        other = ankles[1 - i]
        front = np.cross(clip.joint("left_hip") - clip.joint("right_hip"), -other)  # of the plane of the other leg
        yield -along(ankles[i] - other, front) / humerus, 0.38, 0.0  # behind the other leg
        yield (ankles[i][:, 1] - low) / humerus, 1.2, 1.0  # raised
        yield -bend(clip, side, "leg"), -110.0, -120.0
        yield np.linalg.norm(speeds[i], axis=1) / humerus, 2.5, 2.0
    apart, parting = along(ankles[1] - ankles[0], across) / hips, along(speeds[1] - speeds[0], across) / humerus
    yield apart, 2.1, 1.8
    yield -apart, 0.0, -0.1  # crossed
    yield -parting, 1.4, 1.2
    yield parting, 1.4, 1.2


def _body(clip: Seen, humerus: float, shoulders: float) -> Iterator[Measured]:
    spine = clip.joint("neck")
    ankles = [clip.joint(f"{side}_ankle") for side in SIDES]
    low = np.minimum(ankles[0][:, 1], ankles[1][:, 1])
    lines = [clip.joint(f"left_{part}") - clip.joint(f"right_{part}") for part in ("hip", "shoulder")]
    twist = np.degrees(np.arctan2(np.cross(lines[0], lines[1])[:, 1], (lines[0] * lines[1])[:, [0, 2]].sum(axis=1)))
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        arm = clip.joint(f"{side}_elbow") - clip.joint(f"{side}_shoulder")
        thigh = clip.joint(f"{side}_knee") - clip.joint(f"{side}_hip")
        yield angle(-spine, arm), 25.0, 20.0
        yield angle(-spine, thigh), 50.0, 45.0
        yield -(clip.joint(f"{side}_wrist")[:, 1] - low) / humerus, -1.2, -1.4  # lowered
        yield sign * twist, 25.0, 20.0  # shoulders turned against the hips
    yield (ankles[0][:, 2] + ankles[1][:, 2]) / (2 * humerus), 0.5, 0.35  # hips behind the feet
    yield -np.abs(angle(spine, np.broadcast_to(UP, spine.shape)) - 90.0), -20.0, -30.0  # spine level
    extent = np.ptp(clip.joints, axis=1)
    yield -extent[:, 1] / humerus, -3.5, -4.0  # low
    yield np.hypot(extent[:, 0], extent[:, 2]) / shoulders, 5.0, 4.5  # wide
    yield np.linalg.norm(clip.root[:, :3], axis=1) / humerus, 2.3, 2.0
