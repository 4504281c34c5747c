"""Feet that stand neither slide nor sink: hips settle on them, and hip, knee and ankle take what is left."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array, FloatArray, Int64Array
from motionlake.matching.flat_feet import flat, pitch, turned, while_held
from motionlake.matching.flights import too_long
from motionlake.matching.legs import bring_foot
from motionlake.matching.recordings import NEAR, SLOW
from motionlake.motion.features import change_a_frame
from motionlake.motion.generation import FPS
from motionlake.motion.kinematics import forward_kinematics, local_rotations, world_rotations
from motionlake.motion.skeleton import FEET, INDEX
from motionlake.motion.standing import SIDES, staying
from motionlake.motion.two_bones import level_ahead
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

SETTLE: Final = 4.0  # frames over which the body settles
SMOOTH: Final = 1.0  # frames
FAR: Final = 0.2  # body lengths that a foot is held back while it stands, at most
LOWEST: Final = 0.015  # body lengths that this is below the ground, at most
SINKS: Final = 0.005  # likewise a foot, rather than that it bends its knee
DEEP: Final = 0.005  # metres below the ground, or too high above it, from which on the whole body is moved
HIGH: Final = 0.03  # body lengths above the ground of a foot that was near it as recorded, at most
FLOOR: Final = 15.0  # frames: half-life of what given feet stood on above the ground, or below it
EASE: Final = 8  # frames after given ones in which the body begins to settle
BLEND: Final = 5  # frames over which a foot comes to where it stands, and leaves it
SITS: Final = 0.12  # body lengths that the hips of one who sits or lies are above where toes stand, at most
KNEELS: Final = 0.06  # likewise a knee that is on the ground
UPRIGHT: Final = 0.5  # of the greatest height of the hips
OTHERS: Final = [joint for joint in INDEX.values() if joint not in FEET]


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

    @property
    def toes(self) -> float:
        """Metres of toes where they stand: the ground of all other joints."""
        return float(self.lowest[1::2].min())


def on_ground(
    hips: Float64Array,
    rotations: Float64Array,
    rest_offsets: Float64Array,
    stands: BoolArray,
    soles: Soles,
    size: float,
    near: BoolArray | None = None,
    longest: Float64Array | None = None,
) -> tuple[Float64Array, Float64Array]:
    """A motion whose feet stand on the ground where they stand, neither sliding nor below it, nor any other joint.

    Args:
        hips: [T, 3] metres.
        rotations: [T, 21, 4] local.
        rest_offsets: [21, 3] metres.
        stands: [T, 4] of `FEET`.
        soles: how they stand.
        size: metres of a body length.
        near: [T] whether a foot was near the ground as recorded: there a join lifts the body by no more than `HIGH`.
        longest: [T, L] frames for which a body may be off the ground (`flights.too_long`): a longer flight, as one that
            is joined of two, is lowered.

    Returns:
        Hips [T, 3] and local rotations [T, 21, 4].
    """
    given = _given(soles, len(hips))
    rotations = flat(hips, rotations, rest_offsets, stands, soles.lowest, size, 1 - given)
    # The floor of a recording is not even: what the given feet stand on passes into the ground.
    floor = max(soles.floor or 0.0, -LOWEST * size) * np.exp(-math.log(2) / FLOOR * np.arange(len(hips)))
    moved = hips.copy()
    moved[:, 1] -= _body_settled(forward_kinematics(hips, rotations, rest_offsets), stands, soles, floor, size, given)
    planted = feet_planted(moved, rotations, rest_offsets, stands, soles, floor, size)
    joints = forward_kinematics(moved, planted, rest_offsets)
    lifted = _lifted(joints, soles, floor, size, given)
    lowered = np.zeros(len(hips)) if near is None else _lowered(joints, lifted, soles, floor, size, near, longest)
    if max(lifted.max(), lowered.max()) < DEEP:
        return moved, planted
    moved[:, 1] += lifted - lowered
    return moved, feet_planted(moved, rotations, rest_offsets, stands, soles, floor, size)


def _body_settled(
    joints: Float64Array, stands: BoolArray, soles: Soles, floor: Float64Array, size: float, given: Float64Array
) -> Float64Array:
    """[T] metres by which a body of joints [T, 21, 3] is lowered onto what stands, or raised out of the ground."""
    above = joints[:, FEET, 1] - soles.lowest - floor[:, None]
    stands = stands & ~np.repeat(_rests(joints, soles, size), 2, axis=1)
    settled = _settled(above, _bearing(joints, above, stands, size), SETTLE)
    settled -= given * settled[0]
    # Where both feet are below the ground the body is too low, and both knees would bend.
    higher = (above - settled[:, None]).reshape(-1, 2, 2).min(axis=2).max(axis=1)
    settled -= _rising(-higher) * (1 - given)
    return settled - _sunk(joints, soles, size, given, settled)


def _bearing(joints: Float64Array, above: Float64Array, stands: BoolArray, size: float) -> BoolArray:
    """[T, 4] which joints of feet bear a body of joints [T, 21, 3]: those that stand, and slow ones that are lower.

    What is recorded a little above the other foot, so that it does not stand, is the lower one on another body.
    """
    slow = np.linalg.norm(change_a_frame(joints[:, FEET])[..., [0, 2]], axis=-1) * FPS < SLOW * size
    lowest = np.where(stands, above, np.inf).min(axis=1, keepdims=True)
    return np.asarray(stands | (slow & np.isfinite(lowest) & (above < lowest)))


def _lifted(joints: Float64Array, soles: Soles, floor: Float64Array, size: float, given: Float64Array) -> Float64Array:
    """[T] metres by which a body of joints [T, 21, 3] is lifted, so that no joint is below the ground."""
    feet = joints[:, FEET, 1] - soles.lowest
    deep = np.maximum(0.0, (np.minimum(floor, 0.0)[:, None] - SINKS * size - feet).max(axis=1))
    return np.maximum(_spread(deep, SMOOTH), _sunk(joints, soles, size, given))


def _lowered(
    joints: Float64Array, lifted: Float64Array, soles: Soles, floor: Float64Array, size: float, near: BoolArray,
    longest: Float64Array | None,
) -> Float64Array:  # fmt: skip
    """[T] metres by which a body of joints [T, 21, 3] that was lifted is lowered: onto the ground, not into it."""
    lowest = (joints[:, FEET, 1] - soles.lowest).min(axis=1) + lifted - floor
    lowered = _spread(_high(lowest, floor, size, near, longest), SMOOTH)
    lowered = np.minimum(lowered, np.maximum(0.0, lowest))
    room = np.maximum(0.0, _lowest_of_others(joints, soles) + lifted)
    return np.asarray(np.maximum(0.0, lowered - _spread(np.maximum(0.0, lowered - room), SETTLE)))


def _rests(joints: Float64Array, soles: Soles, size: float) -> BoolArray:
    """[T, 2] whether the left and the right foot of joints [T, 21, 3] bear nothing: one sits, lies, or kneels on it."""
    low = joints[..., 1] - soles.toes
    kneels = low[:, [INDEX[f"{side}_knee"] for side in SIDES]] < KNEELS * size
    return np.asarray(kneels | (low[:, [INDEX["hips"]]] < SITS * size))


def _lowest_of_others(joints: Float64Array, soles: Soles) -> Float64Array:
    """[T] metres that the lowest joint of no foot, of joints [T, 21, 3], is above where toes stand."""
    return np.asarray(joints[:, OTHERS, 1].min(axis=1) - soles.toes)


def _sunk(
    joints: Float64Array, soles: Soles, size: float, given: Float64Array, settled: Float64Array | float = 0.0
) -> Float64Array:
    """[T] metres by which a body that is settled is raised, so that no knee, hip or hand is below the ground."""
    sunk = _spread(np.maximum(0.0, settled - LOWEST * size - _lowest_of_others(joints, soles)), SETTLE)
    return np.asarray(sunk - given * sunk[0])


def _fading(frames: FloatArray | Int64Array, count: int) -> Float64Array:
    """[T] from 1 to 0 within so many frames."""
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * np.clip(frames / count, 0, 1)))


def _given(soles: Soles, count: int) -> Float64Array:
    """[T] how much of what is changed must not jump from the given frames: from 1 to 0, where there are any."""
    return np.zeros(count) if soles.floor is None else _fading(np.arange(count), EASE)


def _spread(metres: Float64Array, frames: float) -> Float64Array:
    """[T] a change that the whole body takes part in, over some frames more."""
    return np.asarray(gaussian_filter1d(maximum_filter1d(metres, round(4 * frames) + 1), frames))


def _high(
    lowest: Float64Array, floor: Float64Array, size: float, near: BoolArray, longest: Float64Array | None
) -> Float64Array:
    """[T] metres by which a body is lowered whose lowest foot is so high [T] above a floor [T]: to `HIGH` above the
    ground where a foot was near it as recorded, and in flights that are longer than `longest` [T, L].
    """
    down = np.where(near, np.maximum(0.0, lowest - np.maximum(0.0, HIGH * size - floor)), 0.0)
    return down if longest is None else np.maximum(down, size * too_long(lowest / size - NEAR, longest))


def feet_planted(
    hips: Float64Array, rotations: Float64Array, rest_offsets: Float64Array, stands: BoolArray, soles: Soles,
    floor: Float64Array, size: float,
) -> Float64Array:  # fmt: skip
    """Local rotations [T, 21, 4] by which hips, knees and ankles bring the feet where they belong.

    Args:
        hips, rotations, rest_offsets, stands, soles, size: as of `on_ground`.
        floor: [T] metres of the ground above where the feet stand.
    """
    joints = forward_kinematics(hips, rotations, rest_offsets)
    world = world_rotations(rotations)
    ahead = level_ahead(joints[:, INDEX["left_hip"]], joints[:, INDEX["right_hip"]])
    bears = gaussian_filter1d(1.0 - _rests(joints, soles, size), SETTLE, axis=0)
    for i, side in enumerate(SIDES):
        hip, knee, ankle, toe = (INDEX[f"{side}_{part}"] for part in ("hip", "knee", "ankle", "toe"))
        foot, own = joints[:, [ankle, toe]], stands[:, 2 * i : 2 * i + 2]
        standing = np.asarray(own.any(axis=1))
        change = staying(foot, standing, FAR * size, BLEND)
        above = foot[..., 1] - soles.lowest[2 * i : 2 * i + 2] - floor[:, None]
        down = -_settled(above, own, SMOOTH) * bears[:, i]
        up = turned(_rising(-(above[:, 1] + down)), rest_offsets[toe], size, 1 - _given(soles, len(hips)))
        # Never below the ground: the toes are turned up, the foot is lifted by what is left.
        raised = down + _rising(-np.minimum(above[:, 0], above[:, 1] + up) - down)
        # By the last millimetres out of the ground a leg that is nearly straight would bend by ten degrees.
        change[:, 1] = np.minimum(raised, np.maximum(0.0, raised - SINKS * size))
        if soles.floor is not None:
            change = _from_given(change, standing)
        leg = (joints[:, hip], joints[:, knee], joints[:, ankle])
        pointed = pitch(world, ankle, foot[:, 1] - foot[:, 0], up)
        bring_foot(world, (hip, knee, ankle), leg, foot[:, 0] + change, pointed, own[:, 0], ahead)
    return local_rotations(world)


def _from_given(change: Float64Array, standing: BoolArray) -> Float64Array:
    """Changes [T, 3] of a foot that begin with none: a foot that stands stays where the given frames have it."""
    first = len(standing) if standing.all() else int(np.argmin(standing))
    frames = np.arange(len(change))
    begun = change - _fading(frames - max(0, first - 1), BLEND)[:, None] * change[0] * np.array([1.0, 0.0, 1.0])
    begun[:, 1] -= _fading(frames, BLEND) * change[0, 1]
    return np.asarray(begun)


def _settled(above: Float64Array, stands: BoolArray, frames: float) -> Float64Array:
    """[T] by which standing joints are too high, of heights [T, 4 or 2] above where they stand: the lowest bears."""
    held = np.asarray(stands.any(axis=1))
    return while_held(np.where(stands, above, np.inf).min(axis=1, initial=np.inf), held, frames)


def _rising(metres: Float64Array) -> Float64Array:
    """[T] of metres those above 0, smoothed upwards."""
    above = np.maximum(0.0, metres)
    return np.asarray(np.maximum(above, gaussian_filter1d(above, SMOOTH)))


def heights_standing(joints: Float64Array, ground: float) -> Float64Array:
    """[4] heights over the ground of the joints of `FEET` of a body's frames [F, 21, 3], where they are lowest.

    Where a body is upright an ankle that is below its toes does not stand: depth sensors lose ankles.
    """
    feet, hips = (joints[:, FEET, 1] - ground).reshape(-1, 2, 2), joints[:, INDEX["hips"], 1] - ground
    stands = (feet[..., 0] >= feet[..., 1]) | (hips < UPRIGHT * hips.max())[:, None]
    ankles = np.where(stands | ~stands.any(axis=0), feet[..., 0], np.nan)
    lowest = np.nanquantile(np.stack([ankles, feet[..., 1]], axis=-1), 0.05, axis=0)
    return np.asarray(np.tile(lowest.min(axis=0), 2))


def standing_above(pose: Float64Array, stands: BoolArray, lowest: Float64Array) -> float:
    """Metres by which the joints of `FEET` of a pose [21, 3] that stand [4] are higher than `lowest` [4]; 0 of none."""
    above = pose[FEET, 1] - lowest
    return float(above[stands].min(initial=np.inf)) if stands.any() else 0.0
