"""End costs in ascending order without sorting them: the next one of each block of columns in a heap."""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Int32Array, Int64Array
from motionlake.pesta.alignment.scan import Both, Boundaries, best_per_clip, pairwise, scan_ends
from motionlake.pesta.alignment.strings import Distances, Repository, SymbolDistances, checked, query_string
from motionlake.pesta.alignment.trace import strided_weights, trace
from motionlake.pesta.alignment.vectors import LANES, least, load, store
from motionlake.pesta.config import AlignmentConfig
from numba import njit
from numpy.typing import ArrayLike

BLOCK: Final = 128
Heap = list[tuple[np.float32, np.int64, np.int64]]
_INFINITY = np.float32(np.inf)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
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


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def next_column(
    heap: Heap,
    costs: Float32Array,
    taken: BoolArray,
) -> np.int64:
    """The column of the least cost not drawn yet and not `taken` (by column where costs are equal); -1 for none."""
    while True:
        cost, y, found = heappop(heap)
        if y == len(costs):
            return np.int64(-1)
        first = y // BLOCK * BLOCK
        stop = min(first + BLOCK, len(costs))
        if found and not taken[y]:
            _push_next(heap, costs, taken, first, stop, cost, y)
            return y
        _push_next(heap, costs, taken, first, stop, cost, y if found else first - 1)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
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


