"""Sub-queries of a long query by the segments that cover them, many side by side (section 7).

A lane holds a strip: some segments of the query one after another, its rows the strip's. For each column of the
repository the segments of all strips are aligned in their order, so that the last row of the segment before is known
where a segment's first row is reached: the cheapest of its w + 1 cells there, and what the path of that cell has
collected before it, go into the first row, and every cell takes over what the cell collected that its cost comes from.
So the costs of whole paths are there when a strip's last row is, and no weight matrix is kept.

Of every sub-query only those blocks of columns are kept whose least cost is among the least: the best matches are
found in them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float32Array, Int32Array, Int64Array
from motionlake.kernels import njit
from motionlake.pesta.lanes import MAX_UNROLLED
from motionlake.pesta.selection import BLOCK
from motionlake.pesta.strip_rows import next_row, rows_above
from motionlake.pesta.vectors import chosen, least, load_strip, plus, scaled, store

INFINITY = np.float32(np.inf)
MAX_WRITTEN_OUT: Final = 4  # segments of a sub-query; a kernel that is for one number of them is quicker


@njit(cache=True, nogil=True)
def strip_profile(strips: Int32Array, distances: Float32Array) -> Float32Array:
    """[m * rows * lanes] flat: distances of each symbol from each row of [lanes, rows] strips."""
    m = len(distances)
    rows = strips.T.copy().ravel()
    profile = np.empty((m, len(rows)), dtype=np.float32)
    for symbol in range(m):
        for place in range(len(rows)):
            profile[symbol, place] = distances[np.uint64(rows[place]), symbol]
    return profile.ravel()


@cache
def _wide_window(lanes: int) -> Callable[..., tuple[Any, Any]]:
    @njit(nogil=True)
    def cheapest(
        ring: Float32Array, columns: Int64Array, row: int, distance: Any, stride: int, other: int
    ) -> tuple[Any, Any]:
        """A cell's cost, as `next_row` finds it, for any stride, and what the best cell holds `other` places on."""
        best, value = distance, distance  # until the first cells have been looked at
        for p in range(1, stride + 1):
            cell = columns[p] + row - p * lanes
            low, carried = load_strip(ring, cell, lanes), load_strip(ring, cell + other, lanes)
            for k in range(2 * p):
                cell = columns[p - 1 - k] + row - p * lanes if k < p else columns[p] + row - (2 * p - 1 - k) * lanes
                cost = load_strip(ring, cell, lanes)
                carried = chosen(low, cost, load_strip(ring, cell + other, lanes), carried)
                low = least(low, cost)
            cost = plus(low, scaled(distance, np.float32(p)))
            value = carried if p == 1 else chosen(best, cost, carried, value)
            best = cost if p == 1 else least(best, cost)
        return best, value

    return cheapest


@cache
def _joined(lanes: int) -> Callable[..., Any]:
    @njit(inline="always", nogil=True)
    def joined(ring: Float32Array, columns: Int64Array, row: int, stride: int, other: int) -> Any:
        """What the cheapest cell in a last row holds `other` places further on; ties as in `LongQuery`.

        Columns before a string's first cost infinitely much.
        """
        cell = columns[1] + row
        best, value = load_strip(ring, cell, lanes), load_strip(ring, cell + other, lanes)
        for step in range(stride):
            cell = columns[0 if step == 0 else step + 1] + row
            cost = load_strip(ring, cell, lanes)
            value = chosen(best, cost, load_strip(ring, cell + other, lanes), value)
            best = least(best, cost)
        return value

    return joined


@cache
def _wide_rows(stride: int, lanes: int) -> Callable[..., None]:
    """All rows but the first of a segment in one column, for any stride and any number of tables that are carried."""
    cheapest = _wide_window(lanes)

    @njit(nogil=True)
    def rows(
        ring: Float32Array, columns: Int64Array, base: int, plane: int, profile: Float32Array, at: int, n_rows: int,
        depth: int,
    ) -> None:  # fmt: skip
        for x in range(1, n_rows):
            row = base + x * lanes
            distance = load_strip(profile, at + x * lanes, lanes)
            cost, value = cheapest(ring, columns, row, distance, stride, 0)
            for d in range(1, depth + 1):
                value = cheapest(ring, columns, row, distance, stride, d * plane)[1]
                store(ring, columns[0] + row + d * plane, value)
            store(ring, columns[0] + row, cost)

    return rows


@cache
def _rows_written_out(stride: int, carried: int, lanes: int) -> Callable[..., None]:
    """As `_wide_rows`, for one stride and number of tables: what a row has read stays in registers for the next."""

    @njit(nogil=True)
    def rows(
        ring: Float32Array, columns: Int64Array, base: int, plane: int, profile: Float32Array, at: int, n_rows: int,
        depth: int,
    ) -> None:  # fmt: skip
        if n_rows == 1:
            return
        above = rows_above(ring, columns, base, plane, stride, carried, lanes)
        distance = load_strip(profile, at + lanes, lanes)
        above = next_row(ring, columns, base + lanes, plane, stride, carried, distance, above, 1, lanes)
        for x in range(2, n_rows):
            distance, row = load_strip(profile, at + x * lanes, lanes), base + x * lanes
            above = next_row(ring, columns, row, plane, stride, carried, distance, above, stride, lanes)

    return rows


