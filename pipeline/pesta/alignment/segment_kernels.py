"""The segments of a long query, side by side in the lanes of one scan, and the paths that join them (section 7)."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from motionlake.arrays import Float32Array, Int32Array, Int64Array
from motionlake.pesta.alignment.vectors import (
    LANES,
    MAX_UNROLLED,
    chosen,
    least,
    load,
    plus,
    scaled,
    spread,
    store,
    transpose,
    window_from,
)
from numba import njit

Columns = Int32Array  # int32 indices of columns

_INFINITY = np.float32(np.inf)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def segment_profile(segments: Int32Array, distances: Float32Array) -> Float32Array:
    """[m * rows * LANES] flat: distances of each symbol from each row of [n <= LANES, rows] segments, one in a lane."""
    m, n_rows = len(distances), segments.shape[1]
    profile = np.zeros((m, n_rows, LANES), dtype=np.float32)
    for lane in range(len(segments)):
        for x in range(n_rows):
            row = distances[segments[lane, x]]
            for symbol in range(m):
                profile[symbol, x, lane] = row[symbol]
    return profile.ravel()


@njit(nogil=True)  # type: ignore[untyped-decorator]
def _wide_window_from(
    ring: Float32Array, origins: Columns, columns: Int64Array, row: int, distance: Any, stride: int
) -> tuple[Any, Any]:
    """`vectors.window_from` for any stride."""
    best, origin = spread(_INFINITY), spread(np.int32(0))
    for p in range(1, stride + 1):
        penalty = scaled(distance, np.float32(p))
        for k in range(p, -1, -1):
            cell = columns[k] + row - p * LANES
            cost = plus(load(ring, cell), penalty)
            origin = chosen(best, cost, load(origins, cell), origin)
            best = least(best, cost)
        for k in range(p - 1, -1, -1):
            cell = columns[p] + row - k * LANES
            cost = plus(load(ring, cell), penalty)
            origin = chosen(best, cost, load(origins, cell), origin)
            best = least(best, cost)
    return best, origin


@cache
def segment_scanner(stride: int) -> Callable[..., None]:
    """The kernel that aligns up to `LANES` segments to strings at once, with one stride."""
    unrolled = stride <= MAX_UNROLLED

    @njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
    def scan(
        profile: Float32Array,
        n_rows: int,
        symbols: Int32Array,
        offsets: Int64Array,
        ends: Float32Array,
        starts: Columns,
    ) -> None:
        """Fill [used, Y] of each segment, one in a lane.

        profile: `segment_profile`.
        ends, starts: the last row of the weight matrix, and the column in which the path of each of its cells begins.
        """
        size = (stride + n_rows) * LANES
        ring = np.empty((stride + 1) * size, dtype=np.float32)
        origins = np.zeros((stride + 1) * size, dtype=np.int32)
        columns = np.empty(stride + 1, dtype=np.int64)
        costs, marks = np.empty(LANES * LANES, dtype=np.float32), np.empty(LANES * LANES, dtype=np.int32)
        turned_costs, turned_marks = np.empty_like(costs), np.empty_like(marks)
        filled = 0
        for clip in range(len(offsets) - 1):
            ring[:] = _INFINITY
            for y in range(offsets[clip], offsets[clip + 1]):
                for k in range(stride + 1):
                    columns[k] = ((y - k) % (stride + 1)) * size + stride * LANES
                at = symbols[y] * n_rows * LANES
                cost, origin = load(profile, at), spread(np.int32(y))
                store(ring, columns[0], cost)
                store(origins, columns[0], origin)
                for x in range(1, n_rows):
                    row = x * LANES
                    distance = load(profile, at + row)
                    if unrolled:
                        cost, origin = window_from(ring, origins, columns, row, distance, stride)
                    else:
                        cost, origin = _wide_window_from(ring, origins, columns, row, distance, stride)
                    store(ring, columns[0] + row, cost)
                    store(origins, columns[0] + row, origin)
                store(costs, filled * LANES, cost)
                store(marks, filled * LANES, origin)
                filled += 1
                if filled == LANES:
                    first = y + 1 - LANES
                    _put(costs, turned_costs, first, LANES, ends)
                    _put(marks, turned_marks, first, LANES, starts)
                    filled = 0
        first = len(symbols) - filled
        _put(costs, turned_costs, first, filled, ends)
        _put(marks, turned_marks, first, filled, starts)

    kernel: Callable[..., None] = scan
    return kernel


@njit(nogil=True)  # type: ignore[untyped-decorator]
def _put(tile: Any, turned: Any, first: int, count: int, out: Any) -> None:
    """out[lane, first + t] = tile[t * LANES + lane] for t < count; turned: room for a tile."""
    transpose(tile, turned)
    for lane in range(len(out)):
        if count == LANES:
            store(out, lane * out.shape[1] + first, load(turned, lane * LANES))
        else:
            out[lane, first : first + count] = turned[lane * LANES : lane * LANES + count]


@njit(inline="always", cache=True, nogil=True)  # type: ignore[untyped-decorator]
def join_column(ends: Float32Array, top: int, begin: int, stride: int) -> np.uint64:
    """The column of the segment before where a path goes on whose top element lies in column `top`.

    The least of its last row in columns [top - stride, top], not before `begin`; of equal ones the diagonal first, then
    the same column, then the nearest.
    """
    # Unsigned, lest numba look for indices that count from the end.
    column = np.uint64(max(top - 1, begin))
    best, here = ends[column], ends[np.uint64(top)]
    less = here < best
    column, best = (np.uint64(top) if less else column), (here if less else best)
    for k in range(2, stride + 1):
        back = np.uint64(max(top - k, begin))
        here = ends[back]
        less = here < best
        column, best = (back if less else column), (here if less else best)
    return column


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def joined_paths(ends: Float32Array, starts: Columns, offsets: Int64Array, stride: int) -> tuple[Float32Array, Columns]:
    """Costs and first columns [Y] of the paths that end at each column of the last of some segments.

    ends, starts: [s, Y] of those segments, in order.
    """
    costs, tops = ends[-1].copy(), starts[-1].copy()
    for segment in range(len(ends) - 2, -1, -1):
        row, row_starts = ends[segment], starts[segment]
        for clip in range(len(offsets) - 1):
            begin = offsets[clip]
            for y in range(begin, offsets[clip + 1]):
                column = join_column(row, np.int64(tops[y]), begin, stride)
                costs[y] += row[column]
                tops[y] = row_starts[column]
    return costs, tops
