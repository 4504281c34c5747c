"""A motion as generators read and give it: poses seen from the body, and beside them how the body gets about.

Section 4.3.2 of the thesis normalises bones, moves the pelvis to the origin and takes out which way the body faces.
What it drops thereby is kept here as numbers of their own: height, velocity and turning of the root, and which foot
stands, so that a motion can be put back into the world.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.glogen.feet import planted
from motionlake.motion.generation import FPS as FPS
from motionlake.motion.kinematics import forward_kinematics, local_rotations, world_from_positions
from motionlake.motion.resampling import interpolated
from motionlake.motion.rotations import turn_about_y, turn_on_ground
from motionlake.motion.skeleton import (
    FEET,
    INDEX,
    JOINTS,
    LENGTH_JOINTS,
    LENGTH_SHARES,
    MIRRORED_JOINTS,
    body_length,
    facing,
)
from scipy.ndimage import gaussian_filter1d
from scipy.signal import savgol_filter

# Offsets of joints from their parents in the canonical rest pose, of an average body, in body lengths: a body length
# is a leg and a torso, from ankle over knee to hip and from the root over spine and chest to the neck.
_OFFSETS: Final[dict[str, tuple[float, float, float]]] = {
    "spine": (0, 0.12, 0), "chest": (0, 0.12, 0), "neck": (0, 0.12, 0), "head": (0, 0.12, 0),
    "left_clavicle": (0.03, 0.08, 0), "left_shoulder": (0.11, 0, 0), "left_elbow": (0.22, 0, 0),
    "left_wrist": (0.19, 0, 0), "left_hip": (0.075, -0.03, 0), "left_knee": (0, -0.33, 0),
    "left_ankle": (0, -0.31, 0), "left_toe": (0, 0, 0.1),
}  # fmt: skip


def _mirrored(name: str) -> tuple[float, float, float]:
    x, y, z = _OFFSETS[name.replace("right_", "left_")]
    return (-x, y, z)


STANDARD: Final[Float64Array] = np.array(
    [(0, 0, 0), *(_OFFSETS.get(name) or _mirrored(name) for name in JOINTS[1:])], dtype=float
)


def measured_length(positions: Float64Array) -> float:
    """Leg and torso of a body as its joints [F, 21, 3] show them: medians over the frames."""
    parents = {"spine": "hips", "chest": "spine", "neck": "chest"}
    total = 0.0
    for name, share in zip(LENGTH_JOINTS, LENGTH_SHARES, strict=True):
        side, _, joint = name.partition("_")
        parent = parents.get(name) or f"{side}_{'hip' if joint == 'knee' else 'knee'}"
        bones = positions[:, INDEX[name]] - positions[:, INDEX[parent]]
        total += share * float(np.median(np.linalg.norm(bones, axis=1)))
    return total


def standard_joints(positions: Float64Array) -> Float64Array:
    """[F, 21, 3] the same poses by the standard skeleton, root at the origin, in body lengths.

    Bones point where they do in `positions` [F, 21, 3]; their lengths, and the shape of pelvis and shoulders, are the
    standard skeleton's.
    """
    return posed(positions, STANDARD, np.zeros((len(positions), 3)))[0]


def posed(positions: Float64Array, rest_offsets: Float64Array, root: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Poses by another body.

    Args:
        positions: [F, 21, 3] joints, whatever their bones' lengths.
        rest_offsets: [21, 3] of the body.
        root: [F, 3] where its hips are.

    Returns:
        Its joints [F, 21, 3], and local rotations [F, 21, 4] that give them by forward kinematics.
    """
    rotations = local_rotations(world_from_positions(np.ascontiguousarray(positions)))
    return forward_kinematics(root, rotations, rest_offsets), rotations


# As for descriptors: takes the jitter of depth sensors and hardly moves clean motion.
WINDOW: Final = 7
ORDER: Final = 3
JOINTS_GIVEN: Final = len(JOINTS) - 1  # all but the hips
# A foot stands that is slower and lower than this: body lengths a second, body lengths above its own lowest places.
SLOW: Final = 0.4
LOW: Final = 0.06
SETTLE: Final = 12.0  # frames, over which a body that floats is brought down
SMOOTH: Final = 2.0  # frames, of what a standing foot changes in how the root moves
# A foot stands as surely as this, not at all, or in between.
SURE: Final = 0.95
UNSURE: Final = 0.8
AWAY: Final = 0.025  # body lengths, from the ground, of feet that stand


