"""The body that generators know: a standard skeleton, so that performers do not differ in their bones (4.3.2)."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.rest import world_from_positions
from motionlake.motion.skeleton import INDEX, JOINTS, forward_kinematics, local_rotations

# Offsets of joints from their parents in the canonical rest pose, of an average body, in body lengths: a body length
# is a leg and a torso, from ankle over knee to hip and from the root over spine and chest to the neck.
_OFFSETS: Final[dict[str, tuple[float, float, float]]] = {
    "spine": (0, 0.12, 0), "chest": (0, 0.12, 0), "neck": (0, 0.12, 0), "head": (0, 0.12, 0),
    "left_clavicle": (0.03, 0.08, 0), "left_shoulder": (0.11, 0, 0), "left_elbow": (0.22, 0, 0),
    "left_wrist": (0.19, 0, 0), "left_hip": (0.075, -0.03, 0), "left_knee": (0, -0.33, 0),
    "left_ankle": (0, -0.31, 0), "left_toe": (0, 0, 0.1),
}  # fmt: skip


def _mirrored(name: str) -> tuple[float, float, float]:
    x, y, z = _OFFSETS[name.replace("right_", "left_")]
    return (-x, y, z)


STANDARD: Final[Float64Array] = np.array(
    [(0, 0, 0), *(_OFFSETS.get(name) or _mirrored(name) for name in JOINTS[1:])], dtype=float
)
_LENGTH: Final = ("spine", "chest", "neck", "left_knee", "left_ankle", "right_knee", "right_ankle")
_SHARES: Final = np.array([1.0, 1.0, 1.0, 0.5, 0.5, 0.5, 0.5])


def body_length(rest_offsets: Float64Array) -> float:
    """Leg and torso of a body, in the unit of its rest offsets [21, 3]."""
    return float(np.linalg.norm(rest_offsets[[INDEX[name] for name in _LENGTH]], axis=1) @ _SHARES)


def measured_length(positions: Float64Array) -> float:
    """Leg and torso of a body as its joints [F, 21, 3] show them: medians over the frames."""
    parents = {"spine": "hips", "chest": "spine", "neck": "chest"}
    total = 0.0
    for name, share in zip(_LENGTH, _SHARES, strict=True):
        side, _, joint = name.partition("_")
        parent = parents.get(name) or f"{side}_{'hip' if joint == 'knee' else 'knee'}"
        bones = positions[:, INDEX[name]] - positions[:, INDEX[parent]]
        total += share * float(np.median(np.linalg.norm(bones, axis=1)))
    return total


def standard_joints(positions: Float64Array) -> Float64Array:
    """[F, 21, 3] the same poses by the standard skeleton, root at the origin, in body lengths.

    Bones point where they do in `positions` [F, 21, 3]; their lengths, and the shape of pelvis and shoulders, are the
    standard skeleton's.
    """
    return posed(positions, STANDARD, np.zeros((len(positions), 3)))[0]


def posed(positions: Float64Array, rest_offsets: Float64Array, root: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Poses by another body.

    Args:
        positions: [F, 21, 3] joints, whatever their bones' lengths.
        rest_offsets: [21, 3] of the body.
        root: [F, 3] where its hips are.

    Returns:
        Its joints [F, 21, 3], and local rotations [F, 21, 4] that give them by forward kinematics.
    """
    rotations = local_rotations(world_from_positions(np.ascontiguousarray(positions)))
    return forward_kinematics(root, rotations, rest_offsets), rotations
