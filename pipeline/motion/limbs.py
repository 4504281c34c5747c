"""Limbs of constant length that lie as near as they can to recorded joints."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.kinematics import forward_kinematics, local_rotations, world_rotations
from motionlake.motion.skeleton import INDEX, PARENTS, body_length
from motionlake.motion.standing import SIDES
from motionlake.motion.two_bones import turn_leg

RIGID: Final = 0.01  # body lengths by which hand or foot of a body of constant bones is off, at most: the mean
VARIES: Final = 0.02  # of its length, a bone's standard deviation: of a sensor, and not of a body
ROUNDS: Final = 10  # after five, recorded limbs change by less than a hundredth of a millimetre
LIMBS: Final = tuple(
    tuple(INDEX[f"{side}_{joint}"] for joint in limb)
    for limb in (("hip", "knee", "ankle"), ("shoulder", "elbow", "wrist"))
    for side in SIDES
)
BONES: Final = tuple(  # the lower ends of their bones, left and right
    pair for left, right in zip(LIMBS[::2], LIMBS[1::2], strict=True) for pair in zip(left[1:], right[1:], strict=True)
)


def even_limbs(positions: Float64Array, rest_offsets: Float64Array) -> Float64Array:
    """[21, 3] rest offsets with arms and legs as long on one side as on the other, where a sensor's bones vary.

    The leg that a depth sensor sees less well is the shorter one in the mean: one who stands would bend the other knee.
    A body whose bones keep their length stays as it is.

    Args:
        positions: [F, 21, 3] canonical joints, metres.
        rest_offsets: [21, 3] metres.
    """
    joints = np.array(BONES).ravel()
    lengths = np.linalg.norm(positions[:, joints] - positions[:, np.array(PARENTS)[joints]], axis=2)
    if (lengths.std(axis=0) <= VARIES * lengths.mean(axis=0)).all():
        return rest_offsets
    even = rest_offsets.copy()
    for left, right in BONES:
        both = np.linalg.norm(rest_offsets[[left, right]], axis=1)
        even[[left, right]] *= (both.mean() / np.maximum(both, 1e-9))[:, None]
    return even


def nearest_limbs(positions: Float64Array, rotations: Float64Array, rest_offsets: Float64Array) -> Float64Array:
    """[F, 21, 4] local rotations whose knees, ankles, elbows and wrists are nearest to the recorded ones.

    A depth sensor's bones change their length: bones of constant length in the same directions add up their errors
    along a limb, so that one who squats, whose thighs are seen shortened, would hardly bend the knees. Limbs of a body
    whose bones keep their length are left as they are, and so are hips, shoulders, and how hands and feet are turned.

    Args:
        positions: [F, 21, 3] canonical joints, metres, y up.
        rotations: [F, 21, 4] local (w, x, y, z).
        rest_offsets: [21, 3] metres.
    """
    joints = forward_kinematics(positions[:, 0], rotations, rest_offsets)
    off = np.linalg.norm(joints - positions, axis=-1).mean(axis=0)
    changed = [limb for limb in LIMBS if off[limb[-1]] > RIGID * body_length(rest_offsets)]
    if not changed:
        return rotations
    world = world_rotations(rotations)
    for root, middle, end in changed:
        before = joints[:, root], joints[:, middle], joints[:, end]
        turn_leg(world, (root, middle), before, *nearest(*before, positions[:, middle], positions[:, end]))
    return local_rotations(world)


def nearest(
    root: Float64Array, middle: Float64Array, end: Float64Array, wanted_middle: Float64Array, wanted_end: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Middle and end [F, 3] of limbs, of the least sum of squared distances to wanted ones [F, 3].

    Bones keep their length. One bone after the other is turned to where it is best while the other keeps its direction:
    no round makes the sum greater. It begins with the limb as it is.
    """
    upper, lower = _length(middle - root), _length(end - middle)
    along = _direction(end - middle)
    for _ in range(ROUNDS):
        middle = root + upper * _direction(wanted_middle - root + wanted_end - lower * along - root)
        along = _direction(wanted_end - middle)
    return middle, middle + lower * along


def _length(bones: Float64Array) -> Float64Array:
    """[F, 1]."""
    return np.asarray(np.linalg.norm(bones, axis=1, keepdims=True))


def _direction(vectors: Float64Array) -> Float64Array:
    return np.asarray(vectors / np.maximum(_length(vectors), 1e-9))