@dataclass(frozen=True)
class BodyMotion:
    """T frames at 30 a second. Lengths are in body lengths (`body.body_length`), of the standard skeleton.

    Attributes:
        joints: [T, 20, 3] joints but the hips, from the hips, seen from the body: x left, y up, z forward.
        height: [T] of the hips above the ground.
        velocity: [T, 2] of the hips towards the next frame, to the left and forward, body lengths a second.
        turn: [T] change of the facing towards the next frame, radians a second, to the left.
        stands: [T, 2] how surely the left and the right foot stands, 0 to 1.
    """

    joints: Float64Array
    height: Float64Array
    velocity: Float64Array
    turn: Float64Array
    stands: Float64Array

    def __len__(self) -> int:
        return len(self.joints)

    def cut(self, start: int, stop: int) -> BodyMotion:
        """The frames [start, stop)."""
        return BodyMotion(*(each[start:stop] for each in vars(self).values()))

    @property
    def rows(self) -> Float64Array:
        """[T, 64] joints, height, velocity and turning."""
        joints = self.joints.reshape(len(self), -1)
        return np.concatenate([joints, self.height[:, None], self.velocity, self.turn[:, None]], axis=1)

    @classmethod
    def of_rows(cls, rows: Float64Array, stands: Float64Array) -> BodyMotion:
        """The motion of which `rows` are the rows."""
        end = 3 * JOINTS_GIVEN
        joints = rows[:, :end].reshape(len(rows), JOINTS_GIVEN, 3)
        return cls(joints, rows[:, end], rows[:, end + 1 : end + 3], rows[:, end + 3], stands)


def body_motion(positions: Float64Array, fps: float) -> BodyMotion:
    """A clip as generators read it.

    Args:
        positions: [F, 21, 3] canonical joints, metres, y up; two frames at least.
        fps: frames a second.

    Raises:
        ValueError: fewer than two frames, a body without length, or positions that are not finite.
    """
    if len(positions) < 2 or not np.isfinite(positions).all():
        raise ValueError("a motion needs two frames at least, and positions that are finite")
    sampled = resampled(positions.reshape(len(positions), -1), fps, FPS).reshape(-1, len(JOINTS), 3)
    if len(sampled) >= WINDOW:
        sampled = savgol_filter(sampled, WINDOW, ORDER, axis=0)
    size = measured_length(sampled)
    if size < 1e-6:
        raise ValueError("the body has no length")
    sampled = sampled / size
    yaw = facing(sampled)
    root = sampled[:, 0]
    feet = sampled[:, FEET]
    ground = np.quantile(feet[..., 1].min(axis=1), 0.05)
    return BodyMotion(
        turn_about_y(standard_joints(sampled), -yaw)[:, 1:],
        root[:, 1] - ground,
        turned_steps(_forward(root[:, [0, 2]]), -yaw) * FPS,
        _forward(yaw) * FPS,
        _standing(feet),
    )


def turned_steps(steps: Float64Array, yaw: Float64Array) -> Float64Array:
    """[n, 2] steps (left, forward) turned by yaw [n]."""
    return np.stack(turn_on_ground(steps[:, 0], steps[:, 1], yaw), axis=1)


def resampled(rows: Float64Array, fps: float, wanted: float) -> Float64Array:
    """[T, d] rows [F, d] at another rate, by linear interpolation; first and last stay."""
    count = max(2, round((len(rows) - 1) / fps * wanted) + 1)
    return interpolated(rows, np.linspace(0, len(rows) - 1, count))


def mirrored(motion: BodyMotion) -> BodyMotion:
    """The motion of the body reflected left to right."""
    order = [joint - 1 for joint in MIRRORED_JOINTS[1:]]
    return BodyMotion(
        motion.joints[:, order] * np.array([-1.0, 1.0, 1.0]), motion.height, motion.velocity * np.array([-1.0, 1.0]),
        -motion.turn, motion.stands[:, ::-1],
    )  # fmt: skip


