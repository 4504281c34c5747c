"""The path of a match, followed back from its end through the weight matrix (section 6).

Only a stretch of columns before the end is computed. The columns before the stretch are given costs that are no greater
than their true ones; a path that never enters them is therefore the path of the whole matrix, and where it does enter
them, the stretch is made longer, at most to the string's first column.

With gaps (`AlignmentConfig.gaps`), symbols that are left out are not in the path.

Ties: of cells equally far the cheapest is taken, and of equal ones the diagonal, then those as many rows back by
falling column, then those as many columns back by falling row; where cells at different distances give the same cost,
one fewer steps away. Then a symbol of the clip is left out, then one of the query.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from motionlake.arrays import Float32Array, Int32Array, Int64Array
from motionlake.kernels import njit

_ZERO = np.float32(0)
_INFINITY = np.float32(np.inf)


class Alignment(NamedTuple):
    """A query and the strings that it is aligned to, as kernels read them.

    Attributes:
        query, symbols: [X] and [Y] symbols.
        distances: [m, m] of the dictionary's symbols.
        stride: w.
        local: Smith-Waterman, by `threshold` and `gap`.
        gapped: strided, with gaps: `threshold` is what a symbol left out of the query costs, `gap` of the clip.
    """

    query: Int32Array
    symbols: Int32Array
    distances: Float32Array
    stride: int
    local: bool
    gapped: bool
    threshold: np.float32
    gap: np.float32


@njit(cache=True, nogil=True)
def trace(a: Alignment, begin: int, end: int) -> Int64Array:
    """[L, 2] path (query index, string index) of the best match that ends with symbol `end` of a string from `begin`.

    Of a local alignment, the pairs that are matched; none where it matches nothing.
    """
    n_columns = len(a.query) + 8
    inside = False
    path = np.empty((0, 2), dtype=np.int64)
    while not inside:
        low = max(begin, end + 1 - n_columns)
        if a.local:
            path, inside = _local_path(a, low, end, low > begin)
        elif a.gapped:
            path, inside = _gapped_path(a, low, end, _ZERO if low > begin else _INFINITY)
        else:
            path, inside = _strided_path(a, low, end, _ZERO if low > begin else _INFINITY)
        n_columns *= 2
    return path


@njit(cache=True, nogil=True)
def weights_of(a: Alignment, low: int, end: int, before: np.float32) -> Float32Array:
    """[stride + columns, X] of section 6 for symbols[low : end + 1], after `stride` columns that all cost `before`."""
    weights = np.empty((a.stride + end + 1 - low, len(a.query)), dtype=np.float32)
    weights[: a.stride] = before
    for y in range(low, end + 1):
        c = y - low + a.stride
        weights[c, 0] = a.distances[a.query[0], a.symbols[y]]
        if a.gapped:
            weights[c, 0] = min(weights[c, 0], min(weights[c - 1, 0] + a.gap, a.threshold))
        for x in range(1, len(a.query)):
            distance = a.distances[a.query[x], a.symbols[y]]
            best = _INFINITY
            for p in range(1, min(a.stride, x) + 1):
                nearest = weights[c - p, x - p]
                for k in range(p):
                    nearest = min(nearest, min(weights[c - k, x - p], weights[c - p, x - k]))
                best = min(best, nearest + distance * np.float32(p))
            for p in range(x + 1, a.stride + 1):
                nearest = weights[c - p, x]
                for k in range(1, x + 1):
                    nearest = min(nearest, weights[c - p, x - k])
                best = min(best, nearest + distance * np.float32(p))
            if a.gapped:
                best = min(best, min(weights[c - 1, x] + a.gap, weights[c, x - 1] + a.threshold))
            weights[c, x] = best
    return weights


@njit(cache=True, nogil=True)
def _strided_path(a: Alignment, low: int, end: int, before: np.float32) -> tuple[Int64Array, bool]:
    """The path back from the last row in column `end`, and whether it stays in the columns from `low`.

    before: what the columns before `low` cost.
    """
    weights = weights_of(a, low, end, before)
    reverse = np.empty((len(a.query) + end + 1 - low, 2), dtype=np.int64)
    x, y, n = len(a.query) - 1, end, 1
    reverse[0, 0], reverse[0, 1] = x, y
    while x > 0:
        rows, columns = step_back(weights, x, y - low + a.stride, a.distances[a.query[x], a.symbols[y]], a.stride)
        x, y = x - rows, y - columns
        if y < low:
            return reverse[:0], False
        reverse[n, 0], reverse[n, 1] = x, y
        n += 1
    return reverse[:n][::-1].copy(), True


@njit(cache=True, nogil=True)
def _gapped_path(a: Alignment, low: int, end: int, before: np.float32) -> tuple[Int64Array, bool]:
    """As `_strided_path`, the matched pairs alone."""
    weights = weights_of(a, low, end, before)
    reverse = np.empty((len(a.query) + end + 1 - low, 2), dtype=np.int64)
    x, y, n = len(a.query) - 1, end, 0
    while True:
        c, distance = y - low + a.stride, a.distances[a.query[x], a.symbols[y]]
        rows, columns = (0, 0) if x == 0 else step_back(weights, x, c, distance, a.stride)
        if (weights[c, 0] == distance) if x == 0 else rows or columns:
            reverse[n, 0], reverse[n, 1] = x, y
            n += 1
            if x == 0:
                break
            x, y = x - rows, y - columns
        elif weights[c - 1, x] + a.gap == weights[c, x]:
            y -= 1
        elif x == 0:
            break
        else:
            x -= 1
        if y < low:
            return reverse[:0], False
    return reverse[:n][::-1].copy(), True


@njit(cache=True, nogil=True)
def step_back(weights: Float32Array, x: int, c: int, distance: np.float32, stride: int) -> tuple[int, int]:
    """Rows and columns back to the cell that the cost of a cell comes from; 0 and 0 where it comes from a gap."""
    cost = weights[c, x]
    for p in range(1, stride + 1):
        low, rows, columns = _INFINITY, 0, 0
        if p <= x:
            for k in range(p, -1, -1):
                if weights[c - k, x - p] < low:
                    low, rows, columns = weights[c - k, x - p], p, k
        for k in range(min(p - 1, x), -1, -1):
            if weights[c - p, x - k] < low:
                low, rows, columns = weights[c - p, x - k], k, p
        if low + distance * np.float32(p) == cost:
            return rows, columns
    return 0, 0


@njit(cache=True, nogil=True)
def _local_path(a: Alignment, low: int, end: int, left: bool) -> tuple[Int64Array, bool]:
    """The matched pairs back from the least cost of column `end`, and whether all lie in the columns from `low`.

    left: columns are left out before `low`. They cost as little as they can: every symbol matched by itself.
    """
    n_rows = len(a.query)
    weights = np.zeros((end + 2 - low, n_rows + 1), dtype=np.float32)  # row 0 matches nothing
    if left:
        for x in range(1, n_rows + 1):
            weights[0, x] = weights[0, x - 1] - a.threshold
    for y in range(low, end + 1):
        c = y - low + 1
        for x in range(1, n_rows + 1):
            matched = weights[c - 1, x - 1] + (a.distances[a.query[x - 1], a.symbols[y]] - a.threshold)
            skipped = min(weights[c, x - 1], weights[c - 1, x]) + a.gap
            weights[c, x] = min(_ZERO, min(matched, skipped))
    reverse = np.empty((n_rows, 2), dtype=np.int64)
    c, n = end + 1 - low, 0
    x = int(np.argmin(weights[c]))
    while x > 0 and weights[c, x] < _ZERO:
        if c == 0:
            return reverse[:0], False
        cost = weights[c, x]
        if weights[c - 1, x - 1] + (a.distances[a.query[x - 1], a.symbols[low + c - 1]] - a.threshold) == cost:
            x, c = x - 1, c - 1
            reverse[n, 0], reverse[n, 1] = x, low + c
            n += 1
        elif weights[c, x - 1] + a.gap == cost:
            x -= 1
        else:
            c -= 1
    return reverse[:n][::-1].copy(), True
