"""Distances of frames, and dynamic time warping of whole clips and of a piece within a clip."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Final, Literal, NamedTuple

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.kernels import few, njit
from motionlake.motion.plain_dtw import path_costs, plain_work

Metric = Literal["euclidean", "geodesic"]


# acos(1 - x)^2 = x p(x) on 0 <= x <= 1, p of these coefficients, lowest power first: analytic up to x = 2, it needs no
# square root and 8 numbers of a Chebyshev fit.
_P0, _P1, _P2, _P3 = (np.float32(p) for p in (1.9999999, 0.33334178, 0.08871449, 0.029919637))
_P4, _P5, _P6, _P7 = (np.float32(p) for p in (0.0051539424, 0.013589262, -0.008310923, 0.004992857))


def frame_distances(a: Float32Array, b: Float32Array, metric: Metric = "euclidean") -> Float32Array:
    """[R, C] squared distances between frames `a` [R, D] and `b` [C, D]."""
    left, right = operands(a, b, metric)
    return np.maximum(product(left, np.ascontiguousarray(right.T), metric), np.float32(0))


def operands(a: Float32Array, b: Float32Array, metric: Metric) -> tuple[Float32Array, Float32Array]:
    """Rows whose `product` is the frame distance.

    Squared Euclidean distance as one inner product: [-2a, |a|^2, 1] . [b, 1, |b|^2]. Centring on the mean
    of `a` changes no distance and keeps the cancellation small.
    """
    if metric == "geodesic":
        return np.ascontiguousarray(a, dtype=np.float32), np.ascontiguousarray(b, dtype=np.float32)
    centre = a.mean(axis=0, dtype=np.float64).astype(np.float32) if len(a) else np.float32(0)
    a, b = a - centre, b - centre
    norm_a, norm_b = np.einsum("rd,rd->r", a, a), np.einsum("rd,rd->r", b, b)
    left = np.column_stack([np.float32(-2) * a, norm_a, np.ones_like(norm_a)])
    return left, np.column_stack([b, np.ones_like(norm_b), norm_b])


def product(left: Float32Array, right: Float32Array, metric: Metric) -> Float32Array:
    """[R, C] frame distances of operands [R, E] and [E, C]; may be a rounding error below zero."""
    if metric == "euclidean":
        return left @ right
    if metric == "geodesic":
        distances = np.empty((left.shape[0], right.shape[1]), dtype=np.float32)
        squared_geodesics(left, right, distances)
        return distances
    raise ValueError(f"metric is {metric!r}, not euclidean or geodesic")


@njit(cache=True, nogil=True, fastmath=True)
def squared_geodesics(a: Float32Array, b: Float32Array, out: Float32Array) -> None:
    """out[r, c] = sum over joints of acos(|a_r . b_c|)^2; a [R, 4J], b [4J, C]."""
    n_joints = a.shape[1] // 4
    n_rows, n_columns = out.shape
    tile = 64
    total = np.empty(tile, dtype=np.float32)
    one, zero = np.float32(1), np.float32(0)
    for first in range(0, n_columns, tile):
        width = min(tile, n_columns - first)
        for r in range(n_rows):
            total[:] = zero
            for joint in range(n_joints):
                w, x, y, z = a[r, 4 * joint], a[r, 4 * joint + 1], a[r, 4 * joint + 2], a[r, 4 * joint + 3]
                b_w = b[4 * joint, first : first + width]
                b_x = b[4 * joint + 1, first : first + width]
                b_y = b[4 * joint + 2, first : first + width]
                b_z = b[4 * joint + 3, first : first + width]
                for c in range(width):
                    gap = max(zero, one - abs(w * b_w[c] + x * b_x[c] + y * b_y[c] + z * b_z[c]))
                    series = _P0 + gap * (
                        _P1 + gap * (_P2 + gap * (_P3 + gap * (_P4 + gap * (_P5 + gap * (_P6 + gap * _P7)))))
                    )
                    total[c] += gap * series
            out[r, first : first + width] = total[:width]


_CELLS: Final = 1 << 20  # frame distances of many clips that are worked out at a time
# Frame pairs a second on one core, from timings.
CELLS_PER_SECOND: Final = 1.2e8


def frame_pairs(lengths: Sequence[int]) -> int:
    """How many frame distances all pairs of clips of those lengths have."""
    total = sum(lengths)
    return (total * total - sum(n * n for n in lengths)) // 2


def clip_dtw(a: Float32Array, b: Float32Array) -> float:
    """Distance of two clips [n, D] and [m, D]; `ValueError` for a clip without frames."""
    if not (len(a) and len(b)):
        raise ValueError("a clip without frames cannot be aligned")
    return float(_aligned(squared_distances(a, b)))


def clip_dtws(query: Float32Array, clips: Sequence[Float32Array]) -> Float64Array:
    """[n] distances of a query [m, D] from n clips, each [T, D]; see `clip_dtw`."""
    found = np.empty(len(clips))
    longest = max((len(clip) for clip in clips), default=0)
    at_once = max(1, _CELLS // max(1, len(query) * longest))
    for first in range(0, len(clips), at_once):
        some = clips[first : first + at_once]
        there = len(query) and all(len(clip) for clip in some)
        if there and few(plain_work(len(query), longest, len(some))):
            found[first : first + at_once] = _aligned_plainly(query, some)
        else:
            found[first : first + at_once] = [clip_dtw(query, clip) for clip in some]
    return found


def _aligned_plainly(query: Float32Array, clips: Sequence[Float32Array]) -> Float64Array:
    """The same without a kernel."""
    lengths = np.array([len(clip) for clip in clips])
    squared = np.zeros((len(query), lengths.max(), len(clips)), dtype=np.float32)
    for at, clip in enumerate(clips):
        squared[:, : len(clip), at] = squared_distances(query, clip)
    return np.asarray(path_costs(squared, lengths).astype(np.float64) / (len(query) + lengths))


def squared_distances(a: Float32Array, b: Float32Array) -> Float32Array:
    """[n, m] squared Euclidean distances of the frames of two clips [n, D] and [m, D], up to rounding (below 0 too)."""
    squared = a @ b.T
    squared *= -2
    squared += np.einsum("td,td->t", a, a)[:, None]
    squared += np.einsum("td,td->t", b, b)
    return squared


def dtw_matrix(clips: Sequence[Float32Array]) -> Float64Array:
    """[n, n] distances between all of n clips, each [T, D]; see `clip_dtw`."""
    matrix = np.zeros((len(clips), len(clips)))
    for i, j in combinations(range(len(clips)), 2):
        matrix[i, j] = matrix[j, i] = clip_dtw(clips[j], clips[i])
    return matrix


def dtw_cross(queries: Sequence[Float32Array], repository: Sequence[Float32Array]) -> Float64Array:
    """[q, r] distances of q clips from r others, each [T, D]; see `clip_dtw`."""
    return np.array([[clip_dtw(query, clip) for clip in repository] for query in queries])


@njit(cache=True)
def _aligned(squared: Float32Array) -> float:
    """Cost of the cheapest path through the roots of `squared` [n, m], divided by n + m."""
    n, m = squared.shape
    before = np.full(m + 1, np.inf, dtype=np.float32)
    row = np.empty(m, dtype=np.float32)
    before[0] = np.float32(0)
    for i in range(n):
        for j in range(m):
            row[j] = np.sqrt(max(squared[i, j], np.float32(0)))
        diagonal = before[0]
        before[0] = np.inf
        left = np.float32(np.inf)
        for j in range(m):
            above = before[j + 1]
            cost = row[j] + min(left, min(above, diagonal))
            diagonal = above
            before[j + 1] = cost
            left = cost
    return float(before[m] / (n + m))


def clip_path(a: Float32Array, b: Float32Array) -> Int64Array:
    """[p, 2] the frames of two clips [n, D] and [m, D] that the path of `clip_dtw` matches, from first to last.

    Of equal steps the one in both clips is taken, then that in the first.

    Raises:
        ValueError: a clip has no frames.
    """
    if not (len(a) and len(b)):
        raise ValueError("a clip without frames cannot be aligned")
    found: Int64Array = _path(squared_distances(a, b))
    return found


@njit(cache=True)
def _path(squared: Float32Array) -> Int64Array:
    n, m = squared.shape
    cost = np.full((n + 1, m + 1), np.inf)
    cost[0, 0] = 0
    for i in range(n):
        for j in range(m):
            through = min(cost[i, j], min(cost[i, j + 1], cost[i + 1, j]))
            cost[i + 1, j + 1] = np.sqrt(max(squared[i, j], np.float32(0))) + through
    path = np.empty((n + m, 2), dtype=np.int64)
    first, i, j = n + m, n, m
    while i > 0 and j > 0:
        first -= 1
        path[first, 0], path[first, 1] = i - 1, j - 1
        if cost[i - 1, j - 1] <= cost[i - 1, j] and cost[i - 1, j - 1] <= cost[i, j - 1]:
            i, j = i - 1, j - 1
        elif cost[i - 1, j] <= cost[i, j - 1]:
            i -= 1
        else:
            j -= 1
    return path[first:]


# Steps (query frames, sequence frames). Free: as in ordinary DTW. Limited: the tempo at most halves or doubles.
STEPS: Final = {
    "free": np.array([(1, 1), (1, 0), (0, 1)], dtype=np.int64),
    "limited": np.array([(1, 1), (2, 1), (1, 2)], dtype=np.int64),
}


class Stretch(NamedTuple):
    """Frames [start, stop) of a sequence, and what it costs to align the query with them, a matched pair."""

    start: int
    stop: int
    cost: float


def nearest_stretch(query: Float32Array, sequence: Float32Array, edge: int = 0) -> Stretch:
    """The contiguous frames of a sequence [T, D] that a whole query [m, D] aligns with at the least cost.

    Steps are free, costs are Euclidean distances of frames, summed and divided by the number of matched pairs. Of equal
    ones that which ends first.

    Args:
        query, sequence: frames, at least one each (else `ValueError`).
        edge: so many frames at either end of the query are not aligned, because what was cut off there shows in them;
            the stretch is made longer by as many. Three frames are aligned at least.
    """
    if not (len(query) and len(sequence)):
        raise ValueError("an alignment needs frames on both sides")
    left_out = max(0, min(edge, (len(query) - 3) // 2))
    costs, starts = alignment_ends(query[left_out : len(query) - left_out], sequence, "free", squared=False)
    end = int(costs.argmin())
    start, stop = int(starts[end]) - left_out, end + 1 + left_out
    return Stretch(max(0, start), min(len(sequence), stop), float(costs[end]))


def alignment_ends(
    query: Float32Array, sequence: Float32Array, steps: str, *, squared: bool
) -> tuple[Float64Array, Int64Array]:
    """The cheapest alignment of the whole query [m, D] that ends at each frame of a sequence [T, D].

    Args:
        query, sequence: frames.
        steps: name of `STEPS`.
        squared: sum squared Euclidean distances of frames instead of distances.

    Returns:
        Costs [T], divided by the number of matched pairs (inf where none ends), and the frame [T] that each
        alignment starts at. Of all paths the one of least summed cost is taken.
    """
    costs = frame_distances(query, sequence)
    found: tuple[Float64Array, Int64Array] = _align(costs if squared else np.sqrt(costs), STEPS[steps])
    return found


@njit(cache=True)
def _align(distances: Float32Array, steps: Int64Array) -> tuple[Float64Array, Int64Array]:
    m, n = distances.shape
    held = steps[:, 0].max() + 1  # rows that a step reaches back to, and the one it makes
    cost = np.full((held, n), np.inf)
    pairs = np.zeros((held, n), dtype=np.int64)
    start = np.zeros((held, n), dtype=np.int64)
    for j in range(n):
        cost[0, j], pairs[0, j], start[0, j] = distances[0, j], 1, j
    for i in range(1, m):
        row = i % held
        cost[row] = np.inf
        for j in range(n):
            for s in range(len(steps)):
                before_i, before_j = i - steps[s, 0], j - steps[s, 1]
                if before_i < 0 or before_j < 0:
                    continue
                before = before_i % held
                through = cost[before, before_j] + distances[i, j]
                if through < cost[row, j]:
                    cost[row, j] = through
                    pairs[row, j] = pairs[before, before_j] + 1
                    start[row, j] = start[before, before_j]
    last = (m - 1) % held
    return cost[last] / np.maximum(pairs[last], 1), start[last]
