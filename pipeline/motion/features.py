"""Motion words: features of every frame, and the windows of frames that are the words (Deep Motifs, section 3.1).

Two representations. "positions": joint positions seen from the body (centred at the hips, turned to face
one way, divided by the body's size), with the motion of the root beside them. "rotations": the local
rotation of each joint, as in Deep Motifs, sections 3.1 and 5.1. Both are invariant to where the body
stands and where it faces.

Those of the mirrored motion follow from them by a linear and exact map, so that no clip has to be read again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.motion.resampling import resample
from motionlake.motion.rotations import turn_about_y
from motionlake.motion.skeleton import COMMON, DEEP_MOTIFS, INDEX, MIRRORED_JOINTS, facing
from motionlake.motion.smoothing import smoothed

Representation = Literal["positions", "rotations"]
JointSet = Literal["common15", "deep_motifs16"]

JOINT_SETS: Final[dict[str, tuple[str, ...]]] = {"common15": COMMON, "deep_motifs16": DEEP_MOTIFS}


@dataclass(frozen=True)
class WordConfig:
    """What motion words are made of; the defaults measured best over four sets (`docs/words.md`).

    Attributes:
        representation: "positions" or "rotations".
        fps: frames a second that words are sampled at.
        length: frames of a word.
        stride: frames between the starts of neighbouring words.
        joints: "common15" (every rig has them) or "deep_motifs16" (Deep Motifs, section 5.1).
        root_weight: "positions" only: weight of the root's velocity (body lengths a frame, seen from the
            body) and yaw rate (radians a frame); 0 leaves them out.
        velocity_weight: "positions" only: weight of the joints' velocities (body lengths a frame, seen
            from the body); 0 leaves them out.
        smoothing: "positions" only: standard deviation, in frames of the words, of the Gaussian that smooths
            joint positions in time; 0 leaves them as they are.

    Raises:
        ValueError: a value out of range, or rotations with weights, smoothing or a joint set that holds the hips.
    """

    representation: Representation = "positions"
    fps: float = 24.0
    length: int = 12
    stride: int = 2
    joints: JointSet = "common15"
    root_weight: float = 5.0
    velocity_weight: float = 4.0
    smoothing: float = 1.0

    def __post_init__(self) -> None:
        if self.representation not in ("positions", "rotations"):
            raise ValueError(f"representation is {self.representation!r}, not positions or rotations")
        if self.joints not in JOINT_SETS:
            raise ValueError(f"joints is {self.joints!r}, not one of {', '.join(JOINT_SETS)}")
        if not (self.fps > 0 and self.length >= 1 and self.stride >= 1):
            raise ValueError("fps, length and stride of words must be positive")
        if min(self.root_weight, self.velocity_weight, self.smoothing) < 0:
            raise ValueError("weights and smoothing of word features cannot be negative")
        if self.representation == "rotations" and (
            self.joints != "deep_motifs16" or self.root_weight or self.velocity_weight or self.smoothing
        ):
            raise ValueError("words of rotations need joints deep_motifs16, zero weights and no smoothing")

    @classmethod
    def deep_motifs(cls) -> WordConfig:
        """The paper's words: local rotations of 16 joints, 24 fps, 16 frames, stride 4 (section 5.1)."""
        return cls("rotations", 24.0, 16, 4, "deep_motifs16", 0.0, 0.0, 0.0)

    @property
    def joint_indices(self) -> tuple[int, ...]:
        """Canonical indices of the joints that are kept; hips are left out, which centred are always zero."""
        return tuple(INDEX[name] for name in JOINT_SETS[self.joints] if name != "hips")

    @property
    def reads_rotations(self) -> bool:
        """Whether features are made of rotations, and not of positions."""
        return self.representation == "rotations"

    @property
    def posture(self) -> int:
        """P: the first numbers of a frame, which say how the body stands; those after them say how it moves."""
        return len(self.joint_indices) * (4 if self.representation == "rotations" else 3)

    @property
    def dimension(self) -> int:
        """D: numbers a frame."""
        n_joints = len(self.joint_indices)
        if self.representation == "rotations":
            return 4 * n_joints
        return 3 * n_joints * (1 + (self.velocity_weight > 0)) + 4 * (self.root_weight > 0)


def word_features(positions: Float64Array, rotations: Float64Array, fps: float, config: WordConfig) -> Float32Array:
    """Features [T, D] float32 of a clip at the words' rate, T = `sample_count(F, fps, config.fps)`.

    Positions: joints (x, y, z each), then joint velocities, then root velocity (x, y, z) and yaw rate. Rotations:
    w, x, y, z of each joint with w >= 0.

    Args:
        positions: [F, 21, 3] canonical joint positions, metres, y up. May be empty for rotations.
        rotations: [F, 21, 4] canonical local rotations (w, x, y, z). May be empty for positions.
        fps: frames a second of the arrays.
        config: what to compute.

    Raises:
        ValueError: a clip without frames, a rate that is not positive, or a body without size.
    """
    used = positions if config.representation == "positions" else rotations
    if len(used) == 0:
        raise ValueError("a clip without frames has no words")
    if not fps > 0:
        raise ValueError(f"the frame rate is {fps}, not positive")
    if config.representation == "rotations":
        quaternions = resample(rotations[:, list(config.joint_indices)], fps, config.fps, spherical=True)
        return np.ascontiguousarray(quaternions.reshape(len(quaternions), -1), dtype=np.float32)
    sampled = resample(positions, fps, config.fps)
    if config.smoothing:
        sampled = smoothed(sampled, config.smoothing, "nearest")
    return _position_features(sampled, body_length(positions), config)