def strip_scanner(stride: int, chain: int, lanes: int) -> Callable[..., None]:
    """The kernel that aligns so many strips to strings, with one stride, for sub-queries of `chain` segments."""
    return _scanner(stride, chain if stride <= MAX_UNROLLED and chain <= MAX_WRITTEN_OUT else 0, lanes)


@cache
def _scanner(stride: int, written_out: int, lanes: int) -> Callable[..., None]:
    """written_out: the one number of segments that the kernel is for, or 0."""
    rows_0, rows_1, rows_2, rows_3 = (
        _rows_written_out(stride, depth if depth < written_out else 0, lanes) for depth in range(MAX_WRITTEN_OUT)
    )
    rows, joined = _wide_rows(stride, lanes), _joined(lanes)

    @njit(cache=True, nogil=True)
    def scan(
        profile: Float32Array,
        n_rows: int,
        segments: int,
        symbols: Int32Array,
        offsets: Int64Array,
        blocks: Int32Array,
        minima: Float32Array,
        costs: Float32Array,
        bounds: Float32Array,
    ) -> None:
        """Fill what is kept of [g * lanes] sub-queries: sub-query j of a lane has `segments` from its j-th on.

        profile: `strip_profile` of strips of g + segments - 1 segments of `n_rows`.
        blocks, minima: [g * lanes, c] blocks that are kept, -1 where there are fewer, and their least costs.
        costs: [g * lanes, c, BLOCK] end costs within them, infinite beyond the last column.
        bounds: [g * lanes] no block with a lesser minimum is left out; infinite where none is. Of those that are minus
            infinity before, nothing is kept.
        """
        chain = written_out if written_out else segments
        gap = len(bounds) // lanes
        n_segments = gap + chain - 1
        size = (stride + n_rows) * lanes
        plane = (stride + 1) * size
        ring = np.empty(n_segments * chain * plane, dtype=np.float32)
        columns = np.empty(stride + 1, dtype=np.int64)
        tile, lowest = np.empty(gap * BLOCK * lanes, dtype=np.float32), np.empty(gap * lanes, dtype=np.float32)
        last = (n_rows - 1) * lanes
        clip, begin, now = 0, 0, 0
        for first in range(0, len(symbols), BLOCK):
            stop = min(first + BLOCK, len(symbols))
            lowest[:] = INFINITY
            if stop - first < BLOCK:
                tile[:] = INFINITY
            for y in range(first, stop):
                if y == begin:
                    for segment in range(n_segments):
                        ring[segment * chain * plane : (segment * chain + 1) * plane] = INFINITY
                    while begin == y:
                        clip += 1
                        begin = offsets[clip]
                now = 0 if now == stride else now + 1
                for k in range(stride + 1):
                    columns[k] = ((now - k if now >= k else now - k + stride + 1) * size) + stride * lanes
                at = symbols[y] * n_segments * n_rows * lanes
                for segment in range(n_segments):
                    depth = min(segment, chain - 1)
                    base = segment * chain * plane
                    here = columns[0] + base
                    store(ring, here, load_strip(profile, at, lanes))
                    for d in range(1, depth + 1):
                        value = joined(ring, columns, base - chain * plane + last, stride, (d - 1) * plane)
                        store(ring, here + d * plane, value)
                    if not written_out:
                        rows(ring, columns, base, plane, profile, at, n_rows, depth)
                    elif depth == 0:
                        rows_0(ring, columns, base, plane, profile, at, n_rows, depth)
                    elif depth == 1:
                        rows_1(ring, columns, base, plane, profile, at, n_rows, depth)
                    elif depth == 2:
                        rows_2(ring, columns, base, plane, profile, at, n_rows, depth)
                    else:
                        rows_3(ring, columns, base, plane, profile, at, n_rows, depth)
                    at += n_rows * lanes
                    if segment >= chain - 1:
                        cost = load_strip(ring, here + last, lanes)
                        for d in range(1, chain):
                            cost = plus(cost, load_strip(ring, here + last + d * plane, lanes))
                        j = segment - (chain - 1)
                        store(tile, (j * BLOCK + y - first) * lanes, cost)
                        store(lowest, j * lanes, least(load_strip(lowest, j * lanes, lanes), cost))
            for each in range(gap * lanes):
                if lowest[each] < bounds[each]:
                    _keep(each, first // BLOCK, lowest[each], tile, lanes, blocks, minima, costs, bounds)

    return scan


@njit(nogil=True)
def _keep(
    each: int,
    block: int,
    low: np.float32,
    tile: Float32Array,
    lanes: int,
    blocks: Int32Array,
    minima: Float32Array,
    costs: Float32Array,
    bounds: Float32Array,
) -> None:
    """Keep a block of one sub-query, in the place of the one with the greatest minimum where there is no room."""
    kept, lows = blocks[each], minima[each]
    slot = 0
    for other in range(len(kept)):
        if kept[other] < 0:
            slot = other
            break
        if lows[other] > lows[slot]:
            slot = other
    kept[slot], lows[slot] = block, low
    if kept[-1] >= 0:
        bounds[each] = np.max(lows)
    j, lane = each // lanes, each % lanes
    for t in range(BLOCK):
        costs[each, slot, t] = tile[(j * BLOCK + t) * lanes + lane]
