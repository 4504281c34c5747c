"""Joint centres that no marker places: a trunk that goes on from the pelvis, arms that hang, a head above the trunk."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.motion.rotations import MIN_LENGTH

# Shares of the length of a leg, from the segment lengths of D. Winter, "Biomechanics and Motor Control of Human
# Movement" (after Drillis and Contini), which are shares of stature: thigh and shank 0.245 + 0.246.
_LEG: Final = 0.491
_NECK: Final = 0.288 / _LEG  # from the hips up to the height of the shoulders
_HALF_SHOULDERS: Final = 0.1295 / _LEG
_UPPER_ARM: Final = 0.186 / _LEG
_FOREARM: Final = 0.146 / _LEG
_HEAD: Final = 1.25  # of the way from the hips to the neck, as far above which the head's centre is
# How far the front of a pelvis may hang in standing (degrees): what a clip shows beyond is bent legs.
_MOST_TILT: Final = 25.0
_LONGEST_PART: Final = 2.0  # times as long as the other of thigh and shank


@dataclass(frozen=True)
class Axes:
    """Unit vectors [F, 3] of a part of the body, at right angles: to its right, ahead, and up."""

    right: Float64Array
    ahead: Float64Array
    up: Float64Array

    @classmethod
    def of(cls, right: Float64Array, ahead: Float64Array, part: str) -> Axes:
        """Of what points right and about ahead [F, 3]; `ClipError` where they are one line, or none."""
        right = _unit(right, part)
        ahead = _unit(ahead - _dot(ahead, right) * right, part)
        return cls(right, ahead, np.cross(right, ahead))


def _dot(one: Float64Array, other: Float64Array) -> Float64Array:
    return np.asarray((one * other).sum(axis=1, keepdims=True))


def _unit(vectors: Float64Array, part: str) -> Float64Array:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    if (lengths < MIN_LENGTH).any():
        raise ClipError(f"the markers of the {part} are in one line")
    unit: Float64Array = vectors / lengths
    return unit


def with_unmarked(
    centres: Mapping[str, Float64Array], pelvis: Axes | None, chest_ahead: Float64Array | None
) -> dict[str, Float64Array]:
    """All joint centres [F, 3] of the rig `markers`: those given, and those of trunk, arms and head that lack.

    The neck is above the hips as a trunk in line with the mean leg, seen from the pelvis, has it: so the trunk turns
    with the pelvis and stands where the body does. The arms hang along the trunk.

    Args:
        centres: of hips and legs, and what else is known, metres.
        pelvis: its axes; needed where no more is known than legs.
        chest_ahead: what points ahead of the chest [F, 3]; None where only the pelvis says.

    Raises:
        ClipError: thighs and shanks are no person's, so that no length of the rest follows from them.
    """
    whole = dict(centres)
    if "left_wrist_centre" not in whole and pelvis is not None:
        leg = _leg(whole)
        if "neck_centre" not in whole:
            whole["neck_centre"] = whole["hip_centre"] + _NECK * leg * _trunk(whole, pelvis)
        up = _unit(whole["neck_centre"] - whole["hip_centre"], "trunk")
        ahead = pelvis.ahead if chest_ahead is None else chest_ahead
        right = _unit(np.cross(ahead, up), "trunk")
        for side, sign in (("left", -1.0), ("right", 1.0)):
            shoulder = whole.setdefault(
                f"{side}_shoulder_centre", whole["neck_centre"] + sign * _HALF_SHOULDERS * leg * right
            )
            whole[f"{side}_elbow_centre"] = shoulder - _UPPER_ARM * leg * up
            whole[f"{side}_wrist_centre"] = shoulder - (_UPPER_ARM + _FOREARM) * leg * up
    if "head_centre" not in whole:
        whole["head_centre"] = whole["hip_centre"] + _HEAD * (whole["neck_centre"] - whole["hip_centre"])
    return whole


def _leg(centres: Mapping[str, Float64Array]) -> float:
    """Metres from hip to ankle of a stretched leg, the mean of both and of the clip."""

    def mean(above: str, below: str) -> float:
        bones = [centres[f"{side}_{above}_centre"] - centres[f"{side}_{below}_centre"] for side in ("left", "right")]
        return float(np.linalg.norm(bones, axis=2).mean())

    thigh, shank = mean("hip", "knee"), mean("knee", "ankle")
    if max(thigh, shank) > _LONGEST_PART * min(thigh, shank):
        raise ClipError(f"no person's legs: thighs are {thigh:.2g} m long, shanks {shank:.2g} m")
    return thigh + shank


def _trunk(centres: Mapping[str, Float64Array], pelvis: Axes) -> Float64Array:
    """[F, 3] unit vectors up a trunk that is fixed to the pelvis."""
    leg = centres["hip_centre"] - 0.5 * (centres["left_ankle_centre"] + centres["right_ankle_centre"])
    tilt = np.arctan2(-_dot(leg, pelvis.ahead).mean(), _dot(leg, pelvis.up).mean())
    tilt = np.clip(tilt, 0.0, np.radians(_MOST_TILT))
    return np.asarray(np.cos(tilt) * pelvis.up - np.sin(tilt) * pelvis.ahead)
