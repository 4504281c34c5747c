"""What frames are compared by: where feet, hands and head are and how they move, and where the root goes.

Everything is seen from the root, in body lengths and seconds, so bodies of any size and heading compare.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.matching.recordings import FPS, RootedMotion, seen_from
from motionlake.motion.rotations import turn_on_ground
from motionlake.motion.skeleton import INDEX

POINTS: Final = ("hips", "head", "left_ankle", "right_ankle", "left_wrist", "right_wrist")
_OTHER: Final = (0, 1, 3, 2, 5, 4)  # of each point, that on the other side
AHEAD: Final = (10, 20, 30)  # frames ahead, of the trajectory
POSE: Final = 6 * len(POINTS)  # numbers of places and velocities
WIDTH: Final = POSE + 4 * len(AHEAD)  # and of trajectory: places (left, ahead) and headings (sine, cosine)
VELOCITIES: Final = slice(POSE // 2, POSE)
PLACES: Final = slice(POSE, POSE + 2 * len(AHEAD))
HEADINGS: Final = slice(POSE + 2 * len(AHEAD), WIDTH)
# Weights of the groups, each normalised by its spread.
_WEIGHTS: Final = {"places": 0.8, "velocities": 1.0, "course": 2.0, "headings": 1.0}


def pose_features(motion: RootedMotion) -> Float64Array:
    """[T, 36] places of `POINTS` from the root, and their velocities as the root sees them (its own included)."""
    points = motion.joints[:, [INDEX[name] for name in POINTS]]
    world = np.concatenate([_turned(points, motion.heading, motion.place)], axis=0)
    steps = np.gradient(world, axis=0) * FPS
    velocities = seen_from(steps, np.zeros((len(motion), 2)), motion.heading)
    return np.concatenate([points.reshape(len(motion), -1), velocities.reshape(len(motion), -1)], axis=1)


def _turned(points: Float64Array, heading: Float64Array, place: Float64Array) -> Float64Array:
    x, z = turn_on_ground(points[..., 0], points[..., 2], heading[:, None])
    return np.stack([x + place[:, None, 0], points[..., 1], z + place[:, None, 1]], axis=-1)


def trajectory_features(place: Float64Array, heading: Float64Array) -> Float64Array:
    """[T, 12] where the root is after 1/3, 2/3 and 1 s, and where it heads then; past the end it goes on as it went."""
    count = len(place)
    at = np.arange(count)[:, None] + np.array(AHEAD)
    inside = np.minimum(at, count - 1)
    step = (place[-1] - place[max(0, count - 4)]) / max(1, min(3, count - 1))
    then = place[inside] + (at - inside)[..., None] * step - place[:, None]
    left, ahead = turn_on_ground(then[..., 0], then[..., 1], -heading[:, None])
    turned = heading[inside] - heading[:, None]
    places = np.stack([left, ahead], axis=-1).reshape(count, -1)
    headings = np.stack([np.sin(turned), np.cos(turned)], axis=-1).reshape(count, -1)
    return np.concatenate([places, headings], axis=1)


def features(motion: RootedMotion) -> Float32Array:
    """[T, 48] of every frame."""
    rows = np.concatenate([pose_features(motion), trajectory_features(motion.place, motion.heading)], axis=1)
    return rows.astype(np.float32)


def mirrored_features(rows: Float32Array) -> Float32Array:
    """Features [T, 48] of the bodies reflected left to right."""
    points = len(POINTS)
    both = rows[:, :POSE].reshape(len(rows), 2, points, 3)[:, :, list(_OTHER)] * np.array([-1, 1, 1], dtype=np.float32)
    course = rows[:, POSE:].reshape(len(rows), -1, 2) * np.array([-1, 1], dtype=np.float32)
    return np.concatenate([both.reshape(len(rows), -1), course.reshape(len(rows), -1)], axis=1)


def scales(rows: Float32Array) -> Float32Array:
    """[48] by which features are multiplied before they are compared: a group's weight over its mean spread."""
    half = POSE // 2
    groups = {
        "places": slice(0, half), "velocities": slice(half, POSE), "course": PLACES, "headings": HEADINGS,
    }  # fmt: skip
    found = np.ones(WIDTH)
    for name, columns in groups.items():
        spread = float(rows[:, columns].std(axis=0).mean())
        size = columns.stop - columns.start
        found[columns] = _WEIGHTS[name] / max(spread, 1e-3) / np.sqrt(size)
    return found.astype(np.float32)
