"""Costs between whole strings, both ways, and the nearest of many, most of which are not aligned (section 6)."""

from __future__ import annotations

from collections.abc import Sequence
from threading import Lock
from typing import Final, Literal, get_args

import numpy as np
from motionlake.arrays import Float32Array, Int32Array, Int64Array
from motionlake.kernels import few
from motionlake.pesta.bounds import bounds_of_strings
from motionlake.pesta.config import DEFAULT_ALIGNMENT, AlignmentConfig
from motionlake.pesta.scan import best_per_clip, least_in_one, pairwise
from motionlake.pesta.strings import Distances, Repository, SymbolDistances, checked
from numpy.typing import ArrayLike

Both = Literal["max", "mean", "query"]

FIRST: Final = 256  # clips in which the query is searched for at first
OF_EACH: Final = 2  # clips of these for each that is asked for, at least
BATCH: Final = 128  # clips that are searched for in the query at once


class LeastCosts:
    """The k least costs that were found of a query so far: of searches that share its clips, in any thread.

    Attributes:
        limit: the greatest of them; infinite while there are fewer.
    """

    def __init__(self, k: int) -> None:
        self._k, self._lock = k, Lock()
        self._costs = np.zeros(0, dtype=np.float32)
        self.limit = np.inf

    def add(self, costs: Float32Array) -> None:
        """Let some more be known."""
        with self._lock:
            self._costs = np.sort(np.concatenate([self._costs, costs]))[: self._k]
            if len(self._costs) == self._k:
                self.limit = float(self._costs[-1])


def symmetric_costs(
    strings: Sequence[ArrayLike] | Repository,
    distances: Distances,
    config: AlignmentConfig = DEFAULT_ALIGNMENT,
    *,
    both: Both = "max",
    threads: int = 1,
) -> Float32Array:
    """[n, n] costs between whole strings for each symbol of the query.

    A cost grows with the query's length, and a short query is found in many strings; hence the division, and both ways.

    Args:
        strings: n strings, none of them empty.
        distances, config, threads: as in `scan.end_costs`.
        both: the greater ("max") or mean of cost(a in b) / len(a) and cost(b in a) / len(b); "query" the first alone,
            with a the row.

    Raises:
        ValueError: as in `scan.end_costs`; an unknown `both`.
    """
    _check(both)
    repository = strings if isinstance(strings, Repository) else Repository.of(strings)
    queries = [repository.string(clip) for clip in range(len(repository))]
    costs = pairwise(queries, repository, distances, config, threads=threads)
    costs /= np.maximum(repository.lengths, 1)[:, None].astype(np.float32)
    return costs if both == "query" else _both_ways(costs, costs.T, both)


def nearest_strings(
    query: ArrayLike,
    repository: Repository,
    distances: Distances,
    k: int,
    config: AlignmentConfig = DEFAULT_ALIGNMENT,
    *,
    both: Both = "max",
    without: int | None = None,
    threads: int = 1,
    so_far: LeastCosts | None = None,
) -> list[tuple[int, float]]:
    """(clip, cost) of the k nearest clips, in ascending cost, ties by clip: a row of `symmetric_costs`.

    What the symbols of a clip cost at least in the query (`bounds_of_strings`) bounds the cost both ways from below,
    and so does what the query costs in the clip. The query is searched for in the clips of the least bounds, these in
    the query by both bounds, until no more of them can be among the k nearest.

    Args:
        query: [X] symbols of a whole clip.
        repository, distances, config, both, threads: as in `symmetric_costs`. Empty clips are left out.
        k: how many at most.
        without: a clip to leave out: the query itself.
        so_far: where the k nearest are looked for in several shares of the clips, what all of them have found: clips
            that cannot be among the k nearest of all are left out.

    Raises:
        ValueError: as in `symmetric_costs`; k below 0.
    """
    if k < 0:
        raise ValueError(f"k is {k}: it is at least 0")
    _check(both)
    symbols, ground = checked(query, repository, distances)
    if both == "query":
        costs = best_per_clip(symbols, repository, ground, config, threads=threads) / np.float32(len(symbols))
        if without is not None:
            costs[without] = np.inf
        order = np.argsort(costs, kind="stable")[: min(k, int(np.isfinite(costs).sum()))]
        return [(int(clip), float(costs[clip])) for clip in order]
    search = _Search(symbols, repository, ground, config, both, threads, so_far or LeastCosts(k))
    if without is not None:
        search.bounds[without] = np.inf
    clips = search.by_bound(np.flatnonzero(search.bounds < np.inf)) if k else np.zeros(0, dtype=np.int64)
    first, rest = np.split(clips, [max(FIRST, OF_EACH * k) if search.bounded else len(clips)])
    first = search.with_query(first)
    if len(rest):  # what the nearest of some cost tells in which others the query need not be searched for
        probed = max(BATCH, k)
        search.compare(first[:probed], BATCH)
        first = search.by_bound(np.concatenate([first[probed:], search.with_query(search.by_bound(rest))]))
    search.compare(first, BATCH if search.bounded else max(BATCH, k))
    return [(clip, cost) for cost, clip in sorted(search.found)[:k]]


