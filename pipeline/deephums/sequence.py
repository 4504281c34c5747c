"""A clip as the descriptor network reads it (DeepHuMS, section 3.3.2), and when two clips count as similar."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Final, NamedTuple

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Float64Array, Int64Array
from motionlake.deephums.body_view import seen_from_body
from motionlake.deephums.config import LONGEST, SHORT
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
    view = _view(tuple(there.tolist()))
    exact = np.ascontiguousarray(positions, dtype=np.float64)
    count = frames_of(len(exact), fps)
    body: Float32Array = seen_from_body(exact, count, _smoothing(), *view, MIN_HORIZONTAL)
    if not np.isfinite(body).all():
        raise ValueError("joint positions are not all finite")
    return body


class _View(NamedTuple):
    """What of the joints that were seen tells root, facing and size; joints by their places in `COMMON`.

    Attributes:
        joints: [15] canonical indices; -1: not seen.
        root: the hips, or the next best points of the trunk, or all joints.
        sides: [0 to 2, 2] the surest left and right joints.
        bones: [B, 2] those of which both joints were seen.
        share: what these are together in an average body.
    """

    joints: Int64Array
    root: Int64Array
    sides: Int64Array
    bones: Int64Array
    share: float


@cache
def _view(there: tuple[bool, ...]) -> _View:
    seen = {name: at for at, (name, is_there) in enumerate(zip(COMMON, there, strict=True)) if is_there}
    joints = [INDEX[name] if name in seen else -1 for name in COMMON]
    root = next((names for names in ROOTS if all(name in seen for name in names)), tuple(seen))
    pairs = [(f"left_{side}", f"right_{side}") for side in SIDES]
    bones = [bone for bone in BONES if all(name in seen for name in bone)]
    return _View(
        np.array(joints, dtype=np.int64),
        np.array([seen[name] for name in root], dtype=np.int64),
        _places([pair for pair in pairs if all(name in seen for name in pair)][:2], seen),
        _places(bones, seen),
        sum(BONES[bone] for bone in bones),
    )


def _places(pairs: Sequence[tuple[str, str]], seen: Mapping[str, int]) -> Int64Array:
    return np.array([[seen[name] for name in pair] for pair in pairs], dtype=np.int64).reshape(-1, 2)


@cache
def _smoothing() -> Float64Array:
    """[7, 7] weights of a Savitzky-Golay filter: row i of the i-th of seven frames, by the cubic nearest to all."""
    powers = np.vander(np.arange(WINDOW) - WINDOW // 2, ORDER + 1).astype(np.float64)
    return np.asarray(powers @ np.linalg.pinv(powers))


def frames_of(n_frames: int, fps: float) -> int:
    """How many frames `clip_sequence` makes of so many at a rate."""
    return max(1, round((n_frames - 1) / fps * FPS) + 1)


def piece_windows(n_frames: int, fps: float) -> list[tuple[int, int]]:
    """Windows [start, stop) of a clip of so many frames at its own rate, in order: long ones, and short ones inside.

    Both reach from its first frame to its last; each starts at most half a window after the one before. Long ones have
    at most `LONGEST` frames at 30 a second, short ones `SHORT`. A clip that is no longer is one window.
    """
    return sorted({*_covering(n_frames, fps, LONGEST), *_covering(n_frames, fps, SHORT)})


def in_sequence(windows: Sequence[tuple[int, int]], n_frames: int, fps: float) -> Int64Array:
    """[n, 2] the same windows of a clip of so many frames at its own rate, in the frames that `clip_sequence` makes."""
    bounds = np.array(windows, dtype=np.int64).reshape(-1, 2)
    last = frames_of(n_frames, fps) - 1
    ends = np.rint(np.stack([bounds[:, 0], bounds[:, 1] - 1], axis=1) / fps * FPS).astype(np.int64)
    inside: Int64Array = np.minimum(ends, last) + np.array([0, 1])
    return inside


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
