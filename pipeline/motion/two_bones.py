"""Legs that bend so that an ankle comes to a place: inverse kinematics of two bones."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.rotations import multiply, swing

REACH: Final = 0.999  # of a leg's length
AHEAD: Final = 0.02  # of a thigh: a leg whose knee is less to a side is straight, and bends ahead
UP: Final = np.array([0.0, 1.0, 0.0])
SIDE: Final = np.array([1.0, 0.0, 0.0])


def level_ahead(left_hip: Float64Array, right_hip: Float64Array) -> Float64Array:
    """[T, 3] where a body of such hip joints [T, 3] faces, level."""
    ahead = np.cross(left_hip - right_hip, UP)
    level: Float64Array = ahead / np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-9)
    return level


def bent(
    hip: Float64Array,
    knee: Float64Array,
    ankle: Float64Array,
    wanted: Float64Array,
    ahead: Float64Array,
    straight: float = AHEAD,
) -> tuple[Float64Array, Float64Array]:
    """Knees and ankles [T, 3] of legs whose ankles come to `wanted`, or as near to it as the legs are long.

    A knee stays on the side of the leg where it is; that of a leg which is as `straight` as that (share of a thigh by
    which the knee is to a side) bends towards `ahead`.
    """
    thigh, shin = np.linalg.norm(knee - hip, axis=1), np.linalg.norm(ankle - knee, axis=1)
    line = wanted - hip
    length = np.linalg.norm(line, axis=1)
    along = line / np.maximum(length, 1e-9)[:, None]
    # Not quite straight, for knees snap into that; but a leg that was straighter may stay so.
    longest = np.maximum(REACH * (thigh + shin), np.linalg.norm(ankle - hip, axis=1))
    length = np.clip(length, np.abs(thigh - shin), np.minimum(longest, thigh + shin))
    out = across(knee - hip, along)
    # A leg that points ahead bends upwards; where it is not known what is ahead, to a side.
    for towards, least in ((ahead, straight), (UP, AHEAD), (SIDE, AHEAD)):
        missing = np.maximum(0, least * thigh - np.linalg.norm(out, axis=1))
        out += missing[:, None] * across(np.broadcast_to(towards, hip.shape), along)
    out /= np.maximum(np.linalg.norm(out, axis=1), 1e-9)[:, None]
    share = (thigh**2 - shin**2 + length**2) / (2 * np.maximum(length, 1e-9))
    height = np.sqrt(np.maximum(thigh**2 - share**2, 0))
    return hip + share[:, None] * along + height[:, None] * out, hip + length[:, None] * along


def turn_leg(
    world: Float64Array,
    leg: tuple[int, int],
    before: tuple[Float64Array, Float64Array, Float64Array],
    knee: Float64Array,
    ankle: Float64Array,
) -> None:
    """Turn hip and knee, in place, so that a leg goes where `bent` has it; the foot keeps how it is turned.

    Args:
        world: [T, 21, 4] rotations of joints in the world.
        leg: numbers of hip and knee.
        before: [T, 3] hip, knee and ankle as they are.
        knee: [T, 3] where it comes to.
        ankle: [T, 3] likewise.
    """
    hip, old_knee, old_ankle = before
    for joint, old, new in ((leg[0], old_knee - hip, knee - hip), (leg[1], old_ankle - old_knee, ankle - knee)):
        world[:, joint] = multiply(swing(old, new), np.ascontiguousarray(world[:, joint]))


def across(vectors: Float64Array, along: Float64Array) -> Float64Array:
    """[T, 3] what of vectors is at right angles to directions."""
    rest: Float64Array = vectors - (vectors * along).sum(axis=1, keepdims=True) * along
    return rest
