"""The baseline of every evaluation: dynamic time warping of whole clips (`motionlake.motion.dtw`).

Fifteen joints are compared, seen from the body (centred at the hips, turned to face one way, divided by leg plus torso
length) at 24 frames a second.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.evaluation.clips import Notice, Split, read_positions
from motionlake.kernels import njit
from motionlake.lake.layout import Lake
from motionlake.motion.dtw import CELLS_PER_SECOND, dtw_cross, dtw_matrix, frame_pairs, squared_distances
from motionlake.motion.features import WordConfig, word_features
from motionlake.retrieval.labelled_clips import FramedClip

BASELINE: Final = WordConfig(root_weight=0.0, velocity_weight=0.0, smoothing=0.0)
PATIENCE: Final = 300.0  # seconds; what would take longer is left out by default


def dtw_baseline(lake: Lake, clips: Sequence[FramedClip], wanted: bool | None, notice: Notice) -> Float64Array | None:
    """[n, n] whole-clip DTW between clips of a lake, as `frame_distances` has it."""
    if wanted is False:
        return None
    found = {name: baseline_features(positions, fps) for name, fps, positions in read_positions(lake, clips)}
    return frame_distances([found[clip.clip] for clip in clips], wanted, notice)


def frame_distances(
    features: Sequence[Float32Array], wanted: bool | None, notice: Notice, split: Split | None = None
) -> Float64Array | None:
    """Whole-clip DTW.

    Args:
        features: n clips, each [T, D] (`baseline_features`).
        wanted: whether it is computed; None: where it takes at most `PATIENCE` seconds.
        notice: hears how long it takes, or that it is left out.
        split: which clips query which; by default all query all.

    Returns:
        [n, n] or, of a split into q queries and a repository of r, [q, r]; None where it is not computed.
    """
    if wanted is False:
        return None
    pairs, sides = frame_pairs([len(each) for each in features]), None
    if split is not None and split.names is not None:
        sides = tuple([features[i] for i in rows] for rows in (split.queries, split.repository))
        pairs = sum(map(len, sides[0])) * sum(map(len, sides[1]))
    seconds = pairs / CELLS_PER_SECOND
    if wanted is None and seconds > PATIENCE:
        notice(
            f"whole-clip DTW is left out: it would take about {seconds / 60:.0f} minutes; --baseline dtw computes it"
        )
        return None
    notice(f"whole-clip DTW: about {seconds:.0f} s")
    return dtw_cross(*sides) if sides else dtw_matrix(features)


def baseline_features(positions: Float64Array, fps: float) -> Float32Array:
    """[T, 42] the baseline's numbers of a clip with canonical joint `positions` [F, 21, 3] at `fps`.

    The fifteenth joint is the origin. Raises `ValueError` as `word_features` does.
    """
    return word_features(positions, np.zeros((0, 0, 4)), fps, BASELINE)


def dtw_path(a: Float32Array, b: Float32Array) -> Int64Array:
    """[L, 2] frames of clips a [n, D] and b [m, D] along the cheapest path, from (0, 0) to (n - 1, m - 1).

    Steps (1, 1), (1, 0), (0, 1); of equal ones the first of these.

    Raises:
        ValueError: a clip without frames.
    """
    if not (len(a) and len(b)):
        raise ValueError("a clip without frames cannot be aligned")
    found: Int64Array = _path(squared_distances(a, b))
    return found


def joint_error(a: Float32Array, b: Float32Array) -> float:
    """Mean Euclidean distance of a joint along the path of two clips [n, 3 J] and [m, 3 J], in their unit.

    Raises:
        ValueError: a clip without frames.
    """
    path = dtw_path(a, b)
    apart = (a[path[:, 0]] - b[path[:, 1]]).reshape(len(path), -1, 3)
    return float(np.linalg.norm(apart.astype(np.float64), axis=-1).mean())


@njit(cache=True)
def _path(squared: Float32Array) -> Int64Array:
    """The cheapest path through the roots of `squared` [n, m]."""
    n, m = squared.shape
    steps = np.empty((n, m), dtype=np.uint8)
    before = np.full(m + 1, np.inf)
    before[0] = 0.0
    for i in range(n):
        diagonal = before[0]
        before[0] = np.inf
        left = np.inf
        for j in range(m):
            above = before[j + 1]
            step, least = 0, diagonal
            if above < least:
                step, least = 1, above
            if left < least:
                step, least = 2, left
            steps[i, j] = step
            left = least + np.sqrt(max(squared[i, j], np.float32(0)))
            before[j + 1] = left
            diagonal = above
    found = np.empty((n + m, 2), dtype=np.int64)
    i, j, count = n - 1, m - 1, 0
    while True:
        found[count, 0], found[count, 1] = i, j
        count += 1
        if i == 0 and j == 0:
            return found[:count][::-1].copy()
        step = steps[i, j]
        if step != 2:
            i -= 1
        if step != 1:
            j -= 1
