"""Leave-one-out retrieval measures over whole clips.

Every clip queries all others, ranked by distance; ties rank by index. R is the number of other clips of the
query's class. Averages run over the queries that have at least one relative (R >= 1). Deep Motifs, section
6.3 and table 2 (NN, Top-5, tiers); PESTA, section 8.2 (mean average precision).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from motionlake.arrays import BoolArray, FloatArray
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
