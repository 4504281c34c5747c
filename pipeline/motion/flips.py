"""Joints that are turned by half about their own bone from one frame to the next, which no body does."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.kinematics import continuous_signs, local_rotations, world_rotations
from motionlake.motion.rotations import from_vectors, multiply
from motionlake.motion.skeleton import INDEX, TWIST_AXES

SHARP: Final = np.cos(np.pi / 4)  # of half the angle that a joint turns within a frame: a quarter turn


def without_flips(rotations: Float64Array) -> Float64Array:
    """[F, 21, 4] local rotations without half turns of joints about their bones; joints are where they were.

    Some recordings have them where a thigh or an arm points about away from where it does at rest. Between two such
    frames a leg is anywhere. Which of both sides is right is not known: that of most frames is taken.

    Args:
        rotations: [F, 21, 4] local (w, x, y, z).
    """
    if len(rotations) < 2 or np.abs((rotations[1:] * rotations[:-1]).sum(axis=-1)).min() > SHARP:
        return rotations
    world, changed = world_rotations(rotations), False
    for name, axis in TWIST_AXES.items():
        joint = INDEX[name]
        own = np.ascontiguousarray(world[:, joint])
        turned = multiply(own, from_vectors(np.pi * np.array(axis)))
        as_is, other = (np.abs((each[1:] * own[:-1]).sum(axis=-1)) for each in (own, turned))
        flips = (as_is < SHARP) & (other > as_is)
        if not flips.any():
            continue
        flipped = np.concatenate([[0], np.cumsum(flips)]) % 2 == 1
        flipped ^= flipped.mean() > 0.5
        world[flipped, joint] = turned[flipped]
        changed = True
    return continuous_signs(local_rotations(world)) if changed else rotations
