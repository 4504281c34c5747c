"""The best matches of a query that do not overlap, each with its path (section 6).

With gaps (`AlignmentConfig.gaps`), a match is from the first symbol of the clip that is matched to the last.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Int32Array, Int64Array
from motionlake.kernels import njit
from motionlake.pesta.config import DEFAULT_ALIGNMENT, AlignmentConfig
from motionlake.pesta.paths import Alignment, trace, weights_of
from motionlake.pesta.scan import scan_ends
from motionlake.pesta.selection import ascending_blocks, next_column
from motionlake.pesta.strings import Boundaries, Distances, Repository, checked
from numpy.typing import ArrayLike

_INFINITY = np.float32(np.inf)


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
        symbols, strings.symbols, ground.matrix, config.reach, config.local, config.gaps, *ground.scores(config)
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


@njit(cache=True, nogil=True)
def beginning(offsets: Int64Array, column: int) -> int:
    """The first column of the string that holds a column."""
    return offsets[np.searchsorted(offsets, column, side="right") - 1]  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def _select(
    query: Int32Array,
    symbols: Int32Array,
    distances: Float32Array,
    stride: int,
    local: bool,
    gapped: bool,
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
    a = Alignment(query, symbols, distances, stride, local, gapped, threshold, gap)
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
        if not len(path):  # all of the query is left out
            continue
        start, stop = path[0, 1], path[-1, 1] + 1
        if start < beginning(inside, end) or np.any(taken[start:stop]):
            continue
        taken[start:stop] = True
        found[n, 0], found[n, 1], found[n, 2] = start, stop, end
        n += 1
    return found[:n]


@njit(cache=True, nogil=True)
def _runs_into(a: Alignment, taken: BoolArray, begin: int, end: int, cost: np.float32) -> bool:
    """Whether no path of that cost lies between the last symbol taken before `end` and `end`. False may be wrong."""
    low = end
    farthest = max(begin, end - 2 * len(a.query))
    while low > farthest and not taken[low - 1]:
        low -= 1
    if low == begin or not taken[low - 1]:
        return False
    return bool(weights_of(a, low, end, _INFINITY)[-1, -1] > cost)
