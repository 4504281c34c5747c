"""Feet that stand neither slide nor sink: hips settle on them, and hip, knee and ankle take what is left."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array
from motionlake.matching.recordings import FEET
from motionlake.motion.kinematics import forward_kinematics, local_rotations, world_rotations
from motionlake.motion.rotations import multiply, swing
from motionlake.motion.skeleton import INDEX
from motionlake.motion.standing import SIDES, staying
from motionlake.motion.two_bones import bent, level_ahead, turn_leg
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

SETTLE: Final = 4.0  # frames over which the body settles
SMOOTH: Final = 1.5  # frames
FAR: Final = 0.2  # body lengths that a foot is held back while it stands, at most
LOWEST: Final = 0.015  # body lengths that this is below the ground, at most
DEEP: Final = 0.005  # metres below the ground, or too high above it, from which on the whole body is moved
HIGH: Final = 0.03  # body lengths above the ground of a foot that was near it as recorded, at most
STEEP: Final = 0.95  # of a foot's length, by which the toes of one on tiptoe are below the ankle at most
LEAST: Final = 0.05  # weight of no standing foot
FLOOR: Final = 15.0  # frames: half-life of what given feet stood on above the ground, or below it
EASE: Final = 8  # frames after given ones in which the body begins to settle
BLEND: Final = 5  # frames over which a foot comes to where it stands, and leaves it


@dataclass(frozen=True)
class Soles:
    """How a body of four joints of the feet (`FEET`) stands.

    Attributes:
        lowest: [4] metres of each where it stands flat.
        floor: metres by which the feet of the given frames stand higher than that; None: the motion goes on from none,
            so that nothing must not jump.
    """

    lowest: Float64Array
    floor: float | None = None


def on_ground(
    hips: Float64Array,
    rotations: Float64Array,
    rest_offsets: Float64Array,
    stands: BoolArray,
    soles: Soles,
    size: float,
    near: BoolArray | None = None,
) -> tuple[Float64Array, Float64Array]:
    """A motion whose feet stand on the ground where they stand, neither sliding nor below it.

    Args:
        hips: [T, 3] metres.
        rotations: [T, 21, 4] local.
        rest_offsets: [21, 3] metres.
        stands: [T, 4] of `FEET`.
        soles: how they stand.
        size: metres of a body length.
        near: [T] whether a foot was near the ground as recorded: there a join lifts the body by no more than `HIGH`.

    Returns:
        Hips [T, 3] and local rotations [T, 21, 4].
    """
    feet = forward_kinematics(hips, rotations, rest_offsets)[:, [INDEX[name] for name in FEET], 1]
    above = feet - soles.lowest
    frames = np.arange(len(hips))
    # The floor of a recording is not even: what the given feet stand on passes into the ground.
    floor = max(soles.floor or 0.0, -LOWEST * size) * np.exp(-math.log(2) / FLOOR * frames)
    settled = _settled(above - floor[:, None], stands, SETTLE)
    begun = np.ones(len(hips)) if soles.floor is None else 0.5 - 0.5 * np.cos(np.pi * np.clip(frames / EASE, 0, 1))
    settled *= begun
    moved = hips.copy()
    moved[:, 1] -= settled
    planted = _planted(moved, rotations, rest_offsets, stands, soles, floor, size)
    sunk = _sunk(moved, planted, rest_offsets, soles.lowest + np.minimum(floor, 0.0)[:, None])
    high = _floating(moved, planted, rest_offsets, soles.lowest + floor[:, None] + HIGH * size, near)
    if max(sunk.max(), high.max()) < DEEP:
        return moved, planted
    moved[:, 1] += _spread(sunk) - _spread(high) * begun
    return moved, _planted(moved, rotations, rest_offsets, stands, soles, floor, size)


def _spread(metres: Float64Array) -> Float64Array:
    """[T] a change that the whole body takes part in, over some frames more."""
    return np.asarray(gaussian_filter1d(maximum_filter1d(metres, round(4 * SMOOTH) + 1), SMOOTH))


def _floating(
    hips: Float64Array, rotations: Float64Array, rest_offsets: Float64Array, highest: Float64Array,
    near: BoolArray | None,
) -> Float64Array:  # fmt: skip
    """[T] metres by which all feet are higher than `highest` [T, 4] where one was near the ground as recorded."""
    if near is None:
        return np.zeros(len(hips))
    feet = forward_kinematics(hips, rotations, rest_offsets)[:, [INDEX[name] for name in FEET], 1]
    return np.where(near, np.maximum(0.0, (feet - highest).min(axis=1)), 0.0)


def _sunk(
    hips: Float64Array, rotations: Float64Array, rest_offsets: Float64Array, lowest: Float64Array
) -> Float64Array:
    """[T] metres by which a foot is below the ground for all that a leg can bend."""
    feet = forward_kinematics(hips, rotations, rest_offsets)[:, [INDEX[name] for name in FEET], 1]
    return np.asarray(np.maximum(0.0, (lowest - feet).max(axis=1)))


def _planted(
    hips: Float64Array, rotations: Float64Array, rest_offsets: Float64Array, stands: BoolArray, soles: Soles,
    floor: Float64Array, size: float,
) -> Float64Array:  # fmt: skip
    """Local rotations by which hips, knees and ankles bring the feet where they belong; `floor` [T] metres of it."""
    joints = forward_kinematics(hips, rotations, rest_offsets)
    world = world_rotations(rotations)
    ahead = level_ahead(joints[:, INDEX["left_hip"]], joints[:, INDEX["right_hip"]])
    for i, side in enumerate(SIDES):
        hip, knee, ankle, toe = (INDEX[f"{side}_{part}"] for part in ("hip", "knee", "ankle", "toe"))
        foot, own = joints[:, [ankle, toe]], stands[:, 2 * i : 2 * i + 2]
        standing = np.asarray(own.any(axis=1))
        change = staying(foot, standing, FAR * size, BLEND)
        change[:, 1] = _upright(foot[..., 1] - soles.lowest[2 * i : 2 * i + 2] - floor[:, None], own)
        if soles.floor is not None:
            change = _from_given(change, standing)
        leg = (joints[:, hip], joints[:, knee], joints[:, ankle])
        wanted = foot[:, 0] + change
        bends = bent(*leg, wanted, ahead)
        turn_leg(world, (hip, knee), leg, *bends)
        _tiptoe(world, ankle, foot[:, 1] - foot[:, 0], bends[1][:, 1] - wanted[:, 1])
    return local_rotations(world)


def _tiptoe(world: Float64Array, ankle: int, toe: Float64Array, lifted: Float64Array) -> None:
    """Point feet down, in place, whose ankles are lifted since their legs are too short: toes stay where they stand.

    Args:
        world: [T, 21, 4] rotations of joints in the world.
        ankle: its number.
        toe: [T, 3] from the ankle, as the foot is turned.
        lifted: [T] metres that the ankle is higher than wanted.
    """
    length = np.linalg.norm(toe, axis=1)
    down = np.maximum(toe[:, 1] - np.maximum(lifted, 0.0), -STEEP * length)
    level = np.linalg.norm(toe[:, [0, 2]], axis=1)
    pointed = toe.copy()
    pointed[:, 1] = np.minimum(down, toe[:, 1])
    room = np.sqrt(np.maximum(length**2 - pointed[:, 1] ** 2, 0.0))
    pointed[:, [0, 2]] *= (room / np.maximum(level, 1e-9))[:, None]
    world[:, ankle] = multiply(swing(toe, pointed), np.ascontiguousarray(world[:, ankle]))


def _from_given(change: Float64Array, standing: BoolArray) -> Float64Array:
    """Changes [T, 3] of a foot that begin with none: a foot that stands stays where the given frames have it."""
    first = len(standing) if standing.all() else int(np.argmin(standing))
    frames = np.arange(len(change))
    after = np.clip((frames - max(0, first - 1)) / BLEND, 0, 1)
    begun = change - (0.5 + 0.5 * np.cos(np.pi * after))[:, None] * change[0] * np.array([1.0, 0.0, 1.0])
    begun[:, 1] *= np.clip(frames / BLEND, 0, 1)
    return np.asarray(begun)


def _settled(above: Float64Array, stands: BoolArray, frames: float) -> Float64Array:
    """[T] by which standing joints are too high, of heights [T, 4 or 2] above where they stand: the lowest bears."""
    held = stands.any(axis=1)
    off = np.where(held, np.where(stands, above, np.inf).min(axis=1, initial=np.inf), 0.0)
    weight = held.astype(float)
    spread: Float64Array = gaussian_filter1d(off * weight, frames) / (gaussian_filter1d(weight, frames) + LEAST)
    return spread


def _upright(above: Float64Array, stands: BoolArray) -> Float64Array:
    """[T] by which a foot is moved up or down: onto the ground while it stands, never below it.

    Args:
        above: [T, 2] heights of ankle and toe above where they stand.
        stands: [T, 2].
    """
    down = -_settled(above, stands, SMOOTH)
    sunk = np.maximum(0.0, -(above + down[:, None]).min(axis=1))
    lift: Float64Array = down + np.maximum(sunk, gaussian_filter1d(sunk, SMOOTH))
    return lift


def heights_standing(joints: Float64Array, ground: float) -> Float64Array:
    """[4] heights over the ground of the joints of `FEET` of a body's frames [F, 21, 3], where they are lowest."""
    feet = joints[:, [INDEX[name] for name in FEET], 1] - ground
    lowest = np.quantile(feet, 0.05, axis=0)
    level: Float64Array = np.repeat(np.minimum(lowest[:2], lowest[2:])[None], 2, axis=0).ravel()
    return level


def standing_above(pose: Float64Array, stands: BoolArray, lowest: Float64Array) -> float:
    """Metres by which the joints of `FEET` of a pose [21, 3] that stand [4] are higher than `lowest` [4]; 0 of none."""
    above = pose[[INDEX[name] for name in FEET], 1] - lowest
    return float(above[stands].min(initial=np.inf)) if stands.any() else 0.0
