"""Recordings as motion matching reads them: without calibration poses, at one rate, and seen from a smooth root.

The root is a point on the ground under the hips and a heading, both smoothed over time: hips sway and turn about it, so
that it can be led along a path and turned while the sway stays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array
from motionlake.motion.calibration import recorded_range
from motionlake.motion.generation import FPS as FPS
from motionlake.motion.generation import SeedClip
from motionlake.motion.holds import held_ranges
from motionlake.motion.kinematics import continuous_signs, local_rotations, world_from_positions
from motionlake.motion.limbs import nearest_limbs
from motionlake.motion.quality.ends import check_ends
from motionlake.motion.quality.faults import Recording
from motionlake.motion.quality_config import QualityConfig
from motionlake.motion.resampling import resample
from motionlake.motion.rotations import from_vectors, multiply, turn_on_ground
from motionlake.motion.skeleton import FEET, body_length, facing
from scipy.ndimage import gaussian_filter1d

SMOOTH: Final = 6.0  # frames, of the root's place and heading
# A joint of a foot stands that is slower and lower than this: body lengths a second, body lengths above its lowest.
SLOW: Final = 0.45
LOW: Final = 0.05
LIFTED: Final = 0.01  # body lengths: a joint is lifted that is so much further above its lowest than a slow one
NEAR: Final = 0.035  # body lengths above its lowest: a joint of a foot that may bear the body
GROUND: Final = 0.05  # quantile of heights that counts as the lowest
SHORTEST: Final = 12  # frames of a piece


@dataclass(frozen=True)
class MatchingClip:
    """Recorded frames of one class.

    Attributes:
        clip: name of the clip.
        start: its frame that is the first of these.
        label: class.
        positions: [F, 21, 3] canonical joints, metres, y up.
        rotations: [F, 21, 4] local (w, x, y, z).
        rest_offsets: [21, 3] of the body, metres.
        fps: frames a second.
    """

    clip: str
    start: int
    label: str
    positions: Float64Array
    rotations: Float64Array
    rest_offsets: Float64Array
    fps: float


@dataclass(frozen=True)
class RootedMotion:
    """T frames at 30 a second seen from the root. Lengths are in body lengths (`skeleton.body_length`).

    Attributes:
        rotations: [T, 21, 4] local; the hips' are relative to the root's heading.
        hips: [T, 3] from the root: left, up from the ground, ahead.
        joints: [T, 21, 3] from the root, likewise.
        place: [T, 2] of the root on the ground (x, z).
        heading: [T] radians.
        stands: [T, 4] whether a joint of `FEET` stands.
        aloft: [T] frames for which no foot was near the ground; 0 while one is.
        ground: metres, height of the lowest toes.
    """

    rotations: Float64Array
    hips: Float64Array
    joints: Float64Array
    place: Float64Array
    heading: Float64Array
    stands: BoolArray
    aloft: Float64Array
    ground: float

    def __len__(self) -> int:
        return len(self.hips)

    def cut(self, start: int, stop: int) -> RootedMotion:
        """The frames [start, stop)."""
        own = slice(start, stop)
        return RootedMotion(
            self.rotations[own], self.hips[own], self.joints[own], self.place[own], self.heading[own],
            self.stands[own], self.aloft[own], self.ground,
        )  # fmt: skip


def seed_rotations(seed: SeedClip) -> Float64Array:
    """[F, 21, 4] local rotations of a seed clip; where it has none, those that its joints tell of."""
    if seed.rotations is not None:
        return seed.rotations
    return local_rotations(world_from_positions(np.ascontiguousarray(seed.positions, dtype=float)))


def sound_ranges(positions: Float64Array, rotations: Float64Array, fps: float) -> list[tuple[int, int]]:
    """Ranges of frames of a clip without calibration poses at its ends, cut where the body jumps or is held still."""
    first, last = recorded_range(positions, fps)
    found = check_ends(Recording(positions, continuous_signs(rotations), fps), QualityConfig())
    seams = [(fault.start + 1, fault.start + 1) for fault in found.faults if fault.kind == "seam"]
    held = [(start + 1, stop) for start, stop in held_ranges(positions, fps)]
    ranges, start = [], first
    for stop, again in sorted([*seams, *held]):
        if start < stop < last:
            ranges.append((start, stop))
        if stop < last:
            start = max(start, again)
    if start < last:
        ranges.append((start, last))
    return ranges or [(first, last)]


def longest_range(positions: Float64Array, rotations: Float64Array, fps: float) -> tuple[int, int]:
    """The longest of `sound_ranges`."""
    return max(sound_ranges(positions, rotations, fps), key=lambda pair: pair[1] - pair[0])


def rooted(
    positions: Float64Array, rotations: Float64Array | None, rest_offsets: Float64Array, fps: float
) -> RootedMotion:
    """Frames seen from the root.

    Args:
        positions: [F, 21, 3] canonical joints, metres, y up; two frames at least.
        rotations: [F, 21, 4] local; None: from the positions.
        rest_offsets: [21, 3] metres.
        fps: frames a second.
    """
    if rotations is None:
        rotations = local_rotations(world_from_positions(np.ascontiguousarray(positions, dtype=float)))
    rotations = nearest_limbs(np.asarray(positions, dtype=float), np.asarray(rotations, dtype=float), rest_offsets)
    local = resample(rotations, fps, FPS, spherical=True)
    # The joints as recorded, which a depth sensor's bones of changing length make others than forward kinematics does.
    world = resample(np.asarray(positions, dtype=float), fps, FPS) / body_length(rest_offsets)
    heading = _smooth(facing(world))
    place = _smooth(world[:, 0, [0, 2]])
    feet = world[:, FEET]
    ground = float(np.quantile(feet[:, [1, 3], 1].min(axis=1), GROUND))
    joints = seen_from(world, place, heading)
    joints[..., 1] -= ground
    local[:, 0] = multiply(about_y(-heading), local[:, 0])
    return RootedMotion(
        continuous_signs(local), joints[:, 0].copy(), joints, place, heading, standing(feet),
        aloft(feet), ground * body_length(rest_offsets),
    )  # fmt: skip


def seen_from(world: Float64Array, place: Float64Array, heading: Float64Array) -> Float64Array:
    """[T, J, 3] points as seen from roots at places [T, 2] that head [T] somewhere."""
    x, z = world[..., 0] - place[:, None, 0], world[..., 2] - place[:, None, 1]
    left, ahead = turn_on_ground(x, z, -heading[:, None])
    return np.stack([left, world[..., 1], ahead], axis=-1)


def about_y(angles: Float64Array) -> Float64Array:
    """Rotations [..., 4] about the vertical, radians."""
    up = np.zeros((*np.shape(angles), 3))
    up[..., 1] = angles
    return from_vectors(up)


def standing(feet: Float64Array) -> BoolArray:
    """[T, 4] of joints [T, 4, 3] of feet, body lengths at 30 frames a second: slow, low, and not lifted.

    Lone frames between standing ones count too. At the top of a small step a foot in place is slow and low: the other
    one bears the body then. A foot that swings by may be lower than the one that stands: no joint is lifted above it.
    """
    speed = np.linalg.norm(np.gradient(feet, axis=0), axis=-1) * FPS
    above = feet[..., 1] - np.quantile(feet[..., 1], GROUND, axis=0)
    still = (speed < SLOW) & (above < LOW)
    stands = still & (above < np.where(still, above, np.inf).min(axis=1, keepdims=True) + LIFTED)
    filled = stands.copy()
    filled[1:-1] |= stands[:-2] & stands[2:]
    return np.asarray(filled)


def aloft(feet: Float64Array) -> Float64Array:
    """[T] frames since one of the joints [T, 4, 3] of feet was near the ground: 0 while one is."""
    frames = np.arange(len(feet))
    down = np.where(clearance(feet) < 0, frames, -1)
    return np.asarray(frames - np.maximum(np.maximum.accumulate(down), 0), dtype=float)


def clearance(feet: Float64Array) -> Float64Array:
    """[T] of the lowest of the joints [T, 4, 3] of feet above where it counts as near the ground, body lengths."""
    lowest = np.quantile(feet[..., 1], GROUND, axis=0)
    lowest = np.tile(np.minimum(lowest[:2], lowest[2:]), 2)  # of ankles and of toes, both sides
    return np.asarray((feet[..., 1] - lowest).min(axis=1) - NEAR)


def _smooth(rows: Float64Array) -> Float64Array:
    """Rows [T, ...] smoothed over time; at the ends motion is taken to go on as it went."""
    reach = min(len(rows) - 1, round(3 * SMOOTH))
    width = [(reach, reach), *[(0, 0)] * (rows.ndim - 1)]
    padded = np.pad(rows, width, mode="reflect", reflect_type="odd") if reach else rows
    smoothed: Float64Array = gaussian_filter1d(padded, SMOOTH, axis=0)[reach : reach + len(rows)]
    return smoothed


def steps_of(motion: RootedMotion) -> Float64Array:
    """[T, 3] steps (left, ahead) and turn of the root to the next frame, a second; the last repeats."""
    steps, turns = np.diff(motion.place, axis=0), np.diff(motion.heading)
    left, ahead = turn_on_ground(steps[:, 0], steps[:, 1], -motion.heading[:-1])
    rows = np.stack([left, ahead, turns], axis=1) * FPS
    return np.concatenate([rows, rows[-1:]])
