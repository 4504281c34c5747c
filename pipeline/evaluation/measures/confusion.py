"""Which classes are found for which (PESTA, section 8.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from motionlake.evaluation.measures.ranking import Distances, IntArray, ranked
from motionlake.evaluation.measures.retrieval import BoolArray


@dataclass(frozen=True)
class Confusion:
    """counts[a, b]: hits of class b among the first hits of the queries of class a; `classes` by name."""

    classes: tuple[str, ...]
    counts: IntArray

    def as_dict(self) -> dict[str, object]:
        return {"classes": list(self.classes), "counts": self.counts.tolist()}


def confusion(
    distances: Distances, queries: Sequence[str], clips: Sequence[str], candidates: BoolArray, top: int = 20
) -> Confusion:
    """Count the classes of the first hits.

    Args:
        distances: [q, n].
        queries, clips: [q] and [n] classes.
        candidates: [q, n] what a query may find.
        top: how many hits of each query count.

    Raises:
        ValueError: shapes that do not fit.
    """
    classes = sorted({*queries, *clips})
    place = {label: i for i, label in enumerate(classes)}
    counts = np.zeros((len(classes), len(classes)), dtype=np.int64)
    of_clips = np.array([place[label] for label in clips], dtype=np.int64)
    for label, hits in zip(queries, ranked(distances, candidates), strict=True):
        counts[place[label]] += np.bincount(of_clips[hits[:top]], minlength=len(classes))
    return Confusion(tuple(classes), counts)
