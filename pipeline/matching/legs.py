"""Legs that bring an ankle to a place: knees keep to their side, and the heel is raised before a knee is stretched."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array
from motionlake.motion.rotations import multiply, swing
from motionlake.motion.two_bones import AHEAD, REACH, across, bent, turn_leg
from scipy.ndimage import gaussian_filter1d

STRAIGHT: Final = 0.2  # of a thigh, by which a knee is to a side: one that is less bends as in the frames about it
STRETCH: Final = 0.5  # of what a leg lacks to be straight, by which it is stretched where only its toes stand
SMOOTH: Final = 4.0  # frames about one, of either


def bring_foot(
    world: Float64Array, leg: tuple[int, int, int], at: tuple[Float64Array, Float64Array, Float64Array],
    wanted: Float64Array, toe: Float64Array, flat: BoolArray, ahead: Float64Array,
) -> None:  # fmt: skip
    """Turn hip, knee and ankle, in place, so that an ankle comes to a place and its toes to where they would be then.

    Args:
        world: [T, 21, 4] rotations of joints in the world.
        leg: numbers of hip, knee and ankle.
        at: [T, 3] of each, metres.
        wanted: [T, 3] of the ankle.
        toe: [T, 3] from the ankle, as the foot is turned.
        flat: [T] whether the ankle stands too: then the leg is as long as it can be before the heel is raised.
        ahead: [T, 3] where the body faces, level.
    """
    hip, knee, ankle = leg
    toes = wanted + toe
    bends = bent(*at, _raised(*at, wanted, toes, flat), _side(*at, ahead), STRAIGHT)
    turn_leg(world, (hip, knee), at, *bends)
    world[:, ankle] = multiply(swing(toe, toes - bends[1]), np.ascontiguousarray(world[:, ankle]))


def _raised(
    hip: Float64Array, knee: Float64Array, ankle: Float64Array, wanted: Float64Array, toes: Float64Array,
    flat: BoolArray,
) -> Float64Array:  # fmt: skip
    """[T, 3] where the ankle comes to: where it is wanted, or, where the leg is too short for it, up about the toes.

    A knee that is stretched and bent again within some frames snaps.
    """
    own, line = np.linalg.norm(ankle - hip, axis=1), toes - hip
    longest = np.maximum(REACH * (np.linalg.norm(knee - hip, axis=1) + np.linalg.norm(ankle - knee, axis=1)), own)
    share = STRETCH + (1 - STRETCH) * gaussian_filter1d(flat.astype(float), SMOOTH)
    reach = own + share * (longest - own)
    foot, far = np.linalg.norm(wanted - toes, axis=1), np.maximum(np.linalg.norm(line, axis=1), 1e-9)
    along = line / far[:, None]
    # Of the circle of places at both distances the one that is nearest.
    part = np.clip((reach**2 - foot**2 + far**2) / (2 * far), -reach, reach)
    off = _unit(across(wanted - hip, along))
    raised = hip + part[:, None] * along + np.sqrt(np.maximum(reach**2 - part**2, 0.0))[:, None] * off
    return np.where((np.linalg.norm(wanted - hip, axis=1) > reach)[:, None], raised, wanted)


def _side(hip: Float64Array, knee: Float64Array, ankle: Float64Array, ahead: Float64Array) -> Float64Array:
    """[T, 3] to which side a knee is bent in the frames about one, the more the more it is bent; else ahead."""
    thigh = knee - hip
    out = across(thigh, _unit(ankle - hip)) + AHEAD * np.linalg.norm(thigh, axis=1, keepdims=True) * ahead
    return _unit(gaussian_filter1d(out, SMOOTH, axis=0))


def _unit(vectors: Float64Array) -> Float64Array:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9))
