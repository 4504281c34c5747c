"""The canonical skeleton: its joints and rest pose, its mirror image, and where a body faces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray
from motionlake.motion.rotations import turn_about_y

JOINTS: Final[tuple[str, ...]] = (
    "hips", "spine", "chest", "neck", "head",
    "left_clavicle", "left_shoulder", "left_elbow", "left_wrist",
    "right_clavicle", "right_shoulder", "right_elbow", "right_wrist",
    "left_hip", "left_knee", "left_ankle", "left_toe",
    "right_hip", "right_knee", "right_ankle", "right_toe",
)  # fmt: skip
PARENTS: Final[tuple[int, ...]] = (-1, 0, 1, 2, 3, 2, 5, 6, 7, 2, 9, 10, 11, 0, 13, 14, 15, 0, 17, 18, 19)
INDEX: Final[dict[str, int]] = {name: i for i, name in enumerate(JOINTS)}
FEET: Final = [INDEX[name] for name in ("left_ankle", "left_toe", "right_ankle", "right_toe")]
_OTHER_SIDE: Final = {"left": "right", "right": "left"}
# Index of each joint's counterpart on the other side; a joint of the middle is its own.
MIRRORED_JOINTS: Final = tuple(INDEX["_".join(_OTHER_SIDE.get(w, w) for w in name.split("_"))] for name in JOINTS)

# The next joint of each joint's limb, and where it lies in the canonical rest pose. Joints that are missing here
# start several bones (hips, chest) or none: their orientation comes from the rest pose of the file.
BONES: Final[dict[str, tuple[str, tuple[float, float, float]]]] = {
    "spine": ("chest", (0.0, 1.0, 0.0)), "neck": ("head", (0.0, 1.0, 0.0)),
    "left_clavicle": ("left_shoulder", (1.0, 0.0, 0.0)),
    "right_clavicle": ("right_shoulder", (-1.0, 0.0, 0.0)),
    "left_shoulder": ("left_elbow", (1.0, 0.0, 0.0)), "right_shoulder": ("right_elbow", (-1.0, 0.0, 0.0)),
    "left_elbow": ("left_wrist", (1.0, 0.0, 0.0)), "right_elbow": ("right_wrist", (-1.0, 0.0, 0.0)),
    "left_hip": ("left_knee", (0.0, -1.0, 0.0)), "right_hip": ("right_knee", (0.0, -1.0, 0.0)),
    "left_knee": ("left_ankle", (0.0, -1.0, 0.0)), "right_knee": ("right_ankle", (0.0, -1.0, 0.0)),
    "left_ankle": ("left_toe", (0.0, 0.0, 1.0)), "right_ankle": ("right_toe", (0.0, 0.0, 1.0)),
}  # fmt: skip
# The axis about which a joint's rest orientation is twisted: its bone; of hands and toes, the bone before them.
TWIST_AXES: Final[dict[str, tuple[float, float, float]]] = {
    **{name: direction for name, (_, direction) in BONES.items()},
    "left_wrist": (1.0, 0.0, 0.0), "right_wrist": (-1.0, 0.0, 0.0),
    "left_toe": (0.0, 0.0, 1.0), "right_toe": (0.0, 0.0, 1.0),
}  # fmt: skip


def _all_but(*left_out: str) -> tuple[str, ...]:
    """All joints but these, named without their side."""
    return tuple(name for name in JOINTS if name.split("_")[-1] not in left_out)


# 15 joints that every rig measures itself (none is filled in by interpolation).
COMMON: Final = _all_but("spine", "chest", "clavicle", "toe")
# Deep Motifs, section 5.1: the m = 16 most informative joints with their relative joint angles. The hips'
# own rotation is the body's orientation in the world, which words are invariant to.
DEEP_MOTIFS: Final = _all_but("hips", "clavicle", "toe")


def chained(offsets: Float64Array, parents: Sequence[int] = PARENTS) -> Float64Array:
    """Places [..., J, 3] of joints from the offset of each from its parent; the root's offset is its place."""
    places = np.array(offsets)
    for joint, parent in enumerate(parents):
        if parent >= 0:
            places[..., joint, :] += places[..., parent, :]
    return places


def mirrored_positions(positions: FloatArray) -> FloatArray:
    """Canonical joint positions [F, 21, 3] of the mirrored motion: reflected across x = 0, sides exchanged."""
    return positions[:, list(MIRRORED_JOINTS)] * np.array([-1.0, 1.0, 1.0], dtype=positions.dtype)


def mirrored_rotations(rotations: FloatArray) -> FloatArray:
    """Canonical local rotations [F, 21, 4] of the mirrored motion; the rest pose is its own mirror image."""
    return rotations[:, list(MIRRORED_JOINTS)] * np.array([1.0, 1.0, -1.0, -1.0], dtype=rotations.dtype)


# A mean left axis (of length 1 at most) whose horizontal part is shorter says nothing of the heading.
MIN_HORIZONTAL: Final = 0.05


def facing(positions: FloatArray) -> Float64Array:
    """Heading of the body: the angle about +y that turns +z to where it faces.

    The left axis is the mean of the unit vectors right to left hip and right to left shoulder; the body faces
    left x up. Frames in which that axis is near vertical (a body on its side) take the heading of the nearest
    frame in time that has one; 0 where none has.

    Args:
        positions: [F, 21, 3] canonical joint positions, y up.

    Returns:
        [F] radians, continuous in time (unwrapped).
    """
    left = np.zeros((len(positions), 3))
    for joint in ("hip", "shoulder"):
        sides = positions[:, [INDEX[f"left_{joint}"], INDEX[f"right_{joint}"]]].astype(np.float64)
        axis = sides[:, 0] - sides[:, 1]
        left += axis / np.maximum(np.linalg.norm(axis, axis=-1, keepdims=True), 1e-12) / 2
    valid = np.flatnonzero(np.hypot(left[:, 0], left[:, 2]) > MIN_HORIZONTAL)
    if not len(valid):
        return np.zeros(len(positions))
    yaw = np.unwrap(np.arctan2(-left[valid, 2], left[valid, 0]))
    frames = np.arange(len(positions))
    after = np.clip(np.searchsorted(valid, frames), 0, len(valid) - 1)
    before = np.maximum(after - 1, 0)
    nearer = np.where(np.abs(valid[before] - frames) <= np.abs(valid[after] - frames), before, after)
    return np.asarray(yaw[nearer], np.float64)


LENGTH_JOINTS: Final = ("spine", "chest", "neck", "left_knee", "left_ankle", "right_knee", "right_ankle")
LENGTH_SHARES: Final = np.array([1.0, 1.0, 1.0, 0.5, 0.5, 0.5, 0.5])


def body_poses(positions: FloatArray) -> Float64Array:
    """[F, 21, 3] joints seen from the body: hips at the origin, every frame turned to face +z."""
    joints = positions.astype(np.float64) - positions[:, :1]
    return turn_about_y(joints, -facing(positions))


def body_length(rest_offsets: Float64Array) -> float:
    """Leg and torso of a body, in the unit of its rest offsets [21, 3]."""
    return float(np.linalg.norm(rest_offsets[[INDEX[name] for name in LENGTH_JOINTS]], axis=1) @ LENGTH_SHARES)
