"""Classification of clips by labelled clips, and clustering of unlabelled ones (Deep Motifs, sections 4.3 and 5.3).

"knn": the k labelled clips nearest by the Earth Mover's Distance vote. "one_vs_all": one classifier a class,
that class against all others (section 5.3), a support vector machine on the kernel exp(-(distance / s)^2), s
the median distance of the labelled clips; the class whose classifier is surest wins.

Clusters: Metric MDS places the clips in a space of n dimensions so that their distances there are those of their
signatures; it starts from the classical solution, hence no random starts. K-means groups the places.
"""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, Int64Array
from motionlake.errors import UserError
from motionlake.threads import limited

# Cost of a margin violation: labels are taken to be right, so it is high.
_C: Final = 100.0


@dataclass(frozen=True)
class Prediction:
    """The class of one clip, and its distance from the nearest labelled clip.

    `confidence`: "knn": share of the votes; "one_vs_all": lead of the class over the next in the distance from its
    classifier's border (in margins).
    """

    label: str
    confidence: float
    distance: float


def classify_knn(distances: Float64Array, labels: Sequence[str], k: int = 5) -> list[Prediction]:
    """The class of each of q clips by a vote of its k nearest labelled ones.

    A tie goes to the class that holds the nearest of those tied; equal distances rank by index.

    Args:
        distances: [q, n] from n labelled clips.
        labels: [n].
        k: how many vote; all where there are fewer.

    Raises:
        ValueError: shapes that do not fit, no labelled clips, or k < 1.
    """
    _check(distances, labels)
    if k < 1:
        raise ValueError(f"k = {k}: at least 1 neighbour must vote")
    predictions = []
    for row in distances:
        order = np.argsort(row, kind="stable")[:k].tolist()
        ((label, votes),) = Counter(labels[i] for i in order).most_common(1)  # the first of equals is the nearest
        predictions.append(Prediction(label, votes / len(order), float(row[order[0]])))
    return predictions


def classify_one_vs_all(distances: Float64Array, labelled: Float64Array, labels: Sequence[str]) -> list[Prediction]:
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
    scale = float(np.median(labelled[np.triu_indices(len(labels), 1)])) or 1.0
    kernel, queries = (np.exp(-((each / scale) ** 2)) for each in (labelled, distances))
    scores = np.empty((len(queries), len(classes)))
    for i, name in enumerate(classes):
        machine = SVC(C=_C, kernel="precomputed").fit(kernel, np.asarray(labels) == name)
        scores[:, i] = machine.decision_function(queries)
    lead = np.ptp(np.sort(scores, axis=1)[:, -2:], axis=1)
    return [
        Prediction(str(classes[best]), float(ahead), float(nearest))
        for best, ahead, nearest in zip(scores.argmax(axis=1), lead, distances.min(axis=1), strict=True)
    ]


def _check(distances: Float64Array, labels: Sequence[str]) -> None:
    if distances.ndim != 2 or distances.shape[1] != len(labels) or not len(labels):
        raise ValueError(f"distances of shape {distances.shape} do not fit {len(labels)} labels")


DIMENSIONS: Final = 10
# The largest number of clusters that "auto" looks at.
MOST: Final = 40


@dataclass(frozen=True)
class Clustering:
    """n clips in groups.

    Attributes:
        clusters: [n] from 0, the largest first.
        places: [n, dimensions] of the clips.
        silhouette: mean silhouette of the places, from -1 to 1: how well the clusters are apart.
    """

    clusters: Int64Array
    places: Float64Array
    silhouette: float


def mds(distances: Float64Array, dimensions: int = DIMENSIONS) -> Float64Array:
    """[n, d] points whose distances follow `distances` [n, n], d at most n - 1 (multi-dimensional scaling)."""
    from sklearn.manifold import smacof

    start = _classical(distances, min(dimensions, len(distances) - 1))
    with limited(1):
        places, _ = smacof(
            distances, metric=True, n_components=start.shape[1], init=start, n_init=1, normalized_stress=False
        )
    return np.asarray(places, dtype=np.float64)


def cluster_clips(distances: Float64Array, k: int | None, *, seed: int = 0, dimensions: int = DIMENSIONS) -> Clustering:
    """Group n clips.

    Args:
        distances: [n, n], symmetric, zero on the diagonal.
        k: how many clusters; None takes the number, from 2 up, with the best silhouette.
        seed: of k-means.
        dimensions: of the space.

    Raises:
        UserError: k below 2, or not below the number of clips.
    """
    n = len(distances)
    check_count(n, k)
    places = mds(distances, dimensions)
    wanted = [k] if k is not None else list(range(2, min(MOST, n - 1) + 1))
    found = [_kmeans(places, count, seed) for count in wanted]
    clusters, silhouette = max(found, key=lambda each: each[1])
    return Clustering(by_size(clusters), places, silhouette)


def check_count(n: int, k: int | None) -> None:
    """Raises `UserError` where n clips cannot be k clusters, or any (None)."""
    if n < 3:
        raise UserError(f"{n} clips: clusters need at least 3")
    if k is not None and not 2 <= k < n:
        raise UserError(f"{k} clusters of {n} clips: ask for 2 to {n - 1}")


def _kmeans(places: Float64Array, k: int, seed: int) -> tuple[Int64Array, float]:
    from sklearn.cluster import KMeans
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.metrics import silhouette_score

    with limited(1), warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # clips that coincide: fewer distinct places than clusters
        clusters = KMeans(n_clusters=k, n_init=10, random_state=seed).fit_predict(places)
        distinct = len(np.unique(clusters))
        silhouette = float(silhouette_score(places, clusters)) if 1 < distinct < len(places) else -1.0
    return np.asarray(clusters, dtype=np.int64), silhouette


def _classical(distances: Float64Array, dimensions: int) -> Float64Array:
    """[n, dimensions] principal coordinates: exact where the distances are Euclidean."""
    squared = distances**2
    centred = -0.5 * (squared - squared.mean(0) - squared.mean(1)[:, None] + squared.mean())
    with limited(1):
        values, vectors = np.linalg.eigh(centred)
    chosen = np.argsort(-values, kind="stable")[:dimensions]
    vectors = vectors[:, chosen]
    signs = np.sign(vectors[np.abs(vectors).argmax(axis=0), np.arange(len(chosen))])  # one of both solutions
    return np.asarray(vectors * signs * np.sqrt(np.maximum(values[chosen], 0)), dtype=np.float64)


def by_size(clusters: Int64Array) -> Int64Array:
    """Numbers by size, the largest first, equal sizes by their first clip."""
    _, first, where, counts = np.unique(clusters, return_index=True, return_inverse=True, return_counts=True)
    return np.asarray(np.argsort(np.lexsort((first, -counts)))[where], dtype=np.int64)
