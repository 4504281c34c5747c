"""Retrieval of training clips by test clips (DeepHuMS, section 3.3.3).

Hits are ranked by distance, ties by index. Averages run over the queries whose class the repository holds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from motionlake.arrays import BoolArray, FloatArray, Int64Array
from motionlake.evaluation.measures.ranking import precision_recall, ranked, ranked_relevance, share_label
from motionlake.evaluation.measures.retrieval import average_precision

TOP: Final = 10


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

    def as_dict(self) -> dict[str, Any]:
        return {
            "top1": self.top1,
            "top10": self.top10,
            "map": self.map,
            "n": self.n,
            "pr_area": self.pr_area,
            "curve": self.curve,
        }


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
        """From the classes of queries [q] and repository [r]; `candidates`: all but where told."""
        relevant = share_label(queries, [(label,) for label in repository])
        may = np.ones_like(relevant) if candidates is None else candidates
        if may.shape != relevant.shape:
            raise ValueError(f"candidates of shape {may.shape} do not fit {relevant.shape} queries and clips")
        return cls(relevant & may, may)

    @property
    def scored(self) -> Int64Array:
        """The queries whose class the repository holds."""
        return np.flatnonzero(self.relevant.any(axis=1))


def score_split(distances: FloatArray, questions: Questions) -> SplitScores:
    """Score the distances [q, r] of queries from a repository.

    Raises:
        ValueError: shapes that do not fit, or no query whose class the repository holds.
    """
    rankings = ranked_relevance(distances, questions.relevant, questions.candidates)
    asked = [rankings[query] for query in questions.scored]
    if not asked:
        raise ValueError("no query has a clip of its class in the repository: nothing to retrieve")
    curve = precision_recall(asked)
    return SplitScores(
        float(np.mean([hits[0] for hits in asked])),
        float(np.mean([hits[:TOP].mean() for hits in asked])),
        float(np.mean([average_precision(hits) for hits in asked])),
        len(asked),
        area(curve),
        curve,
    )


def area(curve: dict[str, list[float]]) -> float:
    """Area under a precision-recall curve by trapezia; below its first recall it is level."""
    recall, precision = curve["recall"], curve["precision"]
    return float(np.trapezoid([precision[0], *precision], [0.0, *recall]))


def first_hits(distances: FloatArray, questions: Questions) -> dict[int, int]:
    """The nearest clip of each query whose class the repository holds: {query: clip}."""
    orders = ranked(distances, questions.candidates)
    return {int(query): int(orders[query][0]) for query in questions.scored}
