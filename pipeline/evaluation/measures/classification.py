"""How often clips get their class from other clips (Deep Motifs, section 5.3 and table 1)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from motionlake.arrays import BoolArray, Float64Array, FloatArray, Int64Array
from motionlake.evaluation.measures.ranking import ranked

# Distances [q, n] of clips from n labelled ones, distances [n, n] of these, their labels [n] -> q classes.
Classifier = Callable[[Float64Array, Float64Array, list[str]], list[str]]


def folded_accuracy(distances: Float64Array, labels: Sequence[str], folds: int, classify: Classifier) -> float:
    """Share of clips that get their own class while they, and the others of their part, are left out.

    Each class is dealt evenly over `folds` parts; n parts of n clips leave one out. Clips whose class nobody
    else holds then are left out of the share.

    Args:
        distances: [n, n], row i from clip i.
        labels: [n].
        folds: how many parts.
        classify: a method.

    Raises:
        ValueError: shapes that do not fit, or no clip with another of its class.
    """
    names = np.asarray(labels)
    if distances.shape != (len(names), len(names)):
        raise ValueError(f"distances of shape {distances.shape} do not fit {len(names)} labels")
    part = np.empty(len(names), dtype=np.int64)
    part[np.argsort(names, kind="stable")] = np.arange(len(names)) % folds
    right, asked = 0, 0
    for fold in range(folds):
        test, known = np.flatnonzero(part == fold), np.flatnonzero(part != fold)
        test = test[np.isin(names[test], names[known])]
        if len(test):
            found = classify(distances[np.ix_(test, known)], distances[np.ix_(known, known)], names[known].tolist())
            right += int(np.sum(np.asarray(found) == names[test]))
            asked += len(test)
    if not asked:
        raise ValueError("no clip has another of its class: nothing to learn from")
    return right / asked


@dataclass(frozen=True)
class Confusion:
    """counts[a, b]: hits of class b among the first hits of the queries of class a; `classes` by name."""

    classes: tuple[str, ...]
    counts: Int64Array

    def as_dict(self) -> dict[str, object]:
        return {"classes": list(self.classes), "counts": self.counts.tolist()}


def confusion(
    distances: FloatArray, queries: Sequence[str], clips: Sequence[str], candidates: BoolArray, top: int = 20
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


def adjusted_rand_index(labels: Sequence[str], clusters: Sequence[int]) -> float:
    """1 where clusters are the classes, about 0 for clusters drawn at random (Hubert and Arabie, 1985).

    Args:
        labels: [n] class of each clip.
        clusters: [n] its cluster.
    """
    from sklearn.metrics import adjusted_rand_score

    return float(adjusted_rand_score(labels, clusters))
