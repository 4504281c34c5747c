"""Feet that stand neither slide nor sink: hips settle on them, and hip, knee and ankle take what is left."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array
from motionlake.matching.recordings import FEET
from motionlake.motion.kinematics import forward_kinematics, local_rotations, world_rotations
from motionlake.motion.rotations import multiply, swing
from motionlake.motion.skeleton import INDEX
from motionlake.motion.standing import SIDES, staying
from motionlake.motion.two_bones import bent, level_ahead
from scipy.ndimage import gaussian_filter1d

SETTLE: Final = 4.0  # frames over which the body settles
SMOOTH: Final = 1.5  # frames
FAR: Final = 0.2  # body lengths that a foot is held back while it stands, at most
BLEND: Final = 5  # frames over which a foot comes to where it stands, and leaves it


def grounded(
    hips: Float64Array, rotations: Float64Array, rest_offsets: Float64Array, stands: BoolArray, lowest: Float64Array
) -> Float64Array:
    """Hips [T, 3] moved up or down so that the feet that stand are on the ground.

    Args:
        hips: [T, 3] metres.
        rotations: [T, 21, 4] local.
        rest_offsets: [21, 3] metres.
        stands: [T, 4] of `FEET`.
        lowest: [4] height of each of these where it stands flat.
    """
    feet = forward_kinematics(hips, rotations, rest_offsets)[:, [INDEX[name] for name in FEET], 1]
    above = feet - lowest
    weight = stands.any(axis=1).astype(float)
    off = np.where(stands, above, np.inf).min(axis=1)
    off = np.where(np.isfinite(off), off, 0.0)
    spread = gaussian_filter1d(off * weight, SETTLE) / (gaussian_filter1d(weight, SETTLE) + 0.05)
    moved = hips.copy()
    moved[:, 1] -= spread
    return moved


def planted(
    hips: Float64Array, rotations: Float64Array, rest_offsets: Float64Array, stands: BoolArray, lowest: Float64Array,
    size: float,
) -> Float64Array:  # fmt: skip
    """Local rotations [T, 21, 4] by which standing feet stay where they are and no foot is below the ground.

    Args:
        hips, rotations, rest_offsets, stands, lowest: as of `grounded`.
        size: metres of a body length.
    """
    joints = forward_kinematics(hips, rotations, rest_offsets)
    world = world_rotations(rotations)
    ahead = level_ahead(joints[:, INDEX["left_hip"]], joints[:, INDEX["right_hip"]])
    for i, side in enumerate(SIDES):
        hip, knee, ankle, toe = (INDEX[f"{side}_{part}"] for part in ("hip", "knee", "ankle", "toe"))
        foot, own = joints[:, [ankle, toe]], stands[:, 2 * i : 2 * i + 2]
        change = staying(foot, np.asarray(own.any(axis=1)), FAR * size, BLEND)
        change[:, 1] = _upright(foot[..., 1] - lowest[2 * i : 2 * i + 2], own)
        to_knee, to_ankle = bent(joints[:, hip], joints[:, knee], joints[:, ankle], foot[:, 0] + change, ahead)
        for joint, before, after in (
            (hip, joints[:, knee] - joints[:, hip], to_knee - joints[:, hip]),
            (knee, joints[:, ankle] - joints[:, knee], to_ankle - to_knee),
        ):
            world[:, joint] = multiply(swing(before, after), world[:, joint])
    return local_rotations(world)


def _upright(above: Float64Array, stands: BoolArray) -> Float64Array:
    """[T] by which a foot is moved up or down: onto the ground while it stands, never below it.

    Args:
        above: [T, 2] heights of ankle and toe above where they stand.
        stands: [T, 2].
    """
    held = stands.any(axis=1)
    off = np.where(stands, above, np.inf).min(axis=1)
    off = np.where(held, np.where(np.isfinite(off), off, 0.0), 0.0)
    weight = held.astype(float)
    down = gaussian_filter1d(-off * weight, SMOOTH) / (gaussian_filter1d(weight, SMOOTH) + 0.05)
    sunk = np.maximum(0.0, -(above + down[:, None]).min(axis=1))
    lift: Float64Array = down + np.maximum(sunk, gaussian_filter1d(sunk, SMOOTH))
    return lift


def heights_standing(joints: Float64Array, ground: float) -> Float64Array:
    """[4] heights over the ground of the joints of `FEET` of a body's frames [F, 21, 3], where they are lowest."""
    feet = joints[:, [INDEX[name] for name in FEET], 1] - ground
    lowest = np.quantile(feet, 0.05, axis=0)
    level: Float64Array = np.repeat(np.minimum(lowest[:2], lowest[2:])[None], 2, axis=0).ravel()
    return level
