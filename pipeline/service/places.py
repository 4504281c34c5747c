"""Where clips lie on a map of all of them: those that move alike lie close together.

Vectors of clips are reduced to their principal components. Of a large lake some clips, drawn by their names, are placed
by t-SNE, and every other one among those of them that are nearest to it. The same lake gives the same map.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array

COMPONENTS: Final = 32
PLACED: Final = 1500  # clips that t-SNE places: some seconds
NEAREST: Final = 4  # placed clips among which another one is put
FEWEST: Final = 4  # clips that can be placed
_BLOCK: Final = 8192
CLUSTERS: Final = 30
_SHARE: Final = 0.2  # of a cluster that has a label, for it to be named by that


def places(vectors: Float32Array, names: Sequence[str]) -> Float64Array:
    """[n, 2] places of n clips, from -1 to 1, by their vectors [n, D]."""
    from motionlake.pictures.maps import tsne

    if len(vectors) < FEWEST:
        return np.column_stack([np.arange(len(vectors)), np.zeros(len(vectors))]).astype(np.float64)
    drawn = _drawn(names)
    reduced = _components(vectors, drawn)
    own = reduced[drawn]
    placed = tsne(own, perplexity=30.0)
    found = np.empty((len(vectors), 2))
    for first in range(0, len(vectors), _BLOCK):
        found[first : first + _BLOCK] = _among(reduced[first : first + _BLOCK], own, placed)
    found[drawn] = placed
    middle = (found.min(axis=0) + found.max(axis=0)) / 2
    return np.asarray((found - middle) / max(float(np.abs(found - middle).max()), 1e-9))


def _drawn(names: Sequence[str]) -> Int64Array:
    """The same clips every time, from all over the lake."""
    order = sorted(range(len(names)), key=lambda i: hashlib.sha256(names[i].encode()).digest())
    return np.sort(np.array(order[:PLACED], np.int64))


def _components(vectors: Float32Array, drawn: Int64Array) -> Float32Array:
    """[n, c] principal components, of the directions of the clips that were drawn."""
    middle = vectors[drawn].mean(axis=0)
    _, _, directions = np.linalg.svd(vectors[drawn] - middle, full_matrices=False)
    return np.asarray((vectors - middle) @ directions[:COMPONENTS].T, np.float32)


def _among(vectors: Float32Array, own: Float32Array, placed: Float64Array) -> Float64Array:
    """[b, 2] places of clips in the middle of the placed ones nearest to them, the nearer the more."""
    k = min(NEAREST, len(own))
    squared = (vectors**2).sum(axis=1)[:, None] - 2 * vectors @ own.T + (own**2).sum(axis=1)
    nearest = np.argpartition(squared, k - 1, axis=1)[:, :k]
    apart = np.sqrt(np.maximum(np.take_along_axis(squared, nearest, axis=1), 0)).astype(np.float64)
    weights = 1 / (apart + 1e-6)
    return np.asarray((placed[nearest] * (weights / weights.sum(axis=1, keepdims=True))[..., None]).sum(axis=1))


def clusters(points: Float64Array, values: Sequence[str | None], fallback: Sequence[str]) -> list[dict[str, Any]]:
    """Groups of points with a name each: the labels that most of its clips have, or else what they are of."""
    from sklearn.cluster import MiniBatchKMeans

    count = int(min(CLUSTERS, max(1, round(np.sqrt(len(points) / 3)))))
    group = MiniBatchKMeans(count, random_state=0, n_init=3).fit_predict(points)
    found = []
    for number in range(count):
        members = np.flatnonzero(group == number).tolist()
        if len(members):
            middle = np.median(points[members], axis=0)
            text = _named([values[i] for i in members], [fallback[i] for i in members])
            found.append({"x": round(float(middle[0]), 4), "y": round(float(middle[1]), 4), "text": text,
                          "clips": len(members)})  # fmt: skip
    return sorted(found, key=lambda each: -int(each["clips"]))


def _named(values: Sequence[str | None], fallback: Sequence[str]) -> str:
    common = Counter(value for value in values if value).most_common(2)
    names = [name for name, count in common if count >= _SHARE * len(values)]
    return ", ".join(names) or (common[0][0] if common else Counter(fallback).most_common(1)[0][0])
