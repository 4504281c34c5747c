"""Joint rotations from joint positions alone: bones point where they should, twist about them is zero."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.motion.canonical import BONES, INDEX, JOINTS, PARENTS
from motionlake.motion.clip import FloatArray
from motionlake.motion.rotations import conjugate, from_matrix, multiply, normalise, rotate, swing

MIN_LENGTH: Final = 1e-9


def world_from_positions(positions: FloatArray) -> FloatArray:
    """Global canonical rotations without twist.

    Hips and chest turn with the line across hips or shoulders and the line up to the neck. Any other joint
    turns from its parent by the smallest rotation that points its bone along the measured one. A bone
    of length zero, or a body line that gives no frame, turns with the parent (hips: as canonical).

    Args:
        positions: [F, 21, 3] canonical joints, y up.

    Returns:
        [F, 21, 4].
    """
    world = np.zeros((len(positions), len(JOINTS), 4))
    for joint, name in enumerate(JOINTS):
        identity = np.tile(np.array([1.0, 0.0, 0.0, 0.0]), (len(positions), 1))
        parent = np.ascontiguousarray(world[:, PARENTS[joint]]) if joint else identity
        if name == "hips":
            world[:, joint] = _body_frame(positions, "hip", "hips", parent)
        elif name == "chest":
            world[:, joint] = _body_frame(positions, "shoulder", "hips", parent)
        elif name in BONES:
            child, direction = BONES[name]
            bone = rotate(conjugate(parent), positions[:, INDEX[child]] - positions[:, joint])
            world[:, joint] = multiply(parent, _swing(np.array(direction), bone))
        else:
            world[:, joint] = parent
    return world


def _body_frame(positions: FloatArray, across: str, below: str, otherwise: FloatArray) -> FloatArray:
    """[F, 4] frame with x along right to left and y near to the line from joint `below` to the neck."""
    left = positions[:, INDEX[f"left_{across}"]] - positions[:, INDEX[f"right_{across}"]]
    up = positions[:, INDEX["neck"]] - positions[:, INDEX[below]]
    forward = np.cross(left, up)
    valid = np.linalg.norm(forward, axis=-1) > MIN_LENGTH
    frame = np.array(otherwise)
    if valid.any():
        left, forward = left[valid], forward[valid]
        axes = (left, np.cross(forward, left), forward)
        frame[valid] = from_matrix(np.stack([normalise(axis) for axis in axes], axis=-1))
    return frame


def _swing(direction: FloatArray, bones: FloatArray) -> FloatArray:
    rotations = np.tile(np.array([1.0, 0.0, 0.0, 0.0]), (len(bones), 1))
    valid = np.linalg.norm(bones, axis=-1) > MIN_LENGTH
    if valid.any():
        rotations[valid] = swing(np.broadcast_to(direction, bones[valid].shape), bones[valid])
    return rotations
