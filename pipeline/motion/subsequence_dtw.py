"""Sub-sequence dynamic time warping: where in a longer sequence a query of frames fits at the least cost."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from motionlake.motion.features import Float32Array
from motionlake.motion.frame_distance import frame_distances
from numba import njit
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

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
        query, sequence: frames.
        edge: so many frames at either end of the query are not aligned, because what was cut off there shows in them;
            the stretch is made longer by as many. Three frames are aligned at least.

    Raises:
        ValueError: the query or the sequence has no frames.
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
    found: tuple[Float64Array, IntArray] = _align(costs if squared else np.sqrt(costs), STEPS[steps])
    return found


@njit(cache=True)  # type: ignore[untyped-decorator]
def _align(distances: Float32Array, steps: IntArray) -> tuple[Float64Array, IntArray]:
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