def _check(both: Both) -> None:
    if both not in get_args(Both):
        raise ValueError(f"both is {both!r}, not max, mean or query")


def _both_ways(there: Float32Array | np.float32, back: Float32Array, both: Both) -> Float32Array:
    return np.maximum(there, back) if both == "max" else (there + back) / np.float32(2)


class _Search:
    """What is known of the clips of a repository that are compared with a query.

    Attributes:
        bounded: whether symbols tell what clips cost at least.
        bounds: [n] what each costs at least both ways; infinite where it is empty.
        found: costs and clips.
    """

    def __init__(
        self, symbols: Int32Array, repository: Repository, ground: SymbolDistances, config: AlignmentConfig,
        both: Both, threads: int, known: LeastCosts,
    ) -> None:  # fmt: skip
        self._symbols, self._repository, self._ground, self._config = symbols, repository, ground, config
        self._both, self._threads, self._known = both, threads, known
        self.bounded = not config.local and not few(0)  # else a kernel would be imported for it
        self._in_query = self._least_in_query()
        self._with_query = np.full(len(repository), np.inf, dtype=np.float32)
        least = np.float32(-np.inf if config.local else 0)  # with Smith-Waterman, what is alike costs less than nothing
        self.bounds = _both_ways(least, self._in_query, both)
        self.bounds[repository.lengths == 0] = np.inf
        self.found: list[tuple[float, int]] = []

    def _least_in_query(self) -> Float32Array:
        """[n] what each clip costs at least in the query, for each of its symbols."""
        if not self.bounded:
            return np.full(len(self._repository), -np.inf if self._config.local else 0, dtype=np.float32)
        return bounds_of_strings(self._symbols, self._repository, self._ground, self._config, threads=self._threads)

    def by_bound(self, clips: Int64Array) -> Int64Array:
        """Some clips that can be among the nearest, those of the least bounds first."""
        order = clips[np.argsort(self.bounds[clips], kind="stable")]
        return order[self.bounds[order] <= self._known.limit]

    def with_query(self, clips: Int64Array) -> Int64Array:
        """The same after the query was searched for in these clips."""
        some = self._repository.among(clips)
        costs = best_per_clip(self._symbols, some, self._ground, self._config, threads=self._threads)
        self._with_query[clips] = costs / np.float32(len(self._symbols))
        self.bounds[clips] = _both_ways(self._with_query[clips], self._in_query[clips], self._both)
        return self.by_bound(clips)

    def compare(self, clips: Int64Array, at_once: int) -> None:
        """Search for clips, those of the least bounds first, in the query, until no more can be among the nearest.

        `at_once`: how many; without a kernel it takes long to begin.
        """
        for first in range(0, len(clips), at_once):
            some = clips[first : first + at_once]
            some = some[self.bounds[some] <= self._known.limit]
            if not len(some):
                return
            own = self._repository.among(some)
            costs = least_in_one(own, self._symbols, self._ground, self._config, self._threads)
            costs /= own.lengths.astype(np.float32)
            costs = _both_ways(self._with_query[some], costs, self._both)
            self._known.add(costs)
            self.found += zip(costs.tolist(), some.tolist(), strict=True)
