"""The recurrence of section 6 over many strings side by side, one in each lane, by a ring of the last w columns.

W(1, y) = D(e_1, s_y); W(x, y) = min over the window of W(m, n) + D(e_x, s_y) * max(x - m, y - n). A window reaches no
further back than the string's first column. All costs are float32, and since rounding keeps the order of numbers, the
minimum does not depend on the order in which cells are looked at.

With gaps W(x, y) is no more than W(x - 1, y) + query gap, where the query's symbol is left out, nor than W(x, y - 1) +
clip gap, where the clip's is. Before the first row costs are nothing.

Smith-Waterman ("local") is kept as costs, so that smaller is better: C(x, y) = min(0, C(x-1, y-1) + D - threshold,
C(x-1, y) + gap, C(x, y-1) + gap), and a column ends at the least of its rows.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from motionlake.arrays import Float32Array, Int32Array, Int64Array
from motionlake.kernels import njit
from motionlake.pesta.lanes import LANES, MAX_UNROLLED, ROWS
from motionlake.pesta.strip_rows import next_row, rows_above
from motionlake.pesta.vectors import least, load, load_rows, plus, scaled, spread, store, window

ZERO = np.float32(0)
INFINITY = np.float32(np.inf)


@njit(cache=True, nogil=True)
def query_profile(query: Int32Array, distances: Float32Array) -> Float32Array:
    """[m * width] flat: the distances of each symbol from the query's, one after another, filled up with zeros.

    width: the query's length, rounded up to a multiple of `ROWS`.
    """
    m = len(distances)
    width = -(-len(query) // ROWS) * ROWS
    profile = np.zeros(m * width, dtype=np.float32)
    for x in range(len(query)):
        row = distances[query[x]]
        for symbol in range(m):
            profile[symbol * width + x] = row[symbol]
    return profile


@njit(cache=True, nogil=True)
def query_profiles(
    symbols: Int32Array, starts: Int64Array, lengths: Int64Array, text: Int32Array, distances: Float32Array
) -> Float32Array:
    """[c * n * width] flat: `query_profile` of each of c queries, of n symbols of a text alone.

    The place of a symbol among these stands for it, counted on from query to query.

    symbols, starts, lengths: query c is `symbols[starts[c] : starts[c] + lengths[c]]`; the longest is the first.
    text: [n] symbols, each once.
    """
    width = -(-lengths[0] // ROWS) * ROWS
    profiles = np.zeros(len(lengths) * len(text) * width, dtype=np.float32)
    far = np.empty(len(distances), dtype=np.float32)
    unsigned = symbols.view(np.uint32)  # a sign would be looked at for each
    for t in range(len(text)):
        for symbol in range(len(distances)):
            far[symbol] = distances[symbol, text[t]]
        for c in range(len(lengths)):
            first, own = (c * len(text) + t) * width, unsigned[starts[c] : starts[c] + lengths[c]]
            row = profiles[first : first + len(own)]
            for x in range(len(own)):
                row[x] = far[own[x]]
    return profiles


@njit(nogil=True)
def _wide_window(ring: Float32Array, columns: Int64Array, row: int, above: Any, distance: Any, stride: int) -> Any:
    """`vectors.window` for any stride."""
    best = plus(above, distance)
    for p in range(stride, 0, -1):
        low = load(ring, columns[p] + row)
        for k in range(1, p + 1):
            low = least(low, load(ring, columns[p] + row - k * LANES))
        for k in range(p - 1, 0, -1):
            low = least(low, load(ring, columns[k] + row - p * LANES))
        if p > 1:
            low = least(low, load(ring, columns[0] + row - p * LANES))
        best = least(best, plus(low, scaled(distance, np.float32(p))))
    return best


@cache
def scanner(stride: int, gapped: bool = False) -> Callable[..., None]:
    """The kernel that scans strings with one stride, with gaps or without."""
    unrolled = stride <= MAX_UNROLLED
    # Of a row's last cells the cheapest is found once for all rows below.
    shared = unrolled and stride > 1 and not gapped

    @njit(cache=True, nogil=True)
    def scan(
        profile: Float32Array,
        n_rows: int,
        local: bool,
        threshold: np.float32,
        gap: np.float32,
        symbols: Int32Array,
        rows: Int64Array,
        pieces: Int64Array,
        warm: int,
        full: int,
        initial: Float32Array,
        entries: Float32Array,
        exits: Float32Array,
        ends: Float32Array,
        best: Float32Array,
    ) -> None:
        """Scan pieces of strings, `LANES` at a time.

        profile: `query_profile` of a query of `n_rows`.
        rows: [n] how many of these each piece is aligned with, most first; or of length 0, where all are. Not for
            Smith-Waterman.
        threshold, gap: `SymbolDistances.scores`.
        pieces: [n, 4] where a piece is scanned from, kept from and stops, and where its least end cost goes, -1 for
            nowhere; longest first.
        warm, full: columns that a cut piece is scanned before it is kept, and columns scanned of a piece that another
            continues.
        initial: [n, stride, rows] the columns before each piece, the latest first; or of length 0, where it begins a
            string.
        entries, exits: [n, stride, rows] the last columns before the first one kept and up to the last one, the
            latest first, of cut pieces; or of length 0.
        ends: [Y] end cost of every column, or length 0.
        best: least end costs, or length 0.
        """
        width = -(-n_rows // ROWS) * ROWS
        outside = ZERO if local else INFINITY
        size = (stride + n_rows) * LANES
        ring = np.empty((stride + 1) * size, dtype=np.float32)
        columns = np.empty(stride + 1, dtype=np.int64)
        nearby = np.empty(ROWS * LANES, dtype=np.float32)
        at = np.zeros(LANES, dtype=np.int64)
        last = np.zeros(LANES, dtype=np.int64)
        begin = np.zeros(LANES, dtype=np.int64)
        bottom = np.empty((np.max(pieces[:, 2] - pieces[:, 0]) if len(pieces) else 0) * LANES, dtype=np.float32)
        for group in range(0, len(pieces), LANES):
            used = min(LANES, len(pieces) - group)
            for lane in range(LANES):
                piece = group + min(lane, used - 1)
                begin[lane], last[lane] = pieces[piece, 0], max(pieces[piece, 2] - 1, pieces[piece, 0])
            n_columns = pieces[group, 2] - pieces[group, 0]
            if n_columns == 0:
                break
            most_rows = rows[group] if len(rows) else n_rows
            ring[:] = outside
            if len(initial):
                for lane in range(used):
                    for k in range(stride):
                        for x in range(n_rows):
                            ring[(k + 1) * size + (stride + x) * LANES + lane] = initial[group + lane, k, x]
            for t in range(n_columns):
                for lane in range(LANES):
                    at[lane] = symbols[min(begin[lane] + t, last[lane])] * width
                for k in range(stride + 1):
                    columns[k] = ((t - k) % (stride + 1)) * size + stride * LANES
                lowest = spread(ZERO)
                if shared and not local:
                    load_rows(profile, at, 0, nearby)
                    store(ring, columns[0], load(nearby, 0))
                    ways = rows_above(ring, columns, 0, 0, stride, 0, LANES)
                    for x in range(1, most_rows):
                        if x % ROWS == 0:
                            load_rows(profile, at, x, nearby)
                        distance = load(nearby, (x % ROWS) * LANES)
                        ways = next_row(ring, columns, x * LANES, 0, stride, 0, distance, ways, stride, LANES)
                    above = load(ring, columns[0] + (most_rows - 1) * LANES)
                else:
                    above = spread(outside)
                    for x in range(most_rows):
                        if x % ROWS == 0:
                            load_rows(profile, at, x, nearby)
                        distance = load(nearby, (x % ROWS) * LANES)
                        row = x * LANES
                        if local:
                            cost = plus(load(ring, columns[1] + row - LANES), plus(distance, spread(-threshold)))
                            skipped = least(above, load(ring, columns[1] + row))
                            cost = least(least(cost, plus(skipped, spread(gap))), spread(ZERO))
                            lowest = least(lowest, cost)
                        elif x == 0:
                            cost = distance
                        elif unrolled:
                            cost = window(ring, columns, row, above, distance, stride)
                        else:
                            cost = _wide_window(ring, columns, row, above, distance, stride)
                        if gapped:
                            left_out = spread(threshold) if x == 0 else plus(above, spread(threshold))
                            cost = least(cost, least(plus(load(ring, columns[1] + row), spread(gap)), left_out))
                        store(ring, columns[0] + row, cost)
                        above = cost
                store(bottom, t * LANES, lowest if local else above)
                if len(rows):
                    for lane in range(used):
                        last_row = columns[0] + (rows[group + lane] - 1) * LANES + lane
                        bottom[t * LANES + lane] = ring[last_row]
                if len(exits) and ((warm - stride <= t < warm) or (full - stride <= t < full)):
                    entering = t < warm
                    states = entries if entering else exits
                    k = t - ((warm if entering else full) - stride)
                    for lane in range(used):
                        for x in range(n_rows):
                            states[group + lane, stride - 1 - k, x] = ring[columns[0] + x * LANES + lane]
            for lane in range(used):
                first, kept, stop, target = pieces[group + lane]
                if len(ends):
                    for y in range(kept, stop):
                        ends[y] = bottom[(y - first) * LANES + lane]
                if len(best) and target >= 0:
                    low = INFINITY
                    for y in range(kept, stop):
                        low = min(low, bottom[(y - first) * LANES + lane])
                    best[target] = low

    return scan
