"""A clip as the descriptor network reads it (DeepHuMS, section 3.3.2), and when two clips count as similar."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Float64Array
from motionlake.deephums.config import LONGEST, SHORT
from motionlake.motion.resampling import interpolated
from motionlake.motion.skeleton import COMMON, INDEX

FPS: Final = 30.0
# A Savitzky-Golay filter of this window and order takes the jitter of depth sensors; it hardly moves clean motion.
WINDOW: Final = 7
ORDER: Final = 3
# Bones between the fifteen joints and what share of leg plus torso each is in an average body.
BONES: Final = {
    ("hips", "neck"): 0.33, ("neck", "head"): 0.15,
    ("neck", "left_shoulder"): 0.17, ("left_shoulder", "left_elbow"): 0.22, ("left_elbow", "left_wrist"): 0.19,
    ("neck", "right_shoulder"): 0.17, ("right_shoulder", "right_elbow"): 0.22, ("right_elbow", "right_wrist"): 0.19,
    ("left_hip", "left_knee"): 0.34, ("left_knee", "left_ankle"): 0.33,
    ("right_hip", "right_knee"): 0.34, ("right_knee", "right_ankle"): 0.33,
}  # fmt: skip
# Left and right joints that tell where a body faces, the surest first.
SIDES: Final = ("hip", "shoulder", "knee", "elbow", "ankle", "wrist")
ROOTS: Final = (("hips",), ("left_hip", "right_hip"), ("neck",), ("left_shoulder", "right_shoulder"), ("head",))
MIN_HORIZONTAL: Final = 0.05


def clip_sequence(positions: Float64Array, fps: float, missing: BoolArray | None = None) -> Float32Array:
    """A clip's joints over time: divided by the body's size, centred at the root, turned by its median facing.

    Where the root stands is kept in the place of the hips: how far from where it was first, seen from the body. A
    joint that is missing is zero. Root, facing and size come from the joints there are.

    Args:
        positions: [F, 21, 3] canonical joint positions, metres, y up.
        fps: frames a second.
        missing: [21] joints that were not seen in any frame; their positions are not looked at.

    Returns:
        [T, 15, 3] float32 at 30 frames a second, in body lengths (leg plus torso).

    Raises:
        ValueError: no frames, positions that are not finite, or all joints missing.
    """
    seen = np.ones(len(INDEX), dtype=bool) if missing is None else ~missing
    there = np.array([seen[INDEX[name]] for name in COMMON])
    if not len(positions) or not there.any():
        raise ValueError("a clip without frames or without joints has no descriptor")
    joints = positions[:, [INDEX[name] for name in COMMON]].astype(np.float64)
    joints = interpolated(joints, np.linspace(0, len(joints) - 1, frames_of(len(joints), fps)))
    joints[:, ~there] = 0
    if not np.isfinite(joints).all():
        raise ValueError("joint positions are not all finite")
    if len(joints) >= WINDOW:
        from scipy.signal import savgol_filter

        joints = savgol_filter(joints, WINDOW, ORDER, axis=0)
    root = _root(joints, there)
    yaw = _heading(joints, there)
    turn = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    body = (joints - root[:, None]) @ turn
    body[:, 0] = (root - root[0]) @ turn
    body[:, ~there] = 0
    return np.asarray(body / _size(joints, there), dtype=np.float32)


def _at(names: tuple[str, ...]) -> list[int]:
    return [COMMON.index(name) for name in names]


def _root(joints: Float64Array, there: BoolArray) -> Float64Array:
    """[T, 3] the hips, or the next best point of the trunk."""
    for names in ROOTS:
        at = _at(names)
        if there[at].all():
            return np.asarray(joints[:, at].mean(axis=1))
    return np.asarray(joints[:, there].mean(axis=1))


def _heading(joints: Float64Array, there: BoolArray) -> float:
    """Median facing of the clip in radians about +y from +z; 0 where no pair of joints tells."""
    axes = []
    for side in SIDES:
        left, right = _at((f"left_{side}", f"right_{side}"))
        if there[left] and there[right]:
            across = joints[:, left] - joints[:, right]
            axes.append(across / np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-12))
        if len(axes) == 2:
            break
    if not axes:
        return 0.0
    across = np.mean(axes, axis=0)
    clear = np.hypot(across[:, 0], across[:, 2]) > MIN_HORIZONTAL
    if not clear.any():
        return 0.0
    return float(np.median(np.unwrap(np.arctan2(-across[clear, 2], across[clear, 0]))))


def _size(joints: Float64Array, there: BoolArray) -> float:
    """Leg plus torso in metres, from the lengths of all bones that are there."""
    length = share = 0.0
    for (parent, child), part in BONES.items():
        a, b = _at((parent, child))
        if there[a] and there[b]:
            length += float(np.median(np.linalg.norm(joints[:, a] - joints[:, b], axis=-1)))
            share += part
    return length / share if length > 0 else 1.0


def frames_of(n_frames: int, fps: float) -> int:
    """How many frames `clip_sequence` makes of so many at a rate."""
    return max(1, round((n_frames - 1) / fps * FPS) + 1)


def piece_windows(n_frames: int, fps: float) -> list[tuple[int, int]]:
    """Windows [start, stop) of a clip of so many frames at its own rate, in order: long ones, and short ones inside.

    Both reach from its first frame to its last; each starts at most half a window after the one before. Long ones have
    at most `LONGEST` frames at 30 a second, short ones `SHORT`. A clip that is no longer is one window.
    """
    return sorted({*_covering(n_frames, fps, LONGEST), *_covering(n_frames, fps, SHORT)})


def _covering(n_frames: int, fps: float, longest: int) -> list[tuple[int, int]]:
    width = int((longest - 1) / FPS * fps) + 1
    if frames_of(n_frames, fps) <= longest or n_frames <= width:
        return [(0, n_frames)]
    count = int(np.ceil((n_frames - width) / (width / 2))) + 1
    starts = np.linspace(0, n_frames - width, count).round().astype(int).tolist()
    return [(start, start + width) for start in starts]


WARM_UP: Final = 0.3


def one_cycle(done: float) -> float:
    """Share of the highest rate when a share `done` of training is over: up along a cosine, then down to nothing."""
    if done < WARM_UP:
        return 0.04 + 0.96 * (1 - math.cos(math.pi * done / WARM_UP)) / 2
    return (1 + math.cos(math.pi * (done - WARM_UP) / (1 - WARM_UP))) / 2


def motion_field(clip: Float32Array) -> Float64Array:
    """[15, 3] displacement of each joint from the first frame of a clip [T, 15, 3] to its last (equation 3.3)."""
    return np.asarray(clip[-1] - clip[0], dtype=np.float64)


def motion_distance(clip: Float32Array) -> Float64Array:
    """[15] length of the path of each joint (equation 3.4)."""
    return np.asarray(np.linalg.norm(np.diff(clip, axis=0), axis=-1).sum(axis=0), dtype=np.float64)


def similar_by_motion(clips: Sequence[Float32Array], share: float) -> BoolArray:
    """[n, n] whether both the motion fields and the motion distances of two clips are alike.

    The thesis leaves open how near is alike: here each of the two distances is below its own quantile over all pairs,
    such that `share` of the pairs pass either test.
    """
    alike = np.ones((len(clips), len(clips)), dtype=bool)
    for measure in (motion_field, motion_distance):
        rows = np.stack([measure(clip).ravel() for clip in clips])
        from scipy.spatial.distance import cdist

        apart = cdist(rows, rows)
        alike &= apart <= np.quantile(apart[np.triu_indices(len(rows), 1)], share)
    np.fill_diagonal(alike, True)
    return alike


def alignment_distances(clips: Sequence[Float32Array]) -> Float64Array:
    """[n, n] distances of clips [T, 15, 3] by dynamic time warping of their moves, whatever the size of the motion."""
    from motionlake.motion.dtw import dtw_matrix
    from motionlake.motion.moves import Track, at_12

    return dtw_matrix([Track.of(at_12(clip)).moves() for clip in clips])
