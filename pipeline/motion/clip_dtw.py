"""Dynamic time warping of whole clips: Euclidean distance of frames; steps (1, 1), (1, 0), (0, 1).

The distance of two clips is the cost of the cheapest path divided by n + m.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

# Frame pairs a second on one core, from timings.
CELLS_PER_SECOND: Final = 1.2e8


def frame_pairs(lengths: Sequence[int]) -> int:
    """How many frame distances all pairs of clips of those lengths have."""
    total = sum(lengths)
    return (total * total - sum(n * n for n in lengths)) // 2


def clip_dtw(a: Float32Array, b: Float32Array) -> float:
    """Distance of two clips [n, D] and [m, D]."""
    return float(_aligned(squared_distances(a, b)))


def squared_distances(a: Float32Array, b: Float32Array) -> Float32Array:
    """[n, m] squared Euclidean distances of the frames of two clips [n, D] and [m, D], up to rounding (below 0 too)."""
    return np.asarray(_frame_distances(a, b, _squares(a), _squares(b)), dtype=np.float32)


def dtw_matrix(clips: Sequence[Float32Array], progress: Callable[[int, int], None] | None = None) -> Float64Array:
    """[n, n] distances between all of n clips, each [T, D]; `progress` hears rows done and n.

    Raises:
        ValueError: a clip without frames.
    """
    if any(not len(clip) for clip in clips):
        raise ValueError("a clip without frames cannot be aligned")
    squares = [_squares(clip) for clip in clips]
    matrix = np.zeros((len(clips), len(clips)))
    for i, clip in enumerate(clips):
        for j in range(i):
            distances = _frame_distances(clip, clips[j], squares[i], squares[j])
            matrix[i, j] = matrix[j, i] = _aligned(distances)
        if progress is not None:
            progress(i + 1, len(clips))
    return matrix


def dtw_cross(queries: Sequence[Float32Array], repository: Sequence[Float32Array]) -> Float64Array:
    """[q, r] distances of q clips from r others, each [T, D].

    Raises:
        ValueError: a clip without frames.
    """
    if any(not len(clip) for clip in (*queries, *repository)):
        raise ValueError("a clip without frames cannot be aligned")
    squares = [_squares(clip) for clip in repository]
    matrix = np.empty((len(queries), len(repository)))
    for row, query in zip(matrix, queries, strict=True):
        own = _squares(query)
        for j, (clip, known) in enumerate(zip(repository, squares, strict=True)):
            row[j] = _aligned(_frame_distances(query, clip, own, known))
    return matrix


def _squares(clip: Float32Array) -> Float32Array:
    return np.asarray(np.einsum("td,td->t", clip, clip), dtype=np.float32)


def _frame_distances(a: Float32Array, b: Float32Array, a_squares: Float32Array, b_squares: Float32Array) -> Any:
    """[n, m] squared Euclidean distances; `_aligned` takes their root."""
    squared = a @ b.T
    squared *= -2
    squared += a_squares[:, None]
    squared += b_squares
    return squared


@njit(cache=True)  # type: ignore[untyped-decorator]
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
