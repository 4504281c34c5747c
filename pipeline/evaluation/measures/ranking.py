"""Precision of ranked answers (PESTA, section 8.2), of queries that are among the clips or not, with one label or more.

Hits are ranked by distance, ties by index. Averages run over the queries that have at least one relevant clip.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from motionlake.arrays import BoolArray, FloatArray, Int64Array
from motionlake.evaluation.measures.retrieval import average_precision


@dataclass(frozen=True)
class RankingScores:
    """Means over n queries, each from 0 to 1.

    Attributes:
        map: mean average precision.
        p_at_2, p_at_5, p_at_10, p_at_15, p_at_20: share of relevant clips among the first so many hits (among all
            hits, where there are fewer).
        nn: the first hit is relevant.
        n: queries with a relevant clip.
    """

    map: float
    p_at_2: float
    p_at_5: float
    p_at_10: float
    p_at_15: float
    p_at_20: float
    nn: float
    n: int


def share_label(queries: Sequence[str], clips: Sequence[Collection[str]]) -> BoolArray:
    """[q, n] whether a clip carries the label of a query.

    Args:
        queries: [q] labels.
        clips: [n] the labels of each clip, as many as it carries.
    """
    return np.array([[label in carried for carried in clips] for label in queries], dtype=np.bool_).reshape(
        len(queries), len(clips)
    )


def relatives(labels: Sequence[str]) -> BoolArray:
    """[n, n] whether another clip has the same label: what is relevant where each of n clips queries the others."""
    same = share_label(labels, [(label,) for label in labels])
    np.fill_diagonal(same, False)
    return same


def others(n: int) -> BoolArray:
    """[n, n] what each of n clips may find: all but itself."""
    return ~np.eye(n, dtype=np.bool_)


def ranked(distances: FloatArray, candidates: BoolArray) -> list[Int64Array]:
    """The hits of each query in ranked order.

    Args:
        distances: [q, n].
        candidates: [q, n] what a query may find.

    Raises:
        ValueError: shapes that do not fit.
    """
    if distances.ndim != 2 or distances.shape != candidates.shape:
        raise ValueError(f"distances of shape {distances.shape} do not fit candidates of shape {candidates.shape}")
    found = []
    for row, may in zip(distances, candidates, strict=True):
        kept = np.flatnonzero(may)
        found.append(kept[np.argsort(row[kept], kind="stable")])
    return found


def ranked_relevance(distances: FloatArray, relevant: BoolArray, candidates: BoolArray) -> list[BoolArray]:
    """Whether each hit of each query is relevant, in ranked order.

    Args:
        distances, candidates: as in `ranked`.
        relevant: [q, n].

    Raises:
        ValueError: shapes that do not fit.
    """
    if relevant.shape != distances.shape:
        raise ValueError(f"relevance of shape {relevant.shape} does not fit distances of shape {distances.shape}")
    return [row[hits] for row, hits in zip(relevant, ranked(distances, candidates), strict=True)]


def score_rankings(rankings: Sequence[BoolArray]) -> RankingScores:
    """Scores of `ranked_relevance`.

    Raises:
        ValueError: no query with a relevant clip.
    """
    asked = [hits for hits in rankings if hits.any()]
    if not asked:
        raise ValueError("no query has a relevant clip: nothing to retrieve")

    def precision(n: int) -> float:
        return float(np.mean([hits[:n].mean() for hits in asked]))

    return RankingScores(
        float(np.mean([average_precision(hits) for hits in asked])),
        precision(2),
        precision(5),
        precision(10),
        precision(15),
        precision(20),
        precision(1),
        len(asked),
    )


def score_classes(rankings: Sequence[BoolArray], classes: Sequence[str]) -> dict[str, RankingScores]:
    """Scores of the queries of each class that has any with a relevant clip; `classes` [q]."""
    by_class = _by_class(rankings, classes)
    return {label: score_rankings(hits) for label, hits in by_class.items()}


def precision_recall(rankings: Sequence[BoolArray], levels: int = 20) -> dict[str, list[float]]:
    """The precision-recall curve, mean over queries.

    Precision is that of the first hits up to the one where the recall reaches a level, without interpolation.

    Args:
        rankings: `ranked_relevance`.
        levels: the recalls are 1/levels, 2/levels, ... 1.

    Returns:
        recall and precision, [levels] each.

    Raises:
        ValueError: no query with a relevant clip.
    """
    asked = [hits for hits in rankings if hits.any()]
    if not asked:
        raise ValueError("no query has a relevant clip: nothing to retrieve")
    steps = np.arange(1, levels + 1)
    curves = np.empty((len(asked), levels))
    for row, hits in zip(curves, asked, strict=True):
        ranks = np.flatnonzero(hits) + 1
        count = -(-steps * len(ranks) // levels)  # relevant hits that the level takes
        row[:] = count / ranks[count - 1]
    return {"recall": (steps / levels).tolist(), "precision": curves.mean(axis=0).tolist()}


def precision_recall_classes(
    rankings: Sequence[BoolArray], classes: Sequence[str], levels: int = 20
) -> dict[str, list[float]]:
    """The precisions of `precision_recall` by class; `classes` [q]."""
    by_class = _by_class(rankings, classes)
    return {label: precision_recall(hits, levels)["precision"] for label, hits in by_class.items()}


def _by_class(rankings: Sequence[BoolArray], classes: Sequence[str]) -> dict[str, list[BoolArray]]:
    found: dict[str, list[BoolArray]] = {}
    for label, hits in sorted(zip(classes, rankings, strict=True), key=lambda pair: pair[0]):
        if hits.any():
            found.setdefault(label, []).append(hits)
    return found
