"""End costs in ascending order without sorting them: a heap holds the next column of each block of columns."""

from __future__ import annotations

from heapq import heapify, heappop, heappush
from typing import Any, Final

import numpy as np
from motionlake.arrays import BoolArray, Float32Array
from motionlake.kernels import njit
from motionlake.pesta.lanes import LANES
from motionlake.pesta.vectors import least, load, store

BLOCK: Final = 128
Heap = list[tuple[np.float32, Any, Any]]  # numba tells of each number what it is
_INFINITY = np.float32(np.inf)


@njit(cache=True, nogil=True)
def ascending_blocks(costs: Float32Array) -> Heap:
    """The heap that `next_column` draws from: (cost, column, columns seen) with each block's least cost."""
    heap = [(_INFINITY, np.int64(len(costs)), np.int64(0))]
    lanes = np.empty(LANES, dtype=np.float32)
    for first in range(0, len(costs), BLOCK):
        stop = min(first + BLOCK, len(costs))
        y, low = first, _INFINITY
        if stop - first >= LANES:
            lowest = load(costs, first)
            for y in range(first + LANES, stop - LANES + 1, LANES):
                lowest = least(lowest, load(costs, y))
            store(lanes, 0, lowest)
            for lane in range(LANES):
                low = min(low, lanes[lane])
            y = first + (stop - first) // LANES * LANES
        for rest in range(y, stop):
            low = min(low, costs[rest])
        heap.append((low, np.int64(first), np.int64(0)))
    heapify(heap)
    return heap


@njit(cache=True, nogil=True)
def next_column(
    heap: Heap,
    costs: Float32Array,
    taken: BoolArray,
) -> int:
    """The column of the least cost not drawn yet and not `taken` (by column where costs are equal); -1 for none."""
    while True:
        cost, y, found = heappop(heap)
        if y == len(costs):
            return np.int64(-1)  # type: ignore[return-value]
        first = y // BLOCK * BLOCK
        stop = min(first + BLOCK, len(costs))
        if found and not taken[y]:
            _push_next(heap, costs, taken, first, stop, cost, y)
            return y  # type: ignore[no-any-return]
        _push_next(heap, costs, taken, first, stop, cost, y if found else first - 1)


@njit(cache=True, nogil=True)
def _push_next(
    heap: Heap,
    costs: Float32Array,
    taken: BoolArray,
    first: int,
    stop: int,
    cost: np.float32,
    after: int,
) -> None:
    """Put the block's least (cost, column) above (cost, after) on the heap."""
    low, column = _INFINITY, -1
    for y in range(first, stop):
        here = costs[y]
        if here < low and (here > cost or (here == cost and y > after)) and not taken[y]:
            low, column = here, y
    if column >= 0:
        heappush(heap, (low, np.int64(column), np.int64(1)))