@dataclass(frozen=True)
class Match:
    """A sub-sequence of the repository that is like a query.

    Attributes:
        clip: index of the clip it begins in.
        start, stop: symbols [start, stop) of that clip's string. Where boundaries are crossed, stop may lie beyond the
            clip's end and counts on through the clips after it.
        cost: W(X, y); of "sw", minus the score.
        path: [L, 2] pairs (query index, string index, counted from the clip's first symbol) in ascending order; None
            where it was not asked for. A strided path leaves out symbols that it strides over.
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
    config: AlignmentConfig | None = None,
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
    config = config or AlignmentConfig()
    if boundaries not in ("kept", "crossed", "dropped"):
        raise ValueError(f"boundaries is {boundaries!r}, not kept, crossed or dropped")
    if k < 0:
        raise ValueError(f"k is {k}: it is at least 0")
    ground = SymbolDistances.of(distances)
    symbols = checked(query, repository, ground)
    strings = repository if boundaries == "kept" else repository.joined
    taken = taken_symbols(barred, len(repository.symbols))
    ends = scan_ends(symbols, strings, ground, config, threads)
    inside = repository.offsets if boundaries == "dropped" else strings.offsets
    limit = np.float32(min(below, 0.0) if config.local else below)
    found = _select(
        ends, symbols, strings.symbols, strings.offsets, inside, taken, k, limit,
        ground.matrix, config.reach, config.local, *ground.scores(config),
    )  # fmt: skip
    matches = []
    clips = np.searchsorted(repository.offsets, found[:, 0], side="right") - 1
    firsts, costs = repository.offsets[clips].tolist(), ends[found[:, 2]].tolist()
    for (start, stop, end), clip, first, cost in zip(found.tolist(), clips.tolist(), firsts, costs, strict=True):
        path = None
        if paths:
            path = trace(
                symbols, strings.symbols, first if boundaries == "kept" else 0, end,
                ground.matrix, config.reach, config.local, *ground.scores(config),
            )  # fmt: skip
            path[:, 1] -= first
        matches.append(Match(clip, start - first, stop - first, cost, path))
    return matches


def taken_symbols(barred: BoolArray | None, n_symbols: int) -> BoolArray:
    """[Y] a fresh mask of the symbols that no match may cover.

    Raises:
        ValueError: a mask of another length.
    """
    if barred is None:
        return np.zeros(n_symbols, dtype=np.bool_)
    mask = np.array(barred, dtype=np.bool_)
    if mask.shape != (n_symbols,):
        raise ValueError(f"barred is [Y] = [{n_symbols}], not {mask.shape}")
    return mask


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _select(
    ends: Float32Array,
    query: Int32Array,
    symbols: Int32Array,
    offsets: Int64Array,
    inside: Int64Array,
    taken: BoolArray,
    k: int,
    limit: np.float32,
    distances: Float32Array,
    stride: int,
    local: bool,
    threshold: np.float32,
    gap: np.float32,
) -> Int64Array:
    """[h, 3] start, stop and end column of the best matches.

    offsets: of the strings that were aligned; inside: those that a match must not cross.
    """
    found = np.empty((min(k, len(ends)), 3), dtype=np.int64)
    n = 0
    heap = ascending_blocks(ends)
    while n < len(found):
        end = next_column(heap, ends, taken)
        if end < 0 or not ends[end] < limit:
            break
        begin = offsets[np.searchsorted(offsets, end, side="right") - 1]
        if not local and _runs_into(taken, query, symbols, begin, end, distances, stride, ends[end]):
            continue
        path = trace(query, symbols, begin, end, distances, stride, local, threshold, gap)
        start, stop = path[0, 1], path[-1, 1] + 1
        if start < inside[np.searchsorted(inside, end, side="right") - 1] or np.any(taken[start:stop]):
            continue
        taken[start:stop] = True
        found[n, 0], found[n, 1], found[n, 2] = start, stop, end
        n += 1
    return found[:n]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _runs_into(
    taken: BoolArray,
    query: Int32Array,
    symbols: Int32Array,
    begin: int,
    end: int,
    distances: Float32Array,
    stride: int,
    cost: np.float32,
) -> bool:
    """Whether no path of that cost lies between the last symbol taken before `end` and `end`. False may be wrong."""
    low = end
    farthest = max(begin, end - 2 * len(query))
    while low > farthest and not taken[low - 1]:
        low -= 1
    if low == begin or not taken[low - 1]:
        return False
    weights = strided_weights(query, symbols, low, end, distances, stride, np.float32(np.inf))
    return bool(weights[-1, -1] > cost)


BATCH: Final = 64  # clips that are sought in the query at once


def nearest_strings(
    query: ArrayLike,
    repository: Repository,
    distances: Distances,
    k: int,
    config: AlignmentConfig | None = None,
    *,
    both: Both = "max",
    without: int | None = None,
    threads: int = 1,
) -> list[tuple[int, float]]:
    """(clip, cost) of the k nearest clips, in ascending cost, ties by clip: a row of `symmetric_costs`.

    The costs of the query in the clips are lower bounds of the greater of both ways (half of them those of the mean),
    so clips are sought in the query in that order until no more of them can be among the k nearest.

    Args:
        query: [X] symbols of a whole clip.
        repository, distances, config, both, threads: as in `symmetric_costs`. Empty clips are left out.
        k: how many at most.
        without: a clip to leave out: the query itself.

    Raises:
        ValueError: as in `symmetric_costs`; k below 0.
    """
    if k < 0:
        raise ValueError(f"k is {k}: it is at least 0")
    if both not in ("max", "mean", "query"):
        raise ValueError(f"both is {both!r}, not max, mean or query")
    config, symbols = config or AlignmentConfig(), query_string(query)
    costs = best_per_clip(symbols, repository, distances, config, threads=threads) / np.float32(len(symbols))
    if without is not None:
        costs[without] = np.inf
    order = np.argsort(costs, kind="stable")[: int(np.isfinite(costs).sum())]
    if both == "query":
        return [(int(clip), float(costs[clip])) for clip in order[:k]]
    inside = Repository.of([symbols])
    found: list[tuple[float, int]] = []
    for start in range(0, len(order), BATCH):
        clips = order[start : start + BATCH].tolist()
        bound = float(costs[clips[0]]) * (1.0 if both == "max" else 0.5)
        if len(found) >= k and bound > found[k - 1][0] and not config.local:
            break
        own = [repository.string(clip) for clip in clips]
        back = pairwise(own, inside, distances, config, threads=threads)[:, 0]
        back /= np.array([len(string) for string in own], dtype=np.float32)
        there = costs[clips]
        cost = np.maximum(there, back) if both == "max" else (there + back) / np.float32(2)
        found = sorted([*found, *zip(cost.tolist(), clips, strict=True)])[: max(k, 1)]
    return [(clip, cost) for cost, clip in found[:k]]
