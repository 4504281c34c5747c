"""Forward kinematics of the canonical skeleton and its inverse."""

from __future__ import annotations

import numpy as np
from motionlake.motion.canonical import PARENTS
from motionlake.motion.clip import FloatArray
from motionlake.motion.rotations import conjugate, multiply, rotate


def world_rotations(local: FloatArray) -> FloatArray:
    """Global rotations [..., 21, 4] of local ones."""
    world = np.array(local, float)
    for joint, parent in enumerate(PARENTS):
        if parent >= 0:
            world[..., joint, :] = multiply(
                np.ascontiguousarray(world[..., parent, :]), np.ascontiguousarray(local[..., joint, :])
            )
    return world


def local_rotations(world: FloatArray) -> FloatArray:
    """Local rotations [..., 21, 4] of global ones: parent^-1 * own."""
    local: FloatArray = multiply(conjugate(world[..., list(PARENTS), :]), world)
    local[..., 0, :] = world[..., 0, :]
    return local


def bone_vectors(positions: FloatArray, world: FloatArray) -> FloatArray:
    """Offsets [F, 21, 3] of joints from their parents, as the parents see them; zero at the hips."""
    parents = list(PARENTS)
    vectors: FloatArray = rotate(conjugate(world[:, parents]), positions - positions[:, parents])
    vectors[:, 0] = 0.0
    return vectors


def forward_kinematics(root: FloatArray, rotations: FloatArray, rest_offsets: FloatArray) -> FloatArray:
    """Joint positions.

    Args:
        root: [F, 3] position of the hips.
        rotations: [F, 21, 4] local rotations (w, x, y, z).
        rest_offsets: [21, 3] offset of every joint from its parent in the canonical rest pose.

    Returns:
        [F, 21, 3] in the units of `root`.
    """
    bones = rotate(world_rotations(rotations)[:, list(PARENTS)], rest_offsets)
    positions = np.empty_like(bones)
    positions[:, 0] = root
    for joint, parent in enumerate(PARENTS):
        if parent >= 0:
            positions[:, joint] = positions[:, parent] + bones[:, joint]
    return positions


def continuous_signs(q: FloatArray) -> FloatArray:
    """[F, J, 4] with the signs that keep neighbours in time on one hemisphere; the first has w >= 0."""
    signs = np.ones((*q.shape[:-1], 1))
    signs[0] = np.where(q[0, :, :1] < 0, -1.0, 1.0)
    signs[1:] = np.where(np.sum(q[1:] * q[:-1], axis=-1, keepdims=True) < 0, -1.0, 1.0)
    continuous: FloatArray = q * np.cumprod(signs, axis=0)
    return continuous
