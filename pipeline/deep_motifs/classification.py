"""Classification of whole clips by their signatures (Deep Motifs, sections 4.3 and 5.3).

"knn": the k labelled clips nearest by the Earth Mover's Distance vote. "one_vs_all": one classifier a class,
that class against all others (section 5.3), a support vector machine on the kernel exp(-(distance / s)^2), s
the median distance of the labelled clips; the class whose classifier is surest wins.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import UserError

Method = Literal["knn", "one_vs_all"]

# Cost of a margin violation: labels are taken to be right, so it is high.
_C: Final = 100.0


@dataclass(frozen=True)
class Verdict:
    """The class of one clip.

    Attributes:
        label: the class.
        confidence: "knn": share of the votes; "one_vs_all": lead of the class over the next in the distance
            from its classifier's border (in margins).
        distance: from the nearest labelled clip.
    """

    label: str
    confidence: float
    distance: float


def classify_knn(distances: Float64Array, labels: Sequence[str], k: int = 5) -> list[Verdict]:
    """The class of each of q clips by a vote of its k nearest labelled ones.

    Args:
        distances: [q, n] from n labelled clips.
        labels: [n].
        k: how many vote; all where there are fewer. A tie goes to the class that holds the nearest of those
            tied, equal distances rank by index.

    Raises:
        ValueError: shapes that do not fit, no labelled clips, or k < 1.
    """
    _check(distances, labels)
    if k < 1:
        raise ValueError(f"k = {k}: at least 1 neighbour must vote")
    verdicts = []
    for row in distances:
        order = np.argsort(row, kind="stable")[:k].tolist()
        votes: dict[str, int] = {}
        for i in order:
            votes[labels[i]] = votes.get(labels[i], 0) + 1
        label = max(votes, key=lambda name: votes[name])  # the first of equals is the nearest
        verdicts.append(Verdict(label, votes[label] / len(order), float(row[order[0]])))
    return verdicts


def classify_one_vs_all(distances: Float64Array, labelled: Float64Array, labels: Sequence[str]) -> list[Verdict]:
    """The class of each of q clips by one classifier a class (section 5.3).

    Args:
        distances: [q, n] from n labelled clips.
        labelled: [n, n] of these from one another.
        labels: [n], at least two classes.

    Raises:
        UserError: a single class.
        ValueError: shapes that do not fit.
    """
    from sklearn.svm import SVC

    _check(distances, labels)
    if labelled.shape != (len(labels), len(labels)):
        raise ValueError(f"distances of shape {labelled.shape} do not fit {len(labels)} labels")
    classes = np.unique(np.asarray(labels))
    if len(classes) < 2:
        raise UserError(f"all labelled clips are of one class ({classes[0]}): there is nothing to tell apart")
    scale = _scale(labelled)
    kernel, queries = _kernel(labelled, scale), _kernel(distances, scale)
    scores = np.empty((len(queries), len(classes)))
    for i, name in enumerate(classes):
        machine = SVC(C=_C, kernel="precomputed").fit(kernel, np.asarray(labels) == name)
        scores[:, i] = machine.decision_function(queries)
    ranked = np.sort(scores, axis=1)
    return [
        Verdict(str(classes[scores[q].argmax()]), float(ranked[q, -1] - ranked[q, -2]), float(distances[q].min()))
        for q in range(len(scores))
    ]


def _scale(labelled: Float64Array) -> float:
    """Median distance of different clips."""
    apart = labelled[np.triu_indices(len(labelled), 1)]
    scale = float(np.median(apart))
    return scale if scale > 0 else 1.0


def _kernel(distances: Float64Array, scale: float) -> Float64Array:
    return np.asarray(np.exp(-((distances / scale) ** 2)), dtype=np.float64)


def _check(distances: Float64Array, labels: Sequence[str]) -> None:
    if distances.ndim != 2 or distances.shape[1] != len(labels) or not len(labels):
        raise ValueError(f"distances of shape {distances.shape} do not fit {len(labels)} labels")