_BONES: Final = tuple(
    (INDEX[start], INDEX[end])
    for start, end in (
        ("left_hip", "left_knee"), ("left_knee", "left_ankle"), ("right_hip", "right_knee"),
        ("right_knee", "right_ankle"), ("hips", "neck"),
    )
)  # fmt: skip


def body_length(positions: Float64Array) -> float:
    """Leg plus torso in metres: thigh + shin (mean of both sides) + hips to neck, medians over the clip.

    Raises `ValueError` where it is zero or not finite.
    """
    x, y, z = np.moveaxis(np.stack([positions[:, end] - positions[:, start] for start, end in _BONES]), -1, 0)
    left_thigh, left_shin, right_thigh, right_shin, torso = np.median(np.sqrt(x * x + y * y + z * z), axis=1).tolist()
    length = float(((left_thigh + left_shin) + (right_thigh + right_shin)) / 2 + torso)
    if not (np.isfinite(length) and length > 0):
        raise ValueError(f"leg plus torso measure {length} m: the body has no size")
    return length


def change_a_frame(values: Float64Array) -> Float64Array:
    """Central differences a frame along the first axis; zero for a single frame."""
    return np.gradient(values, axis=0) if len(values) > 1 else np.zeros_like(values)


def _position_features(positions: Float64Array, size: float, config: WordConfig) -> Float32Array:
    n_frames = len(positions)
    angles = facing(positions)
    root = positions[:, INDEX["hips"]]
    joints = turn_about_y(positions[:, list(config.joint_indices)] - root[:, None], -angles) / size
    parts = [joints.reshape(n_frames, -1)]
    if config.velocity_weight > 0:
        parts.append(config.velocity_weight * change_a_frame(joints).reshape(n_frames, -1))
    if config.root_weight > 0:
        velocity = turn_about_y(change_a_frame(root) / size, -angles)
        parts.append(config.root_weight * np.column_stack([velocity, change_a_frame(angles)]))
    return np.ascontiguousarray(np.concatenate(parts, axis=1), dtype=np.float32)


def mirrored_features(features: Float32Array, config: WordConfig) -> Float32Array:
    """Features [T, D] under `config` of the body mirrored left to right, from its own; applied twice, its own again.

    Reflecting the world across x = 0 and exchanging left and right joints turns the heading around, so seen from
    the body every x changes its sign, and so does the yaw rate. A local rotation (w, x, y, z) becomes
    (w, x, -y, -z), since the canonical rest pose is its own mirror image. `ValueError` for features of another width.
    """
    columns, signs = _mirroring(config)
    if features.shape[1] != len(columns):
        raise ValueError(f"features of width {features.shape[1]} do not fit a configuration of width {len(columns)}")
    return np.ascontiguousarray(features[:, columns] * signs)


def _mirroring(config: WordConfig) -> tuple[Int64Array, Float32Array]:
    """For each number of a mirrored frame, the column it comes from and its sign."""
    joints = config.joint_indices
    across = np.array([joints.index(MIRRORED_JOINTS[joint]) for joint in joints])
    if config.representation == "rotations":
        return _per_joint(across, 4), np.tile(np.array([1, 1, -1, -1], np.float32), len(joints))
    columns, signs = [_per_joint(across, 3)], [np.tile(np.array([-1, 1, 1], np.float32), len(joints))]
    if config.velocity_weight > 0:
        columns.append(columns[0] + 3 * len(joints))
        signs.append(signs[0])
    if config.root_weight > 0:
        columns.append(np.arange(4) + sum(map(len, columns)))
        signs.append(np.array([-1, 1, 1, -1], np.float32))
    return np.concatenate(columns), np.concatenate(signs)


def _per_joint(joints: Int64Array, width: int) -> Int64Array:
    return (joints[:, None] * width + np.arange(width)).ravel()


def windows(n_frames: int, config: WordConfig) -> Int64Array:
    """[n] first frames of the words of a clip of `n_frames` feature frames; `ValueError` where it has none."""
    if n_frames < 1:
        raise ValueError("a clip without frames has no words")
    return np.arange(0, max(n_frames - config.length, 0) + 1, config.stride, dtype=np.int64)


def padded(features: Float32Array, config: WordConfig) -> Float32Array:
    """[max(T, length), D]: the features, a short clip's last frame repeated until it fills one word."""
    missing = config.length - len(features)
    return features if missing <= 0 else np.pad(features, ((0, missing), (0, 0)), mode="edge")


def word_windows(features: Float32Array, config: WordConfig) -> Float32Array:
    """[n, length, D] words of a clip, read-only views on `features` ([T, D]) where it is long enough."""
    views = np.lib.stride_tricks.sliding_window_view(padded(features, config), config.length, axis=0)
    return views.transpose(0, 2, 1)[:: config.stride]


def native_ranges(
    starts: Int64Array, fps: float | Float64Array, n_frames: int | Int64Array, config: WordConfig
) -> Int64Array:
    """[n, 2] the ranges [start, stop) of a clip's own frames that words cover, never empty and inside the clip.

    Words that follow each other without overlap have ranges that do so too.

    Args:
        starts: [n] the words' first frames at the words' rate, as `windows` gives them.
        fps: the clip's own frame rate; or [n], where words are of several clips.
        n_frames: F, frames of the clip at its own rate; or [n].
    """
    ratio = fps / config.fps
    first = np.minimum(np.rint(starts * ratio), n_frames - 1)
    stop = np.minimum(np.rint((starts + config.length) * ratio), n_frames)
    return np.stack([first, np.maximum(first + 1, stop)], axis=1).astype(np.int64)
