"""Paths of sub-queries through the segments of a long query that cover them, compiled (section 7)."""

from __future__ import annotations

from typing import Any

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Int32Array, Int64Array
from motionlake.kernels import njit
from motionlake.pesta.matches import beginning
from motionlake.pesta.paths import Alignment, step_back, weights_of
from motionlake.pesta.selection import BLOCK, ascending_blocks, next_column

_ZERO, _INFINITY = np.float32(0), np.float32(np.inf)


@njit(cache=True, nogil=True)
def by_column(blocks: Int32Array, costs: Float32Array) -> None:
    """Put the blocks [s, c] of sub-queries, and their costs [s, c, BLOCK], in ascending order."""
    for each in range(len(blocks)):
        order = np.argsort(blocks[each])
        blocks[each], costs[each] = blocks[each][order], costs[each][order]


@njit(cache=True, nogil=True)
def alignment(segment: Int32Array, symbols: Int32Array, distances: Float32Array, stride: int) -> Alignment:
    return Alignment(segment, symbols, distances, stride, False, False, np.float32(0), np.float32(0))


@njit(cache=True, nogil=True)
def leg(a: Alignment, begin: int, near: int, last: bool, first_row: int, last_row: int) -> tuple[int, int, int, int]:
    """The part of a path that lies in one segment: the columns of its end and its beginning, of its first cell from
    `first_row` on, and of its last cell before `last_row`.

    near: the column where the path ends, in the `last` segment; else that of the top element in the segment after.

    The stretch of columns is long enough where the path lies within it: then its cost is true, and those of the other
    cells that it was compared with are no greater than the true ones.
    """
    n_columns = len(a.query) + a.stride + 1
    while True:
        low = max(begin, near + 1 - n_columns)
        weights = weights_of(a, low, near, _ZERO if low > begin else _INFINITY)
        end = near - low + a.stride
        if not last:
            here, nearest = end, max(near - a.stride, begin) - low + a.stride
            end = max(here - 1, nearest)
            for step in range(a.stride):
                other = max(here if step == 0 else here - step - 1, nearest)
                if weights[other, -1] < weights[end, -1]:
                    end = other
        x, c, first, final = len(a.query) - 1, end, end, -1
        while c >= a.stride:
            final = c if final < 0 and x < last_row else final
            first = c if x >= first_row else first
            if x == 0:
                to_columns = low - a.stride
                return end + to_columns, c + to_columns, first + to_columns, final + to_columns
            distance = a.distances[a.query[x], a.symbols[low + c - a.stride]]
            rows, columns = step_back(weights, x, c, distance, a.stride)
            x, c = x - rows, c - columns
        n_columns *= 2


@njit(cache=True, nogil=True)
def _portion(
    segments: Int32Array,
    symbols: Int32Array,
    distances: Float32Array,
    stride: int,
    begin: int,
    end: int,
    taken: BoolArray,
    first_row: int,
    last_row: int,
) -> tuple[int, int]:
    """First and last column of a path in rows [first_row, last_row) of some segments; -1, -1 if it meets a taken."""
    n, n_rows = segments.shape
    low, high = end, end
    for segment in range(n - 1, -1, -1):
        a = alignment(segments[segment], symbols, distances, stride)
        above = segment * n_rows
        _, _, first, final = leg(a, begin, low, segment == n - 1, first_row - above, last_row - above)
        low, high = first, final if segment == n - 1 else high
        if np.any(taken[low : max(low, high) + 1]):
            return -1, -1
    return low, max(low, high)


@njit(cache=True, nogil=True)
def select(
    segments: Int32Array,
    symbols: Int32Array,
    distances: Float32Array,
    stride: int,
    blocks: Int32Array,
    costs: Float32Array,
    bound: np.float32,
    offsets: Int64Array,
    inside: Int64Array,
    taken: BoolArray,
    k: int,
    limit: np.float32,
    first_row: int,
    last_row: int,
) -> tuple[Int64Array, Float32Array, bool]:
    """[h, 3] start, stop and end column of the best matches, their costs [h], and whether the blocks suffice.

    segments: [s, rows] those that cover the sub-query, which are its rows [first_row, last_row).
    """
    found, paid = np.empty((min(k, len(symbols)), 3), dtype=np.int64), np.empty(min(k, len(symbols)), dtype=np.float32)
    n = 0
    # A path that goes on below the sub-query may end on a symbol that is taken.
    whole = last_row == segments.size
    drawn = np.zeros(len(costs), dtype=np.bool_)
    heap = ascending_blocks(costs)
    while n < len(found):
        place = next_column(heap, costs, drawn)
        cost = costs[place] if place >= 0 else bound
        if not cost < min(bound, limit):
            return found[:n], paid[:n], not bound < limit if cost >= bound else True
        end: Any = np.int64(blocks[place // BLOCK]) * BLOCK + place % BLOCK
        if whole and taken[end]:
            continue
        begin = beginning(offsets, end)
        low, high = _portion(segments, symbols, distances, stride, begin, end, taken, first_row, last_row)
        if low < 0 or low < beginning(inside, high):
            continue
        taken[low : high + 1] = True
        found[n, 0], found[n, 1], found[n, 2] = low, high + 1, end
        paid[n] = cost
        n += 1
    return found[:n], paid[:n], True
