"""A linear embedding of motion words learned from their neighbours in other clips.

The difference between a word and its nearest words in other clips is mostly what does not matter: who moves, how
large, how exactly. Directions in which such neighbours differ much are shrunk, those in which they agree are
kept (relevant component analysis, with neighbours in the place of labels). It is where the network of
`motionlake.deep_motifs.words.network` starts from.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from motionlake.arrays import Float32Array, Int64Array

ROWS = 512


@dataclass(frozen=True)
class LinearConfig:
    """How the linear embedding is learned.

    Attributes:
        components: principal components of the flattened words that are kept.
        whitening: power of each component's variance that is divided out before neighbours are looked for.
        neighbours: nearest words of other clips that a word is compared with; 0 keeps the whitened components.
        anchors: words whose neighbours are looked for.
    """

    components: int = 48
    whitening: float = 0.25
    neighbours: int = 5
    anchors: int = 20_000

    @classmethod
    def principal(cls) -> LinearConfig:
        """Principal components and nothing else: the shallow embedding."""
        return cls(whitening=0.0, neighbours=0)


def linear_embedding(
    words: Float32Array,
    clips: Int64Array,
    config: LinearConfig,
    seed: int,
    start: Float32Array | None = None,
    alike: Float32Array | None = None,
) -> Float32Array:
    """The matrix [d, E] that embeds flattened words of E numbers, d = at most `components`.

    Embedded words lie a median distance of 1 apart. Where no other clip has words, neighbours are left out.

    Args:
        words: [n, E], or [n, length, D] with E = length * D.
        clips: [n] clip of each word.
        config: how to learn it.
        seed: of the draw of anchors.
        start: [d, E] an embedding to go on from, in the place of principal components.
        alike: of the shape of `words`, what each word counts as alike with, beside its neighbours.
    """
    flat = words.reshape(len(words), -1)
    centred = flat - flat.mean(axis=0, dtype=np.float64).astype(np.float32)
    projection = _components(centred, config) if start is None else start.T.astype(np.float32)
    rng = np.random.default_rng(seed)
    embedded = centred @ projection
    if config.neighbours and len(np.unique(clips)) > 1:
        anchors = np.sort(rng.permutation(len(words))[: config.anchors])
        found = nearest_elsewhere(embedded, clips, anchors, config.neighbours)
        differences = (embedded[anchors][:, None] - embedded[found]).reshape(-1, embedded.shape[1])
        if alike is not None:  # one for each word: weighted to count as much as all its neighbours
            apart = (flat[anchors] - alike[anchors].reshape(len(anchors), -1)) @ projection
            differences = np.concatenate([differences, apart * np.float32(config.neighbours**0.5)])
        projection = projection @ _inverse_root(differences)
        embedded = centred @ projection
    first, second = rng.integers(0, len(words), (2, 20_000))
    median = float(np.median(np.linalg.norm(embedded[first] - embedded[second], axis=1))) or 1.0
    return np.ascontiguousarray(projection.T / median, dtype=np.float32)


def nearest_elsewhere(embedded: Float32Array, clips: Int64Array, anchors: Int64Array, count: int) -> Int64Array:
    """[A, count] nearest words of other clips of each anchor, by L2 between rows of `embedded` [n, d].

    Anchors whose clip leaves fewer than `count` others get themselves in their place.
    """
    squares = np.einsum("nd,nd->n", embedded, embedded)
    count = min(count, len(embedded) - 1)
    found = []
    for start in range(0, len(anchors), ROWS):
        rows = anchors[start : start + ROWS]
        distances = squares - 2 * embedded[rows] @ embedded.T
        distances[clips[rows][:, None] == clips] = np.inf
        nearest = np.argpartition(distances, count - 1, axis=1)[:, :count]
        reached = np.isfinite(np.take_along_axis(distances, nearest, axis=1))
        found.append(np.where(reached, nearest, rows[:, None]))
    return np.concatenate(found).astype(np.int64)


def _components(centred: Float32Array, config: LinearConfig) -> Float32Array:
    """[L, d] principal directions, each over a power of its standard deviation."""
    covariance = (centred.T @ centred).astype(np.float64) / len(centred)
    variances, directions = np.linalg.eigh(covariance)
    kept = np.argsort(-variances, kind="stable")[: config.components]
    kept = kept[variances[kept] > variances.max() * 1e-9]
    directions, variances = directions[:, kept], variances[kept]
    # Eigenvectors have no sign of their own; the largest entry is made positive, the same everywhere.
    signs = np.sign(directions[np.abs(directions).argmax(axis=0), np.arange(len(kept))])
    return np.asarray(directions * signs * variances ** (-config.whitening / 2), dtype=np.float32)


def _inverse_root(differences: Float32Array, ridge: float = 1e-3) -> Float32Array:
    """[d, d] inverse square root of the mean outer product of `differences` [m, d]."""
    moments = differences.astype(np.float64).T @ differences / len(differences)
    variances, directions = np.linalg.eigh(moments)
    lifted = variances + ridge * variances.mean()
    if not lifted.max() > 0:
        return np.eye(len(moments), dtype=np.float32)
    return np.asarray((directions * lifted**-0.5) @ directions.T, dtype=np.float32)