def in_world(
    motion: BodyMotion, rest_offsets: Float64Array, root: Float64Array, yaw: float
) -> tuple[Float64Array, Float64Array]:
    """A motion in the world, by a body.

    Where a foot stands, the root moves so that the foot stays, on the ground, and legs bend for what is left (`feet`):
    feet that slide or float are what people see first.

    Args:
        motion: T frames.
        rest_offsets: [21, 3] of the body, metres.
        root: [3] where its hips are in the first frame (x and z count; y says how high the ground is: height 0).
        yaw: which way it faces in the first frame, radians.

    Returns:
        Joints [T, 21, 3], metres, y up, and local rotations [T, 21, 4] that give them by forward kinematics.
    """
    size = body_length(rest_offsets)
    yaws = yaw + np.concatenate([[0.0], np.cumsum(motion.turn[:-1] / FPS)])
    joints = np.concatenate([np.zeros((len(motion), 1, 3)), motion.joints], axis=1)
    seen, _ = posed(turn_about_y(joints, yaws), rest_offsets, np.zeros((len(motion), 3)))
    speed = np.insert(turned_steps(motion.velocity, yaws), 1, 0, axis=1)
    steps = _held(speed * size / FPS, seen, motion.stands)
    path = root + np.concatenate([np.zeros((1, 3)), np.cumsum(steps[:-1], axis=0)])
    path[:, 1] = root[1] + _grounded(motion.height * size, seen, motion.stands, size)
    return posed(planted(seen + path[:, None], motion.stands, size, FPS), rest_offsets, path)


def _held(steps: Float64Array, seen: Float64Array, stands: Float64Array) -> Float64Array:
    """Steps of the root [T, 3] that keep standing feet in place; `seen` [T, 21, 3] joints from the root."""
    feet = seen[:, FEET].reshape(len(seen), 2, 2, 3)
    back = -_forward(feet)
    lower = feet[..., 1].argmin(axis=2)  # of ankle and toe, the one that bears
    bearing = np.take_along_axis(back, lower[..., None, None], axis=2)[:, :, 0]
    weights = stands / np.maximum(stands.sum(axis=1, keepdims=True), 1e-9)
    wanted = (bearing * weights[..., None]).sum(axis=1)
    change = (wanted - steps) * stands.max(axis=1)[:, None]
    change[:, 1] = 0
    held: Float64Array = steps + gaussian_filter1d(change, SMOOTH, axis=0) if len(steps) > 1 else steps
    return held


def _grounded(heights: Float64Array, seen: Float64Array, stands: Float64Array, size: float) -> Float64Array:
    """Heights of the root [T] by which the body neither floats nor sinks while a foot stands.

    The lowest joint of the feet is on the ground then in the mean of about a second, not frame by frame: steps and hops
    keep their heights. Where a foot surely stands it is never further away than in recordings: a squat of limbs of
    constant length goes less deep than a depth sensor has it.
    """
    lowest = seen[:, FEET, 1].min(axis=1)
    weights = stands.max(axis=1)
    settled = heights + _spread(-lowest - heights, weights, SETTLE)
    apart = -lowest - settled
    beyond = apart - np.clip(apart, -AWAY * size, AWAY * size)
    return settled + _spread(beyond, np.clip((weights - UNSURE) / (SURE - UNSURE), 0, 1), SMOOTH)


def _spread(apart: Float64Array, weights: Float64Array, frames: float) -> Float64Array:
    """Mean of `apart` [T] over the frames about each, by weights [T]; towards nothing where there are none."""
    spread: Float64Array = gaussian_filter1d(apart * weights, frames) / (gaussian_filter1d(weights, frames) + 0.1)
    return spread


def _standing(feet: Float64Array) -> Float64Array:
    """[T, 2] of feet [T, 4, 3]: ankle and toe of the left foot, then of the right."""
    speed = np.linalg.norm(_forward(feet), axis=-1) * FPS
    low = feet[..., 1] - np.quantile(feet[..., 1], 0.05, axis=0) < LOW
    stands = ((speed < SLOW) & low).reshape(len(feet), 2, 2).any(axis=2)
    return np.asarray(stands, dtype=np.float64)


def _forward(rows: Float64Array) -> Float64Array:
    """[T, ...] differences to the next row; the last repeats."""
    steps = np.diff(rows, axis=0)
    repeated: Float64Array = np.concatenate([steps, steps[-1:]])
    return repeated
