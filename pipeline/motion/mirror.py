"""Mirrored motion: the body reflected across its sagittal plane, on features as `word_features` gives them.

Reflecting the world across x = 0 and exchanging left and right joints turns the heading around, so seen from
the body every x changes its sign, and so does the yaw rate. A local rotation (w, x, y, z) becomes
(w, x, -y, -z), since the canonical rest pose is its own mirror image. Both maps are linear and exact: no clip
has to be read again.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, FloatArray, Int64Array
from motionlake.motion.features import WordConfig
from motionlake.motion.skeleton import INDEX, JOINTS

_ACROSS: Final = {"left_": "right_", "right_": "left_"}


def other_side(joint: str) -> str:
    """The joint of the other side; a joint of the middle is its own."""
    return next((there + joint.removeprefix(here) for here, there in _ACROSS.items() if joint.startswith(here)), joint)


MIRRORED_JOINTS: Final = tuple(INDEX[other_side(joint)] for joint in JOINTS)


def mirrored_features(features: Float32Array, config: WordConfig) -> Float32Array:
    """Features of the mirrored motion.

    Args:
        features: [T, D] of `word_features` under `config`.
        config: what they were computed with.

    Returns:
        [T, D], what `word_features` gives for the mirrored clip; applied twice, the features again.

    Raises:
        ValueError: features of another width.
    """
    columns, signs = _permutation(config)
    if features.shape[1] != len(columns):
        raise ValueError(f"features of width {features.shape[1]} do not fit a configuration of width {len(columns)}")
    return np.ascontiguousarray(features[:, columns] * signs)


def mirrored_positions(positions: FloatArray) -> FloatArray:
    """Canonical joint positions [F, 21, 3] of the mirrored motion: reflected across x = 0, sides exchanged."""
    return positions[:, list(MIRRORED_JOINTS)] * np.array([-1.0, 1.0, 1.0], dtype=positions.dtype)


def mirrored_rotations(rotations: FloatArray) -> FloatArray:
    """Canonical local rotations [F, 21, 4] of the mirrored motion."""
    return rotations[:, list(MIRRORED_JOINTS)] * np.array([1.0, 1.0, -1.0, -1.0], dtype=rotations.dtype)


def _permutation(config: WordConfig) -> tuple[Int64Array, Float32Array]:
    """For each number of a mirrored frame, the column it comes from and its sign."""
    joints = config.joint_indices
    across = np.array([joints.index(MIRRORED_JOINTS[joint]) for joint in joints])
    if config.representation == "rotations":
        return _per_joint(across, 4), np.tile(np.array([1, 1, -1, -1], np.float32), len(joints))
    columns, signs = [_per_joint(across, 3)], [np.tile(np.array([-1, 1, 1], np.float32), len(joints))]
    if config.velocity_weight > 0:
        columns.append(columns[0] + 3 * len(joints))
        signs.append(signs[0])
    if config.root_weight > 0:
        columns.append(np.arange(4) + sum(map(len, columns)))
        signs.append(np.array([-1, 1, 1, -1], np.float32))
    return np.concatenate(columns), np.concatenate(signs)


def _per_joint(joints: Int64Array, width: int) -> Int64Array:
    return (joints[:, None] * width + np.arange(width)).ravel()
