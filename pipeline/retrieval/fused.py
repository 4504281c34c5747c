"""Whole clips by several methods at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

from motionlake.errors import UserError
from motionlake.retrieval.protocol import Query, Retriever
from motionlake.retrieval.search import Hit

DEPTH: Final = 200  # answers asked of every method, or ten times k
DAMPING: Final = 60  # of reciprocal ranks (Cormack, Clarke and Buettcher, SIGIR 2009)
WAYS: Final = ("distance", "rank")


class FusedRetriever:
    """One ranking of several `Retriever`s; a `Retriever` itself.

    A method that cannot answer a query is left out of its answer.

    Args:
        retrievers: one at least.
        by: "distance", the mean of distances, each over the median distance of its method's answers to the query; or
            "rank", one less the sum of reciprocal ranks over the most that it can be.

    Raises:
        ValueError: no retrievers, or an unknown way.
    """

    method = "fused"

    def __init__(self, retrievers: Sequence[Retriever], by: str = "distance") -> None:
        if not retrievers:
            raise ValueError("no retrievers to fuse")
        if by not in WAYS:
            raise ValueError(f"fused by {by!r}, not one of {', '.join(WAYS)}")
        self._retrievers = list(retrievers)
        self._score = _by_distance if by == "distance" else _by_rank

    def search(self, queries: Sequence[Query], k: int, dataset: str | None = None) -> list[list[Hit]]:
        """As `Retriever.search`; the clips that no method has among its nearest 200, or 10 k, are no answers."""
        return [self._answer(query, k, dataset) for query in queries]

    def _answer(self, query: Query, k: int, dataset: str | None) -> list[Hit]:
        rankings: list[list[Hit]] = []
        failed: list[UserError] = []
        for retriever in self._retrievers:
            try:
                rankings += retriever.search([query], max(DEPTH, 10 * k), dataset)
            except UserError as error:
                failed.append(error)
        if not rankings:
            raise failed[0]
        known = {hit.clip: hit for ranking in rankings for hit in ranking}
        scores = [self._score(ranking) for ranking in rankings]
        means = {clip: sum(_of(score, clip) for score in scores) / len(scores) for clip in known}
        order = sorted(known, key=lambda clip: (means[clip], clip))[:k]
        return [replace(known[clip], rank=rank, distance=means[clip]) for rank, clip in enumerate(order, start=1)]


def _by_distance(ranking: Sequence[Hit]) -> dict[str, float]:
    distances = [hit.distance for hit in ranking]
    median = sorted(distances)[len(distances) // 2] if distances else 1.0
    return {hit.clip: hit.distance / (median or 1.0) for hit in ranking}


def _by_rank(ranking: Sequence[Hit]) -> dict[str, float]:
    return {hit.clip: 1.0 - (DAMPING + 1) / (DAMPING + hit.rank) for hit in ranking}


def _of(score: Mapping[str, float], clip: str) -> float:
    """A clip that a method does not answer with is as far as the farthest that it does."""
    return score.get(clip, max(score.values(), default=1.0))
