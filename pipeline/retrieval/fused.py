"""Whole clips by several methods at once."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import replace
from typing import Final, TypeVar

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import UserError
from motionlake.lake.layout import Lake
from motionlake.retrieval.protocol import EVERYTHING, Finds, Hit, Query, Scope, Searcher, check_k, ranked
from motionlake.retrieval.registry import ready, searcher

K = TypeVar("K", bound=Hashable)

DEPTH: Final = 200  # answers of every method that are fused, or ten times k
DAMPING: Final = 60  # of reciprocal ranks (Cormack, Clarke and Buettcher, SIGIR 2009)


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
        if by not in ("distance", "rank"):
            raise ValueError(f"fused by {by!r}, not one of distance, rank")
        self._searchers, self._by_rank = list(searchers), by == "rank"

    def search(self, queries: Sequence[Query], k: int, scope: Scope = EVERYTHING) -> list[list[Hit]]:
        """As `Searcher.search`; the clips that no method has among its nearest 200, or 10 k, are no answers."""
        check_k(k)
        return [self._answer(query, k, scope) for query in queries]

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        """As `Searcher.distances`, by "distance" whatever `search` goes by."""
        of_each = np.stack([each.distances(queries, gallery) for each in self._searchers])
        if not len(gallery):
            return np.zeros((len(queries), 0))
        middles = np.sort(of_each, axis=2)[..., len(gallery) // 2, None]
        return np.asarray(np.mean(of_each / np.where(middles > 0, middles, 1), axis=0))

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
        if self._by_rank:
            scores = [{hit.clip: 1.0 - (DAMPING + 1) / (DAMPING + hit.rank) for hit in hits} for hits in rankings]
        else:
            scores = [scaled({hit.clip: hit.distance for hit in hits}) for hits in rankings]
        known = {hit.clip: hit for hits in reversed(rankings) for hit in hits}
        means = mean_scores(scores)
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


def scaled(distances: Mapping[K, float]) -> dict[K, float]:
    """The distances of a method's answers to one query, each over their median."""
    median = sorted(distances.values())[len(distances) // 2] if distances else 1.0
    return {answer: distance / (median or 1.0) for answer, distance in distances.items()}


def mean_scores(scores: Sequence[Mapping[K, float]]) -> dict[K, float]:
    """The mean score of each answer; a method that does not give it counts as its own farthest answer."""
    rest = [max(score.values(), default=1.0) for score in scores]
    answers = dict.fromkeys(answer for score in scores for answer in score)
    return {
        answer: sum(score.get(answer, far) for score, far in zip(scores, rest, strict=True)) / len(scores)
        for answer in answers
    }
