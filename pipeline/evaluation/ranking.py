"""Measures of ranked answers: how many of the first hits are relevant.

Hits are ranked by distance, ties by index. Averages run over the queries that have at least one relevant clip. Deep
Motifs, section 6.3 and table 2 (NN, Top-5, tiers, each clip querying all others); PESTA, section 8.2 (precision, mean
average precision); DeepHuMS, section 3.3.3 (the clips of one split query those of another).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from motionlake.arrays import BoolArray, FloatArray, Int64Array


@dataclass(frozen=True)
class Questions:
    """q queries to a repository of r clips.

    Attributes:
        relevant: [q, r] the clip has the query's class.
        candidates: [q, r] what a query may find.
    """

    relevant: BoolArray
    candidates: BoolArray

    @classmethod
    def of(cls, queries: Sequence[str], repository: Sequence[str], candidates: BoolArray | None = None) -> Questions:
        """From the classes of queries [q] and repository [r]; without `candidates` a query may find every clip."""
        relevant = share_label(queries, [(label,) for label in repository])
        may = np.ones_like(relevant) if candidates is None else candidates
        return cls(relevant & may, may)

    @property
    def scored(self) -> Int64Array:
        """The queries whose class the repository holds."""
        return np.flatnonzero(self.relevant.any(axis=1))


def share_label(queries: Sequence[str], clips: Sequence[Collection[str]]) -> BoolArray:
    """[q, n] whether a clip carries the label of a query.

    Args:
        queries: [q] labels.
        clips: [n] the labels of each clip, as many as it carries.
    """
    rows = [[label in carried for carried in clips] for label in queries]
    return np.array(rows, dtype=np.bool_).reshape(len(queries), len(clips))


def relatives(labels: Sequence[str]) -> BoolArray:
    """[n, n] whether another clip has the same label: what is relevant where each of n clips queries the others."""
    return Questions.of(labels, labels, others(len(labels))).relevant


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
    kept = [np.flatnonzero(may) for may in candidates]
    return [at[np.argsort(row[at], kind="stable")] for row, at in zip(distances, kept, strict=True)]


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


def first_hits(distances: FloatArray, questions: Questions) -> dict[int, int]:
    """The nearest clip of each query whose class the repository holds: {query: clip}."""
    orders = ranked(distances, questions.candidates)
    return {int(query): int(orders[query][0]) for query in questions.scored}


def by_class(rankings: Sequence[BoolArray], classes: Sequence[str]) -> dict[str, list[BoolArray]]:
    """The rankings that hold a relevant clip, by the class of their query; `classes` [q]."""
    found: dict[str, list[BoolArray]] = {}
    for label, hits in sorted(zip(classes, rankings, strict=True), key=lambda pair: pair[0]):
        if hits.any():
            found.setdefault(label, []).append(hits)
    return found


def average_precision(relevant: BoolArray) -> float:
    """Mean of the precision at the rank of each relevant hit; `relevant` [n] in ranked order, some True."""
    ranks = np.flatnonzero(relevant) + 1
    return float(np.mean(np.arange(1, len(ranks) + 1) / ranks))


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


def score_rankings(rankings: Sequence[BoolArray]) -> RankingScores:
    """Scores of `ranked_relevance`.

    Raises:
        ValueError: no query with a relevant clip.
    """
    scored = _scored(rankings)
    precisions = {f"p_at_{n}": _mean(_precision(n), scored) for n in (2, 5, 10, 15, 20)}
    return RankingScores(
        map=_mean(average_precision, scored), nn=_mean(_precision(1), scored), n=len(scored), **precisions
    )


@dataclass(frozen=True)
class RetrievalScores:
    """Averages over queries, each from 0 to 1.

    Attributes:
        nn: the first hit is a relative.
        top5: share of relatives among the first 5 hits (among all others, where there are fewer).
        first_tier: relatives among the first R hits, over R.
        second_tier: relatives among the first 2R hits, over R.
        map: mean average precision.
        cross_subject_nn: nn with the query's own subject left out of the ranking, over the queries that then still have
            a relative; None without subjects or without such queries.
        n: how many queries the averages run over.
    """

    nn: float
    top5: float
    first_tier: float
    second_tier: float
    map: float
    cross_subject_nn: float | None
    n: int


def leave_one_out(
    distances: FloatArray, labels: Sequence[str], subjects: Sequence[str] | None = None
) -> RetrievalScores:
    """Score a distance matrix: each clip queries all others.

    Args:
        distances: [n, n], row i from query i; the diagonal is ignored.
        labels: [n] class of each clip.
        subjects: [n] who performs each clip.

    Raises:
        ValueError: shapes that do not fit, or no query with a relative.
    """
    relevant = relatives(labels)
    scored = _scored(ranked_relevance(distances, relevant, others(len(labels))))
    sizes = [int(hits.sum()) for hits in scored]
    rows = [
        (hits[0], hits[:5].mean(), hits[:r].sum() / r, hits[: 2 * r].sum() / r, average_precision(hits))
        for hits, r in zip(scored, sizes, strict=True)
    ]
    nn, top5, first, second, precision = np.array(rows, dtype=np.float64).mean(axis=0).tolist()
    cross = None
    if subjects is not None:
        known = np.asarray(subjects)
        rankings = ranked_relevance(distances, relevant, known[:, None] != known)
        firsts = [hits[0] for hits in rankings if hits.any()]
        cross = float(np.mean(firsts)) if firsts else None
    return RetrievalScores(nn, top5, first, second, precision, cross, len(scored))


@dataclass(frozen=True)
class SearchScores:
    """Means over n queries that have a relevant clip, each from 0 to 1.

    Attributes:
        map: mean average precision.
        nn: the first hit is relevant.
        top5: share of relevant clips among the first 5 hits (among all, where there are fewer).
        cross_subject_nn: nn among clips of other subjects, over the queries with a relevant one there; None without.
        n: queries.
    """

    map: float
    nn: float
    top5: float
    cross_subject_nn: float | None
    n: int


def score_search(
    distances: FloatArray, questions: Questions, queries: Sequence[str | None], repository: Sequence[str | None]
) -> SearchScores:
    """Score the distances [q, r] of queries from a repository; `queries` [q] and `repository` [r] are their subjects.

    Raises:
        ValueError: shapes that do not fit, or no query whose class the repository holds.
    """
    scored = _scored(ranked_relevance(distances, questions.relevant, questions.candidates))
    cross = None
    if None not in {*queries, *repository}:
        apart = np.array(queries)[:, None] != np.array(repository)
        elsewhere = ranked_relevance(distances, questions.relevant & apart, questions.candidates & apart)
        firsts = [hits[0] for hits in elsewhere if hits.any()]
        cross = float(np.mean(firsts)) if firsts else None
    precision, nn, top5 = (_mean(one, scored) for one in (average_precision, _precision(1), _precision(5)))
    return SearchScores(precision, nn, top5, cross, len(scored))


@dataclass(frozen=True)
class SplitScores:
    """Means over n queries, each from 0 to 1.

    Attributes:
        top1: the first hit is of the query's class.
        top10: share of the first ten hits (of all, where there are fewer) that are of the query's class.
        map: mean average precision.
        n: queries whose class the repository holds.
        pr_area: area under `curve`.
        curve: recall and precision, as `precision_recall` has them.
    """

    top1: float
    top10: float
    map: float
    n: int
    pr_area: float
    curve: dict[str, list[float]]


def score_split(distances: FloatArray, questions: Questions) -> SplitScores:
    """Score the distances [q, r] of queries from a repository.

    Raises:
        ValueError: shapes that do not fit, or no query whose class the repository holds.
    """
    scored = _scored(ranked_relevance(distances, questions.relevant, questions.candidates))
    curve = precision_recall(scored)
    top1, top10, precision = (_mean(one, scored) for one in (_precision(1), _precision(10), average_precision))
    return SplitScores(top1, top10, precision, len(scored), area(curve), curve)


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
    scored, steps = _scored(rankings), np.arange(1, levels + 1)
    curves = np.empty((len(scored), levels))
    for row, hits in zip(curves, scored, strict=True):
        ranks = np.flatnonzero(hits) + 1
        count = -(-steps * len(ranks) // levels)  # relevant hits that the level takes
        row[:] = count / ranks[count - 1]
    return {"recall": (steps / levels).tolist(), "precision": curves.mean(axis=0).tolist()}


def area(curve: dict[str, list[float]]) -> float:
    """Area under a precision-recall curve by trapezia; below its first recall it is level."""
    recall, precision = curve["recall"], curve["precision"]
    return float(np.trapezoid([precision[0], *precision], [0.0, *recall]))


def confusion(
    distances: FloatArray, queries: Sequence[str], clips: Sequence[str], candidates: BoolArray, top: int = 20
) -> dict[str, Any]:
    """Count the classes of the first hits.

    Args:
        distances: [q, n].
        queries, clips: [q] and [n] classes.
        candidates: [q, n] what a query may find.
        top: how many hits of each query count.

    Returns:
        `classes` by name; `counts` [classes, classes], of hits of the second class for queries of the first.

    Raises:
        ValueError: shapes that do not fit.
    """
    classes, codes = np.unique([*queries, *clips], return_inverse=True)
    counts = np.zeros((len(classes), len(classes)), dtype=np.int64)
    for own, hits in zip(codes[: len(queries)], ranked(distances, candidates), strict=True):
        np.add.at(counts[own], codes[len(queries) :][hits[:top]], 1)
    return {"classes": classes.tolist(), "counts": counts.tolist()}


def _scored(rankings: Sequence[BoolArray]) -> list[BoolArray]:
    """Those of the queries that have a relevant clip."""
    scored = [hits for hits in rankings if hits.any()]
    if not scored:
        raise ValueError("no query has a relevant clip: nothing to retrieve")
    return scored


def _mean(measure: Callable[[BoolArray], float], rankings: Sequence[BoolArray]) -> float:
    return float(np.mean([measure(hits) for hits in rankings]))


def _precision(n: int) -> Callable[[BoolArray], float]:
    """The share of relevant clips among the first n hits."""
    return lambda hits: float(hits[:n].mean())
