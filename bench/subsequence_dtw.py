"""Sub-sequence DTW on frames, the baseline of query by example: a query aligned anywhere in a longer sequence."""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.words.features import Float32Array
from pipeline.words.frame_distance import frame_distances

Float64Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Steps (query frames, sequence frames). Free: as in ordinary DTW. Limited: the tempo at most halves or doubles.
STEPS: Final = {
    "free": np.array([(1, 1), (1, 0), (0, 1)], dtype=np.int64),
    "limited": np.array([(1, 1), (2, 1), (1, 2)], dtype=np.int64),
}


def alignment_ends(
    query: Float32Array, sequence: Float32Array, steps: str, *, squared: bool
) -> tuple[Float64Array, IntArray]:
    """The cheapest alignment of the whole query that ends at each frame of a sequence.

    Args:
        query: [m, D] frames.
        sequence: [T, D] frames.
        steps: name of `STEPS`.
        squared: sum squared Euclidean distances of frames instead of distances.

    Returns:
        Costs [T], divided by the number of matched pairs (inf where none ends), and the frame [T] that each
        alignment starts at. Of all paths the one of least summed cost is taken.
    """
    costs = frame_distances(query, sequence)
    return _align(costs if squared else np.sqrt(costs), STEPS[steps])


def frame_costs(costs: Float64Array, starts: IntArray) -> Float64Array:
    """[T] cost of the cheapest alignment that covers each frame; where none does, that of the dearest."""
    covered = np.full(len(costs), np.inf)
    for end in range(len(costs)):
        span = covered[starts[end] : end + 1]
        np.minimum(span, costs[end], out=span)
    covered[~np.isfinite(covered)] = np.max(covered[np.isfinite(covered)], initial=0.0)
    return covered


@njit(cache=True)  # type: ignore[untyped-decorator]
def _align(distances: Float32Array, steps: IntArray) -> tuple[Float64Array, IntArray]:
    m, n = distances.shape
    cost = np.full((m, n), np.inf)
    pairs = np.zeros((m, n), dtype=np.int64)
    start = np.zeros((m, n), dtype=np.int64)
    for j in range(n):
        cost[0, j], pairs[0, j], start[0, j] = distances[0, j], 1, j
    for i in range(1, m):
        for j in range(n):
            for s in range(len(steps)):
                before_i, before_j = i - steps[s, 0], j - steps[s, 1]
                if before_i < 0 or before_j < 0:
                    continue
                through = cost[before_i, before_j] + distances[i, j]
                if through < cost[i, j]:
                    cost[i, j] = through
                    pairs[i, j] = pairs[before_i, before_j] + 1
                    start[i, j] = start[before_i, before_j]
    return cost[m - 1] / np.maximum(pairs[m - 1], 1), start[m - 1]
