"""How far each joint turns, and which joints never turn at all: a hand that is stiff is seen on a skinned body."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array, FloatArray
from motionlake.motion.rotations import angle
from motionlake.motion.skeleton import JOINTS

TOLD: Final = ("head", "left_wrist", "right_wrist", "left_toe", "right_toe")  # beside the mean over all joints
QUANTILE: Final = 0.95
IDENTITY: Final = 0.1  # degrees
NOTHING: Final = np.array([1.0, 0.0, 0.0, 0.0])


def angular_ranges(rotations: FloatArray) -> Float64Array:
    """[21] degrees from their mean of the local rotations [F, 21, 4] of each joint, 95 % quantile over time."""
    turns = rotations.astype(np.float64)
    found = np.empty(turns.shape[1])
    for joint in range(turns.shape[1]):
        own = turns[:, joint]
        _, vectors = np.linalg.eigh(own.T @ own)  # the mean of rotations, whatever their signs
        found[joint] = np.quantile(angle(own, np.broadcast_to(vectors[:, -1], own.shape)), QUANTILE)
    return found


def never_turned(motions: Sequence[FloatArray]) -> list[str]:
    """The joints whose local rotation is the identity in every frame of all motions, each [F, 21, 4]."""
    still: BoolArray = np.ones(len(JOINTS), dtype=np.bool_)
    for rotations in motions:
        turns = rotations.astype(np.float64)
        still &= (angle(np.broadcast_to(NOTHING, turns.shape), turns) < IDENTITY).all(axis=0)
    return [name for name, so in zip(JOINTS, still, strict=True) if so] if len(motions) else []
