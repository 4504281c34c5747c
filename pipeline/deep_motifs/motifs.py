"""Motifs: clusters of embedded motion words (Deep Motifs, section 4.1).

K-means groups words in the embedding space; every word is assigned to the motif with the closest centroid
(L2). Results depend on the input and the seed alone: clustering and assignment run on one thread.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int32Array, IntArray
from motionlake.threads import limited

# Clustering a subsample of this many words costs about 1 % of inertia against clustering 300,000.
MAX_WORDS: Final = 100_000
ASSIGN_ROWS: Final = 8192


@dataclass(frozen=True)
class Motifs:
    """A vocabulary of K motifs, strongest first.

    Attributes:
        centroids: [K, d] float32 in the space of the embeddings.
        strength: [K] float64, density of each cluster: its share of the words over the root mean square
            distance of its words from the centroid. (One imagined word at the clusters' common radius is
            added to each, lest a cluster of one word be infinitely dense.)
    """

    centroids: Float32Array
    strength: Float64Array

    @property
    def k(self) -> int:
        return len(self.centroids)


def fit_motifs(embeddings: Float32Array, k: int, seed: int) -> Motifs:
    """Cluster words into at most `k` motifs.

    Args:
        embeddings: [n, d] words; above `MAX_WORDS` a random subsample is clustered.
        k: number of motifs; fewer result when there are fewer distinct words.
        seed: of the subsample and of the k-means initialisation.

    Raises:
        ValueError: no words, `k` < 1, or values that are not finite.
    """
    from sklearn.cluster import KMeans  # half a second, which assigning words need not pay
    from sklearn.exceptions import ConvergenceWarning

    if len(embeddings) == 0 or k < 1:
        raise ValueError(f"{len(embeddings)} words cannot be clustered into {k} motifs")
    if not np.isfinite(embeddings).all():
        raise ValueError("embeddings hold values that are not finite")
    words = embeddings
    if len(words) > MAX_WORDS:
        chosen = np.random.default_rng(seed).choice(len(words), MAX_WORDS, replace=False)
        words = words[np.sort(chosen)]
    words = np.ascontiguousarray(words, dtype=np.float32)
    with limited(1), warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # fewer distinct words than k: handled below
        kmeans = KMeans(n_clusters=min(k, len(words)), n_init=1, random_state=seed).fit(words)
    centroids = np.unique(np.asarray(kmeans.cluster_centers_, dtype=np.float32), axis=0)
    nearest = assign(words, Motifs(centroids, np.zeros(len(centroids))))
    used = np.unique(nearest)
    centroids, labels = centroids[used], np.searchsorted(used, nearest)
    strength = _density(words, centroids, labels)
    order = np.argsort(-strength, kind="stable")
    return Motifs(np.ascontiguousarray(centroids[order]), strength[order])


def assign(embeddings: Float32Array, motifs: Motifs) -> Int32Array:
    """[n] index of the motif closest to each word of `embeddings` [n, d]; the lowest index where two tie."""
    centroids = motifs.centroids.astype(np.float64)
    half_norms = np.einsum("kd,kd->k", centroids, centroids) / 2
    labels = np.empty(len(embeddings), dtype=np.int32)
    with limited(1):
        for start in range(0, len(embeddings), ASSIGN_ROWS):
            rows = embeddings[start : start + ASSIGN_ROWS].astype(np.float64)
            labels[start : start + len(rows)] = np.argmin(half_norms - rows @ centroids.T, axis=1)
    return labels


def _density(words: Float32Array, centroids: Float32Array, labels: IntArray) -> Float64Array:
    squares = np.sum((words.astype(np.float64) - centroids[labels]) ** 2, axis=1)
    counts = np.bincount(labels, minlength=len(centroids))
    common = squares.mean()
    if common == 0:  # every word is its motif: only frequency tells motifs apart
        return counts / len(words)
    radius = np.sqrt((np.bincount(labels, squares, minlength=len(centroids)) + common) / (counts + 1))
    return np.asarray(counts / len(words) / radius, dtype=np.float64)
