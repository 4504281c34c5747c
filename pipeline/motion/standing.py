"""Feet that stand: when they do, how they stay in place, and how a body's feet lie when they are flat."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array
from motionlake.motion.canonicalise import CanonicalMotion
from motionlake.motion.features import change_a_frame
from motionlake.motion.rotations import MIN_LENGTH
from motionlake.motion.skeleton import INDEX

SIDES: Final = ("left", "right")
# A foot stands where ankle and toe go slower than this (body heights a second) and lie this near (body heights) to the
# lowest place of the clip.
STILL: Final = 0.15
LOW: Final = 0.04
SHORTEST: Final = 3  # frames of a stand
LOWEST: Final = 0.02  # quantile of heights that counts as the lowest place


@dataclass(frozen=True)
class FlatFoot:
    """A foot that stands flat.

    Attributes:
        rise: radians by which the bone from ankle to toe rises; negative where the ankle is above the toe joint.
        height: metres of the ankle over the toe joint.
    """

    rise: float
    height: float


def contacts(positions: Float64Array, fps: float, body_height: float) -> BoolArray:
    """[F, 2] whether the left and the right foot stand: ankle and toe are still and low, for joints [F, 21, 3]."""
    rows = [[INDEX[f"{side}_ankle"], INDEX[f"{side}_toe"]] for side in SIDES]
    feet = positions[:, rows] / body_height
    speed = np.linalg.norm(change_a_frame(feet), axis=-1) * fps
    lowest = np.quantile(feet[..., 1], LOWEST, axis=(0, 1))
    return np.asarray(((speed < STILL) & (feet[..., 1] < lowest + LOW)).all(axis=-1))


def staying(foot: Float64Array, standing: BoolArray, far: float, blend: int) -> Float64Array:
    """[F, 3] by which a foot moves, level, to stay in place while it stands.

    Args:
        foot: [F, 2, 3] ankle and toe, metres; the one that wanders less bears.
        standing: [F] when it stands.
        far: metres; a foot that wanders further while it stands is turned or dragged on purpose, and moves as it does.
        blend: frames over which a foot comes to where it stands, and leaves it.
    """
    from scipy.ndimage import label

    change, weights = np.zeros((len(foot), 3)), np.zeros(len(foot))
    runs, count = label(standing)
    frames = np.arange(len(foot))
    for run in range(1, count + 1):
        rows = np.flatnonzero(runs == run)
        first, last = rows[0], rows[-1]
        flat = foot[rows][..., [0, 2]]
        middle = np.median(flat, axis=0)
        away = np.linalg.norm(flat - middle, axis=2).max(axis=0)
        bears = int(away.argmin())
        if len(rows) < SHORTEST or away[bears] > far:
            continue
        apart = np.maximum(np.maximum(first - frames, frames - last), 0)
        share = np.where(apart < blend, 0.5 + 0.5 * np.cos(np.pi * apart / blend), 0.0)
        back = middle[bears] - foot[np.clip(frames, first, last), bears][:, [0, 2]]
        change[:, [0, 2]] += share[:, None] * back
        weights += share
    return np.asarray(change / np.maximum(weights, 1)[:, None])


def measured_foot(motion: CanonicalMotion) -> FlatFoot | None:
    """How the feet of a motion stand flat: the median over the frames in which they stand; None where they never do."""
    stands = contacts(motion.positions, motion.fps, motion.body_height)
    bones = np.concatenate(
        [
            (motion.positions[:, INDEX[f"{side}_toe"]] - motion.positions[:, INDEX[f"{side}_ankle"]])[stands[:, at]]
            for at, side in enumerate(SIDES)
        ]
    )
    return _flat(bones)


def foot_of_pose(positions: Float64Array) -> FlatFoot | None:
    """Of joints [21, 3] of a body whose feet are flat; None where a foot has no length."""
    bones = np.array([positions[INDEX[f"{side}_toe"]] - positions[INDEX[f"{side}_ankle"]] for side in SIDES])
    return _flat(bones)


def _flat(bones: Float64Array) -> FlatFoot | None:
    """From the bones [n, 3], ankle to toe, of feet that stand flat; None where there are none, or one has no length."""
    lengths = np.linalg.norm(bones, axis=-1)
    if not len(bones) or lengths.min() < MIN_LENGTH:
        return None
    rise = np.arcsin(np.clip(bones[:, 1] / lengths, -1, 1))
    return FlatFoot(float(np.median(rise)), float(-np.median(bones[:, 1])))


def foot_height(motion: CanonicalMotion) -> float:
    """Metres at which the toe joints of a motion lie when they are lowest."""
    toes = motion.positions[:, [INDEX[f"{side}_toe"] for side in SIDES], 1]
    return float(np.quantile(toes, LOWEST))
