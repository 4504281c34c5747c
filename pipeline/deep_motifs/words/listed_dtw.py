"""Dynamic time warping of each word with words of its own list, such as the candidates for its nearest neighbours.

The frames of `LANES` listed words are gathered for one matrix product, then aligned side by side.
"""

from __future__ import annotations

import numpy as np
from motionlake.arrays import Float32Array, Int64Array
from motionlake.deep_motifs.words.dtw import LANES, align_block
from motionlake.motion.dtw import Metric, squared_geodesics
from numba import njit


def listed_distances(
    frames_a: Float32Array,
    starts_a: Int64Array,
    frames_b: Float32Array,
    starts_b: Int64Array,
    lists: Int64Array,
    length: int = 16,
    metric: Metric = "euclidean",
    *,
    centre: Float32Array | None = None,
) -> Float32Array:
    """Distances of each word of one set from those words of another that its list names.

    Runs without the interpreter's lock, so that threads can share the work.

    Args:
        frames_a: [Ta, D] C-contiguous; starts_a: [n] first frames of words.
        frames_b: [Tb, D] C-contiguous; starts_b: [m] first frames of words.
        lists: [n, C] indices into `starts_b`; -1 where a list is shorter, in its last places.
        length: frames of a word.
        metric: the frame distance.
        centre: [D] about the mean frame, zero if not given. Changes no Euclidean distance and keeps
            cancellation small.

    Returns:
        [n, C] float32, average distances as in `word_distances`; infinite where there is no word.
    """
    distances = np.full(lists.shape, np.inf, dtype=np.float32)
    if metric not in ("euclidean", "geodesic"):
        raise ValueError(f"metric is {metric!r}, not euclidean or geodesic")
    middle = np.zeros(frames_b.shape[1], np.float32) if centre is None else centre.astype(np.float32)
    _align_listed(frames_a, starts_a, frames_b, starts_b, lists, length, metric == "geodesic", middle, distances)
    return distances


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _align_listed(
    frames_a: Float32Array,
    starts_a: Int64Array,
    frames_b: Float32Array,
    starts_b: Int64Array,
    lists: Int64Array,
    length: int,
    geodesic: bool,
    centre: Float32Array,
    out: Float32Array,
) -> None:
    """lists [n, C] -> out [n, C]: the frames of `LANES` listed words are gathered for one matrix product."""
    width = frames_b.shape[1]
    left = np.empty((length, width), dtype=np.float32)
    right = np.zeros((LANES * length, width), dtype=np.float32)
    norms_left = np.empty(length, dtype=np.float32)
    norms_right = np.zeros(LANES * length, dtype=np.float32)
    products = np.empty((length, LANES * length), dtype=np.float32)
    lanes = np.empty((length, length * LANES), dtype=np.float32)
    scratch = np.empty(4 * (length + 1) * LANES, dtype=np.float32)
    aligned = np.empty(LANES, dtype=np.float32)
    for query in range(len(starts_a)):
        centred(frames_a, starts_a[query], centre, geodesic, left, norms_left)
        for first in range(0, lists.shape[1], LANES):
            some = lists[query, first : first + LANES]
            listed = lane_frames(
                left, norms_left, frames_b, starts_b, some, centre, geodesic, right, norms_right, products, lanes
            )
            if listed == 0:
                break
            align_block(lanes, 0, 0, length, length, scratch, aligned, True)
            out[query, first : first + listed] = aligned[:listed]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def lane_frames(
    left: Float32Array,
    norms_left: Float32Array,
    frames: Float32Array,
    starts: Int64Array,
    words: Int64Array,
    centre: Float32Array,
    geodesic: bool,
    right: Float32Array,
    norms_right: Float32Array,
    products: Float32Array,
    lanes: Float32Array,
) -> int:
    """lanes [length, length * LANES]: distances of one word's frames from those of at most `LANES` words.

    Returns how many of `words` there are before the first -1. left [length, D] and norms_left are `centred`; right
    [LANES * length, D], norms_right and products [length, LANES * length] are scratch.
    """
    length = len(left)
    listed = 0
    while listed < len(words) and words[listed] >= 0:
        rows = slice(listed * length, (listed + 1) * length)
        centred(frames, starts[words[listed]], centre, geodesic, right[rows], norms_right[rows])
        listed += 1
    if listed == 0:
        return 0
    if geodesic:
        squared_geodesics(left, right.T, products)
    else:
        np.dot(left, right.T, products)
    for i in range(length):
        for j in range(length):
            for lane in range(LANES):
                between = products[i, lane * length + j]
                if not geodesic:
                    between = norms_left[i] + norms_right[lane * length + j] - np.float32(2) * between
                lanes[i, j * LANES + lane] = between
    return listed


@njit(cache=True, nogil=True, fastmath={"reassoc", "nsz", "contract"})  # type: ignore[untyped-decorator]
def centred(
    frames: Float32Array, start: int, centre: Float32Array, geodesic: bool, out: Float32Array, norms: Float32Array
) -> None:
    """out [length, D]: the frames of one word less the centre; norms [length] squared. Quaternions stay as they are."""
    for frame in range(out.shape[0]):
        total = np.float32(0)
        for number in range(out.shape[1]):
            value = frames[start + frame, number]
            if not geodesic:
                value -= centre[number]
            out[frame, number] = value
            total += value * value
        norms[frame] = total
