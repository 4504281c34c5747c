"""Measures of ranked answers: how many of the first hits are relevant.

Hits are ranked by distance, ties by index. Averages run over the queries that have at least one relevant clip. Deep
Motifs, section 6.3 and table 2 (NN, Top-5, tiers, each clip querying all others); PESTA, section 8.2 (precision, mean
average precision, of queries that are among the clips or not).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from motionlake.arrays import BoolArray, FloatArray, Int64Array
from numpy.typing import NDArray


@dataclass(frozen=True)
class RetrievalScores:
    """Averages over queries, each from 0 to 1.

    Attributes:
        nn: the first hit is a relative.
        top5: share of relatives among the first 5 hits (among all others, where there are fewer).
        first_tier: relatives among the first R hits, over R.
        second_tier: relatives among the first 2R hits, over R.
        map: mean average precision.
        cross_subject_nn: nn with the query's own subject left out of the ranking, over the queries that
            then still have a relative; None without subjects or without such queries.
        queries: how many queries the averages run over.
    """

    nn: float
    top5: float
    first_tier: float
    second_tier: float
    map: float
    cross_subject_nn: float | None
    queries: int


def leave_one_out(
    distances: FloatArray, labels: Sequence[str], subjects: Sequence[str] | None = None
) -> RetrievalScores:
    """Score a distance matrix.

    Args:
        distances: [n, n], row i from query i; the diagonal is ignored.
        labels: [n] class of each clip.
        subjects: [n] who performs each clip.

    Raises:
        ValueError: shapes that do not fit, or no query with a relative.
    """
    n = len(labels)
    if distances.shape != (n, n) or (subjects is not None and len(subjects) != n):
        raise ValueError(f"distances of shape {distances.shape} do not fit {n} labels")
    classes = np.asarray(labels)
    ranked = [_relevance(distances[i], classes == classes[i], np.arange(n) != i) for i in range(n)]
    scored = np.array([_scores(relevant) for relevant in ranked if relevant.any()])
    if not len(scored):
        raise ValueError("no clip has another of its class: nothing to retrieve")
    nn, top5, first, second, precision = (float(v) for v in scored.mean(axis=0))
    cross = None if subjects is None else _cross_subject_nn(distances, classes, np.asarray(subjects))
    return RetrievalScores(nn, top5, first, second, precision, cross, len(scored))


def average_precision(relevant: BoolArray) -> float:
    """Mean of the precision at the rank of each relevant hit; `relevant` [n] in ranked order, some True."""
    ranks = np.flatnonzero(relevant) + 1
    return float(np.mean(np.arange(1, len(ranks) + 1) / ranks))


def _relevance(distances: FloatArray, relative: BoolArray, ranked: BoolArray) -> BoolArray:
    """Whether each hit is a relative, in ranked order, of those that are `ranked` at all."""
    kept = np.flatnonzero(ranked)
    order = np.argsort(distances[kept], kind="stable")
    return np.asarray(relative[kept[order]], dtype=np.bool_)


def _scores(relevant: BoolArray) -> tuple[float, float, float, float, float]:
    r = int(relevant.sum())
    return (
        float(relevant[0]),
        float(relevant[:5].mean()),
        float(relevant[:r].sum() / r),
        float(relevant[: 2 * r].sum() / r),
        average_precision(relevant),
    )


def _cross_subject_nn(distances: FloatArray, classes: NDArray[np.str_], subjects: NDArray[np.str_]) -> float | None:
    hits = [
        _relevance(distances[i], classes == classes[i], subjects != subjects[i])
        for i in range(len(classes))
        if np.any((subjects != subjects[i]) & (classes == classes[i]))
    ]
    return float(np.mean([h[0] for h in hits])) if hits else None


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
    scored = [hits for hits in rankings if hits.any()]
    if not scored:
        raise ValueError("no query has a relevant clip: nothing to retrieve")

    def precision(n: int) -> float:
        return float(np.mean([hits[:n].mean() for hits in scored]))

    return RankingScores(
        float(np.mean([average_precision(hits) for hits in scored])),
        precision(2),
        precision(5),
        precision(10),
        precision(15),
        precision(20),
        precision(1),
        len(scored),
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
    scored = [hits for hits in rankings if hits.any()]
    if not scored:
        raise ValueError("no query has a relevant clip: nothing to retrieve")
    steps = np.arange(1, levels + 1)
    curves = np.empty((len(scored), levels))
    for row, hits in zip(curves, scored, strict=True):
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
