"""A clip as every method sees it: the features of the default words and nothing else.

So the joints, their smoothing, the rate, the body's size and where it faces are the same for all of them and for
ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.motion.features import WordConfig
from motionlake.motion.skeleton import JOINTS

from bench.canonical_sets import LabelledClip, features

WORDS: Final = WordConfig()
AT: Final = {JOINTS[joint]: i for i, joint in enumerate(WORDS.joint_indices)}
SIDES: Final = ("left", "right")


@dataclass(frozen=True)
class Seen:
    """T frames at the words' rate, seen from the body: hips at the origin, facing +z, y up, lengths in body lengths.

    Attributes:
        features: [T, 88] of the default words.
        label: class.
        subject: who performs.
    """

    features: Float32Array
    label: str = ""
    subject: str = ""

    @cached_property
    def joints(self) -> Float64Array:
        """[T, 14, 3] joints without the hips."""
        return self.features[:, : WORDS.posture].reshape(len(self.features), -1, 3).astype(np.float64)

    @cached_property
    def velocities(self) -> Float64Array:
        """[T, 14, 3] of the joints, body lengths a second."""
        found = self.features[:, WORDS.posture : 2 * WORDS.posture].reshape(len(self.features), -1, 3)
        return found.astype(np.float64) * (WORDS.fps / WORDS.velocity_weight)

    @cached_property
    def root(self) -> Float64Array:
        """[T, 4] velocity of the hips (body lengths a second), yaw rate (radians a second)."""
        return self.features[:, -4:].astype(np.float64) * (WORDS.fps / WORDS.root_weight)

    def joint(self, name: str) -> Float64Array:
        """[T, 3] where a joint is; the hips are the origin."""
        return np.zeros((len(self.features), 3)) if name == "hips" else self.joints[:, AT[name]]

    def velocity(self, name: str) -> Float64Array:
        """[T, 3] of a joint, as the body sees it, body lengths a second."""
        return np.zeros((len(self.features), 3)) if name == "hips" else self.velocities[:, AT[name]]


def seen(clips: Sequence[LabelledClip]) -> list[Seen]:
    """What is seen of labelled clips."""
    made = features(list(clips), WORDS)
    return [Seen(rows, clip.label, clip.subject) for rows, clip in zip(made, clips, strict=True)]


def angle(a: Float64Array, b: Float64Array) -> Float64Array:
    """[T] degrees between vectors [T, 3]."""
    length = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
    cosine = (a * b).sum(axis=1) / np.maximum(length, 1e-9)
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def along(vectors: Float64Array, directions: Float64Array) -> Float64Array:
    """[T] how long vectors [T, 3] are in directions [T, 3]."""
    lengths = np.maximum(np.linalg.norm(directions, axis=1), 1e-9)
    return np.asarray((vectors * directions).sum(axis=1) / lengths)


def bend(clip: Seen, side: str, limb: str) -> Float64Array:
    """[T] degrees between the bones at an elbow ("arm") or a knee ("leg"); 180 is straight."""
    names = ("shoulder", "elbow", "wrist") if limb == "arm" else ("hip", "knee", "ankle")
    start, middle, end = (clip.joint(f"{side}_{name}") for name in names)
    return angle(start - middle, end - middle)
