"""The path of one match: the weight matrix over the columns that the path needs, followed back from its end.

Only a stretch of columns before the end is computed. The columns before the stretch are given costs that are no greater
than their true ones; a path that never enters them is therefore the path of the whole matrix, and where it does enter
them, the stretch is made longer, at most to the string's first column.

Ties: of cells that give the same cost, one fewer steps away is taken first, and of those equally far the diagonal, then
those as many rows back by falling column, then those as many columns back by falling row.
"""

from __future__ import annotations

import numpy as np
from motionlake.arrays import Float32Array, Int32Array, Int64Array
from numba import njit

_ZERO = np.float32(0)
_INFINITY = np.float32(np.inf)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def trace(
    query: Int32Array,
    symbols: Int32Array,
    begin: int,
    end: int,
    distances: Float32Array,
    stride: int,
    local: bool,
    threshold: np.float32,
    gap: np.float32,
) -> Int64Array:
    """[L, 2] path (query index, string index) of the best match that ends with symbol `end` of a string from `begin`.

    Of a local alignment, the pairs that are matched; none where it matches nothing.
    """
    n_columns = len(query) + 8
    inside = False
    path = np.empty((0, 2), dtype=np.int64)
    while not inside:
        low = max(begin, end + 1 - n_columns)
        left = low > begin
        if local:
            weights = _local_weights(query, symbols, low, end, distances, threshold, gap, left)
            path, inside = _local_path(query, symbols, low, end, distances, threshold, gap, left, weights)
        else:
            weights = strided_weights(query, symbols, low, end, distances, stride, _ZERO if left else _INFINITY)
            path, inside = strided_path(query, symbols, low, end, distances, stride, weights)
        n_columns *= 2
    return path


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def strided_weights(
    query: Int32Array,
    symbols: Int32Array,
    low: int,
    end: int,
    distances: Float32Array,
    stride: int,
    before: np.float32,
) -> Float32Array:
    """[stride + columns, X] of section 6 for symbols[low : end + 1], after `stride` columns that all cost `before`."""
    n_rows = len(query)
    weights = np.empty((stride + end + 1 - low, n_rows), dtype=np.float32)
    weights[:stride] = before
    for y in range(low, end + 1):
        c = y - low + stride
        weights[c, 0] = distances[query[0], symbols[y]]
        for x in range(1, n_rows):
            distance = distances[query[x], symbols[y]]
            best = _INFINITY
            for p in range(1, min(stride, x) + 1):
                nearest = weights[c - p, x - p]
                for k in range(p):
                    nearest = min(nearest, min(weights[c - k, x - p], weights[c - p, x - k]))
                best = min(best, nearest + distance * np.float32(p))
            for p in range(x + 1, stride + 1):
                nearest = weights[c - p, x]
                for k in range(1, x + 1):
                    nearest = min(nearest, weights[c - p, x - k])
                best = min(best, nearest + distance * np.float32(p))
            weights[c, x] = best
    return weights


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def strided_path(
    query: Int32Array,
    symbols: Int32Array,
    low: int,
    end: int,
    distances: Float32Array,
    stride: int,
    weights: Float32Array,
) -> tuple[Int64Array, bool]:
    """The path back from the last row in column `end`, and whether it stays in the columns from `low`."""
    reverse = np.empty((len(query) + end + 1 - low, 2), dtype=np.int64)
    x, y, n = len(query) - 1, end, 1
    reverse[0, 0], reverse[0, 1] = x, y
    while x > 0:
        rows, columns = _step(weights, x, y - low + stride, distances[query[x], symbols[y]], stride)
        x, y = x - rows, y - columns
        if y < low:
            return reverse[:0], False
        reverse[n, 0], reverse[n, 1] = x, y
        n += 1
    return reverse[:n][::-1].copy(), True


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _step(weights: Float32Array, x: int, c: int, distance: np.float32, stride: int) -> tuple[int, int]:
    """Rows and columns back to the cell that the cost of a cell comes from."""
    cost = weights[c, x]
    for p in range(1, stride + 1):
        penalty = distance * np.float32(p)
        if p <= x:
            for k in range(p, -1, -1):
                if weights[c - k, x - p] + penalty == cost:
                    return p, k
        for k in range(min(p - 1, x), -1, -1):
            if weights[c - p, x - k] + penalty == cost:
                return k, p
    return 1, 0


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _local_weights(
    query: Int32Array,
    symbols: Int32Array,
    low: int,
    end: int,
    distances: Float32Array,
    threshold: np.float32,
    gap: np.float32,
    left: bool,
) -> Float32Array:
    """[1 + columns, 1 + X]: costs of local alignment; row 0 matches nothing.

    Where columns are left out before the first, they cost as little as they can: every symbol matched by itself.
    """
    n_rows = len(query)
    weights = np.zeros((end + 2 - low, n_rows + 1), dtype=np.float32)
    if left:
        for x in range(1, n_rows + 1):
            weights[0, x] = weights[0, x - 1] - threshold
    for y in range(low, end + 1):
        c = y - low + 1
        for x in range(1, n_rows + 1):
            matched = weights[c - 1, x - 1] + (distances[query[x - 1], symbols[y]] - threshold)
            skipped = min(weights[c, x - 1], weights[c - 1, x]) + gap
            weights[c, x] = min(_ZERO, min(matched, skipped))
    return weights


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _local_path(
    query: Int32Array,
    symbols: Int32Array,
    low: int,
    end: int,
    distances: Float32Array,
    threshold: np.float32,
    gap: np.float32,
    left: bool,
    weights: Float32Array,
) -> tuple[Int64Array, bool]:
    """The matched pairs back from the least cost of column `end`, and whether all lie in the columns from `low`."""
    reverse = np.empty((len(query), 2), dtype=np.int64)
    c, n = end + 1 - low, 0
    x = 0
    for row in range(1, len(query) + 1):
        if weights[c, row] < weights[c, x]:
            x = row
    while x > 0 and weights[c, x] < _ZERO:
        if c == 0:
            return reverse[:0], False
        cost = weights[c, x]
        if weights[c - 1, x - 1] + (distances[query[x - 1], symbols[low + c - 1]] - threshold) == cost:
            x, c = x - 1, c - 1
            reverse[n, 0], reverse[n, 1] = x, low + c
            n += 1
        elif weights[c, x - 1] + gap == cost:
            x -= 1
        else:
            c -= 1
    return reverse[:n][::-1].copy(), True
