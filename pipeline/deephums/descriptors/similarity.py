"""When two clips count as similar without labels (DeepHuMS, equations 3.3 and 3.4)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Float64Array
from motionlake.motion.dtw import dtw_matrix
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.distance import cdist

# Alignment compares so many frames a second of at most so many seconds of a clip.
ALIGNED_FPS: Final = 12.0
ALIGNED_FRAMES: Final = 160


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
        apart = cdist(rows, rows)
        alike &= apart <= np.quantile(apart[np.triu_indices(len(rows), 1)], share)
    np.fill_diagonal(alike, True)
    return alike


def alignment_distances(clips: Sequence[Float32Array]) -> Float64Array:
    """[n, n] distances of clips by dynamic time warping of how they move, whatever the size of the motion.

    A frame is the displacement of the joints from the posture that the clip starts and ends in, and their velocity,
    each divided by its root mean square over the clip.
    """
    return dtw_matrix([_moves(clip) for clip in clips])


def neighbourhoods(distances: Float64Array, k: int, sharpness: float) -> Float32Array:
    """[n, n] how near clips are: exp(-sharpness d_ij^2 / (d_ik d_jk)); d_ik is the distance of the k-th nearest."""
    k = min(k, len(distances) - 1)
    scale = np.maximum(np.sort(distances, axis=1)[:, k], 1e-9)
    return np.asarray(np.exp(-sharpness * distances**2 / np.outer(scale, scale)), dtype=np.float32)


def _moves(clip: Float32Array) -> Float32Array:
    count = int(np.clip(round(len(clip) * ALIGNED_FPS / 30), 4, ALIGNED_FRAMES))
    at = np.linspace(0, len(clip) - 1, count).round().astype(int)
    joints = clip[at].reshape(count, -1).astype(np.float64)
    joints -= np.median(joints[[0, 1, -2, -1]], axis=0)
    velocity = np.gradient(gaussian_filter1d(joints, 1.0, axis=0), axis=0)
    parts = [part / max(float(np.sqrt((part**2).sum(axis=1).mean())), 1e-6) for part in (joints, velocity)]
    return np.concatenate(parts, axis=1).astype(np.float32)
