"""Whole clips by several methods at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import UserError
from motionlake.lake.layout import Lake
from motionlake.retrieval.protocol import EVERYTHING, Finds, Hit, Query, Scope, Searcher, check_k, ranked
from motionlake.retrieval.registry import ready, searcher

DEPTH: Final = 200  # answers of every method that are fused, or ten times k
DAMPING: Final = 60  # of reciprocal ranks (Cormack, Clarke and Buettcher, SIGIR 2009)
WAYS: Final = ("distance", "rank")


class FusedSearcher:
    """One ranking of several `Searcher`s of whole clips; a `Searcher` itself.

    A method that cannot compare a query is left out of its answer.

    Args:
        searchers: one at least.
        by: "distance", the mean of distances, each over the median distance of its method's answers to the query; or
            "rank", one less the sum of reciprocal ranks over the most that it can be.

    Raises:
        ValueError: no searchers, or an unknown way.
    """

    name = "fused"
    finds: Finds = "clip"

    def __init__(self, searchers: Sequence[Searcher], by: str = "distance") -> None:
        if not searchers:
            raise ValueError("no searchers to fuse")
        if by not in WAYS:
            raise ValueError(f"fused by {by!r}, not one of {', '.join(WAYS)}")
        self._searchers = list(searchers)
        self._score = _by_distance if by == "distance" else _by_rank

    def search(self, queries: Sequence[Query], k: int, scope: Scope = EVERYTHING) -> list[list[Hit]]:
        """As `Searcher.search`; the clips that no method has among its nearest 200, or 10 k, are no answers."""
        check_k(k)
        return [self._answer(query, k, scope) for query in queries]

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        """As `Searcher.distances`, by "distance" whatever `search` goes by."""
        of_each = [searcher.distances(queries, gallery) for searcher in self._searchers]
        middles = [np.sort(rows, axis=1)[:, rows.shape[1] // 2, None] for rows in of_each] if len(gallery) else []
        scaled = [rows / np.where(middle > 0, middle, 1) for rows, middle in zip(of_each, middles, strict=False)]
        return np.asarray(np.mean(scaled, axis=0)) if scaled else np.zeros((len(queries), 0))

    def _answer(self, query: Query, k: int, scope: Scope) -> list[Hit]:
        rankings: list[list[Hit]] = []
        failed: list[UserError] = []
        for each in self._searchers:
            try:
                rankings += each.search([query], max(DEPTH, 10 * k), scope)
            except UserError as error:
                failed.append(error)
        if not rankings:
            raise failed[0]
        known = {hit.clip: hit for ranking in reversed(rankings) for hit in ranking}
        scores = [self._score(ranking) for ranking in rankings]
        means = {clip: sum(_of(score, clip) for score in scores) / len(scores) for clip in known}
        order = sorted(known, key=lambda clip: (means[clip], clip))[:k]
        return ranked([replace(known[clip], distance=means[clip]) for clip in order])


def fused_of_lake(lake: Lake) -> FusedSearcher:
    """All that the lake is ready for.

    Raises:
        UserError: nothing is.
    """
    names = [name for name in ready(lake, "clip") if name != FusedSearcher.name]
    if not names:
        raise UserError(f"{lake.root}: is not ready for search; make it so with `motionlake run all`")
    return FusedSearcher([searcher("clip", name, lake) for name in names])


def _by_distance(ranking: Sequence[Hit]) -> dict[str, float]:
    distances = [hit.distance for hit in ranking]
    median = sorted(distances)[len(distances) // 2] if distances else 1.0
    return {hit.clip: hit.distance / (median or 1.0) for hit in ranking}


def _by_rank(ranking: Sequence[Hit]) -> dict[str, float]:
    return {hit.clip: 1.0 - (DAMPING + 1) / (DAMPING + hit.rank) for hit in ranking}


def _of(score: Mapping[str, float], clip: str) -> float:
    """A clip that a method does not answer with is as far as the farthest that it does."""
    return score.get(clip, max(score.values(), default=1.0))
