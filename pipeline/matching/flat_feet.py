"""Feet that are turned at the ankle: those of another body, which point otherwise, are flat where they stand."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array
from motionlake.motion.kinematics import forward_kinematics, local_rotations, world_rotations
from motionlake.motion.rotations import multiply, swing
from motionlake.motion.skeleton import INDEX
from motionlake.motion.standing import SIDES
from scipy.ndimage import gaussian_filter1d

STEEP: Final = 0.95  # of a foot's length, by which toes are above or below the ankle at most
LEAST: Final = 0.05  # weight of no standing foot
TURN: Final = 0.4  # of a foot's length, by which its toes are turned up or down at most, to be flat
UNEVEN: Final = 0.005  # body lengths that the toes of a foot on the ground may be lower or higher than the ankle
SLOWLY: Final = 4.0  # frames over which a foot is turned


def flat(
    hips: Float64Array, rotations: Float64Array, rest_offsets: Float64Array, stands: BoolArray, lowest: Float64Array,
    size: float, share: Float64Array,
) -> Float64Array:  # fmt: skip
    """Local rotations [T, 21, 4] by which a foot that stands on ankle and toe is flat.

    Toes that point down, above all a depth sensor's, were below the ground, and the knee bent to lift them.

    Args:
        hips: [T, 3] metres.
        rotations: [T, 21, 4] local.
        rest_offsets: [21, 3] metres.
        stands: [T, 4] of `skeleton.FEET`.
        lowest: [4] metres of these joints where a foot is flat.
        size: metres of a body length.
        share: [T] of the turn, 0 to 1.
    """
    joints, world = forward_kinematics(hips, rotations, rest_offsets), world_rotations(rotations)
    for i, side in enumerate(SIDES):
        ankle, toe = INDEX[f"{side}_ankle"], INDEX[f"{side}_toe"]
        above = joints[:, [ankle, toe], 1] - lowest[2 * i : 2 * i + 2]
        held = np.asarray(stands[:, 2 * i : 2 * i + 2].all(axis=1))
        lower = while_held(above[:, 0] - above[:, 1], held, SLOWLY)
        up = np.sign(lower) * turned(np.abs(lower), rest_offsets[toe], size, share)
        foot = joints[:, toe] - joints[:, ankle]
        # A foot that leaves the ground gets steep: turned by as much, its toes get less far up.
        level = np.sqrt(np.maximum(np.sum(rest_offsets[toe] ** 2) - (lowest[2 * i] - lowest[2 * i + 1]) ** 2, 1e-9))
        pitch(world, ankle, foot, up * np.where(held, 1.0, np.minimum(1.0, np.hypot(foot[:, 0], foot[:, 2]) / level)))
    return local_rotations(world)


def turned(off: Float64Array, foot: Float64Array, size: float, share: Float64Array) -> Float64Array:
    """[T] metres by which the toes of a foot [3] are turned that are off [T] where they would be flat."""
    return np.asarray(share * np.clip(off - UNEVEN * size, 0.0, TURN * np.linalg.norm(foot)))


def pitch(world: Float64Array, ankle: int, toe: Float64Array, up: Float64Array) -> Float64Array:
    """Turn feet in place; the toes [T, 3] from the ankle afterwards.

    Args:
        world: [T, 21, 4] rotations of joints in the world.
        ankle: its number.
        toe: [T, 3] from the ankle, as the foot is turned.
        up: [T] metres that the toes are higher afterwards, or lower; no foot is steeper than `STEEP` by it.

    Where a steep foot points is mostly noise: toes get further off by it in the direction that they have for longer.
    """
    length = np.linalg.norm(toe, axis=1)
    level = np.linalg.norm(toe[:, [0, 2]], axis=1)
    pointed, steepest = toe.copy(), STEEP * length
    pointed[:, 1] = np.clip(toe[:, 1] + up, np.minimum(-steepest, toe[:, 1]), np.maximum(steepest, toe[:, 1]))
    room = np.sqrt(np.maximum(length**2 - pointed[:, 1] ** 2, 0.0))
    way = gaussian_filter1d(toe[:, [0, 2]], SLOWLY, axis=0)
    way *= (np.maximum(0.0, room - level) / np.maximum(np.linalg.norm(way, axis=1), 1e-9))[:, None]
    further = toe[:, [0, 2]] + way
    pointed[:, [0, 2]] = further * (room / np.maximum(np.linalg.norm(further, axis=1), 1e-9))[:, None]
    world[:, ankle] = multiply(swing(toe, pointed), np.ascontiguousarray(world[:, ankle]))
    return pointed


def while_held(off: Float64Array, held: BoolArray, frames: float) -> Float64Array:
    """[T] what is off while it is held [T], passed on to frames about it."""
    spread: Float64Array = gaussian_filter1d(np.where(held, off, 0.0), frames)
    return np.asarray(spread / (gaussian_filter1d(held.astype(float), frames) + LEAST))
