"""The best matches of a query that do not overlap, and the path of each (section 6).

The path of a match is followed back from its end through the weight matrix, of which only a stretch of columns before
the end is computed. The columns before the stretch are given costs that are no greater than their true ones; a path
that never enters them is therefore the path of the whole matrix, and where it does enter them, the stretch is made
longer, at most to the string's first column.

Ties: of cells that give the same cost, one fewer steps away is taken first, and of those equally far the diagonal, then
those as many rows back by falling column, then those as many columns back by falling row.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Int32Array, Int64Array
from motionlake.kernels import njit
from motionlake.pesta.config import DEFAULT_ALIGNMENT, AlignmentConfig
from motionlake.pesta.scan import scan_ends
from motionlake.pesta.selection import ascending_blocks, next_column
from motionlake.pesta.strings import Boundaries, Distances, Repository, checked
from numpy.typing import ArrayLike

_ZERO = np.float32(0)
_INFINITY = np.float32(np.inf)


class Alignment(NamedTuple):
    """A query and the strings that it is aligned to, as kernels read them.

    Attributes:
        query, symbols: [X] and [Y] symbols.
        distances: [m, m] of the dictionary's symbols.
        stride: w.
        local: Smith-Waterman, by `threshold` and `gap`.
    """

    query: Int32Array
    symbols: Int32Array
    distances: Float32Array
    stride: int
    local: bool
    threshold: np.float32
    gap: np.float32


@dataclass(frozen=True)
class Match:
    """A sub-sequence of the repository that is like a query.

    Attributes:
        clip: index of the clip it begins in.
        start, stop: symbols [start, stop) of that clip's string. Where boundaries are crossed, stop may lie beyond the
            clip's end and counts on through the clips after it.
        cost: W(X, y); of "sw", minus the score.
        path: [L, 2] pairs (query index, string index, counted from the clip's first symbol) in ascending order; None
            where no paths were requested. A strided path leaves out symbols that it strides over.
    """

    clip: int
    start: int
    stop: int
    cost: float
    path: Int64Array | None = None


def best_matches(
    query: ArrayLike,
    repository: Repository,
    distances: Distances,
    k: int,
    config: AlignmentConfig = DEFAULT_ALIGNMENT,
    *,
    boundaries: Boundaries = "kept",
    barred: BoolArray | None = None,
    below: float = np.inf,
    paths: bool = False,
    threads: int = 1,
) -> list[Match]:
    """The k best matches that do not overlap (section 6).

    Columns are visited in ascending end cost, by position where costs are equal; a match that shares a symbol with one
    found before is dropped.

    Args:
        query: [X] symbols.
        repository: where to look.
        distances: [m, m] of the dictionary's symbols.
        k: how many matches at most.
        config: the alignment.
        boundaries: "kept" aligns each clip by itself; "crossed" makes one string of all clips; "dropped" does so too,
            but drops matches that cross from one clip into another.
        barred: [Y] symbols that no match may cover, such as the query itself.
        below: only matches that cost less (U_d of section 3).
        paths: give every match its path.
        threads: which share the scan; the result does not depend on their number.

    Returns:
        Matches in ascending cost, ties by clip and position. Of "sw", only matches of a score above zero.

    Raises:
        ValueError: an empty query, a symbol outside the dictionary, k below 0, `barred` of another length.
    """
    if k < 0:
        raise ValueError(f"k is {k}: it is at least 0")
    symbols, ground = checked(query, repository, distances)
    strings = repository.aligned(boundaries)
    taken = taken_symbols(barred, len(repository.symbols))
    ends = scan_ends(symbols, strings, ground, config, threads)
    alignment = Alignment(
        symbols, strings.symbols, ground.matrix, config.reach, config.local, *ground.scores(config)
    )  # fmt: skip
    inside = repository.offsets if boundaries == "dropped" else strings.offsets
    limit = np.float32(min(below, 0.0) if config.local else below)
    # Fields go to the kernel one by one: numba takes longer to recognise a named tuple.
    found = _select(*alignment, ends, strings.offsets, inside, taken, k, limit)

    def path(end: int) -> Int64Array:
        traced: Int64Array = trace(alignment, beginning(strings.offsets, end), end)
        return traced

    return placed(found, ends[found[:, 2]], repository, path if paths else None)


def placed(
    found: Int64Array, costs: Float32Array, repository: Repository, path: Callable[[int], Int64Array] | None
) -> list[Match]:
    """Matches as users see them, counted from the first symbol of their clips.

    Args:
        found: [h, 3] start, stop and end column.
        costs: [h].
        repository: that the columns are of.
        path: of the match that ends in a column; None leaves paths out.
    """
    clips = np.searchsorted(repository.offsets, found[:, 0], side="right") - 1
    rows = zip(found.tolist(), clips.tolist(), repository.offsets[clips].tolist(), costs.tolist(), strict=True)
    if path is None:
        return [Match(clip, start - first, stop - first, cost) for (start, stop, _), clip, first, cost in rows]
    return [
        Match(clip, start - first, stop - first, cost, path(end) - np.array([0, first]))
        for (start, stop, end), clip, first, cost in rows
    ]


def taken_symbols(barred: BoolArray | None, n_symbols: int) -> BoolArray:
    """[Y] a fresh mask of the symbols that no match may cover.

    Raises:
        ValueError: a mask of another length.
    """
    mask = np.zeros(n_symbols, dtype=np.bool_) if barred is None else np.array(barred, dtype=np.bool_)
    if mask.shape != (n_symbols,):
        raise ValueError(f"barred is [Y] = [{n_symbols}], not {mask.shape}")
    return mask


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def beginning(offsets: Int64Array, column: int) -> int:
    """The first column of the string that holds a column."""
    return offsets[np.searchsorted(offsets, column, side="right") - 1]  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _select(
    query: Int32Array,
    symbols: Int32Array,
    distances: Float32Array,
    stride: int,
    local: bool,
    threshold: np.float32,
    gap: np.float32,
    ends: Float32Array,
    offsets: Int64Array,
    inside: Int64Array,
    taken: BoolArray,
    k: int,
    limit: np.float32,
) -> Int64Array:
    """[h, 3] start, stop and end column of the best matches.

    offsets: of the strings that were aligned; inside: those that a match must not cross.
    """
    a = Alignment(query, symbols, distances, stride, local, threshold, gap)
    found = np.empty((min(k, len(ends)), 3), dtype=np.int64)
    n = 0
    heap = ascending_blocks(ends)
    while n < len(found):
        end = next_column(heap, ends, taken)
        if end < 0 or not ends[end] < limit:
            break
        begin = beginning(offsets, end)
        if not a.local and _runs_into(a, taken, begin, end, ends[end]):
            continue
        path = trace(a, begin, end)
        start, stop = path[0, 1], path[-1, 1] + 1
        if start < beginning(inside, end) or np.any(taken[start:stop]):
            continue
        taken[start:stop] = True
        found[n, 0], found[n, 1], found[n, 2] = start, stop, end
        n += 1
    return found[:n]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _runs_into(a: Alignment, taken: BoolArray, begin: int, end: int, cost: np.float32) -> bool:
    """Whether no path of that cost lies between the last symbol taken before `end` and `end`. False may be wrong."""
    low = end
    farthest = max(begin, end - 2 * len(a.query))
    while low > farthest and not taken[low - 1]:
        low -= 1
    if low == begin or not taken[low - 1]:
        return False
    return bool(weights_of(a, low, end, _INFINITY)[-1, -1] > cost)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
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
        else:
            path, inside = _strided_path(a, low, end, _ZERO if low > begin else _INFINITY)
        n_columns *= 2
    return path


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def weights_of(a: Alignment, low: int, end: int, before: np.float32) -> Float32Array:
    """[stride + columns, X] of section 6 for symbols[low : end + 1], after `stride` columns that all cost `before`."""
    weights = np.empty((a.stride + end + 1 - low, len(a.query)), dtype=np.float32)
    weights[: a.stride] = before
    for y in range(low, end + 1):
        c = y - low + a.stride
        weights[c, 0] = a.distances[a.query[0], a.symbols[y]]
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
            weights[c, x] = best
    return weights


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
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


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def step_back(weights: Float32Array, x: int, c: int, distance: np.float32, stride: int) -> tuple[int, int]:
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
