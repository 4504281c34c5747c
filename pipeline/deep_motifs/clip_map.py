"""Where clips lie on a map of all of them: those that move alike lie close together.

Vectors of clips are reduced to their principal components. Of a large lake some clips, drawn by their names, are placed
by t-SNE, and every other one among those of them that are nearest to it. The same lake gives the same map.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, FloatArray, Int64Array
from motionlake.threads import limited

PERPLEXITY: Final = 20.0
LEAST: Final = 4  # points that t-SNE places
SMOOTH: Final = 30.0  # perplexity of the map of a lake
COMPONENTS: Final = 32
PLACED: Final = 1500  # clips that t-SNE places: some seconds
NEAREST: Final = 4  # placed clips among which another one is put
_BLOCK: Final = 8192


def tsne(points: FloatArray, perplexity: float = PERPLEXITY) -> Float64Array:
    """[n, 2] places of n points [n, d], begun from their principal components; the same for the same points.

    Raises:
        ValueError: fewer than four points.
    """
    if len(points) < LEAST:
        raise ValueError(f"a map needs at least {LEAST} points, not {len(points)}")
    from sklearn.manifold import TSNE

    begun = "pca" if points.shape[1] > 1 else "random"
    place = TSNE(perplexity=min(perplexity, (len(points) - 1) / 3), init=begun, random_state=0)
    with limited(1):  # sums of threads differ from run to run
        return np.asarray(place.fit_transform(np.asarray(points, dtype=np.float64)), dtype=np.float64)


def places(vectors: Float32Array, names: Sequence[str]) -> Float64Array:
    """[n, 2] places of n clips, from -1 to 1, by their vectors [n, D]."""
    if len(vectors) < LEAST:
        return np.column_stack([np.arange(len(vectors)), np.zeros(len(vectors))]).astype(np.float64)
    drawn = _drawn(names)
    found = np.empty((len(vectors), 2))
    with limited(1):  # as `tsne`
        reduced = _components(vectors, drawn)
        own = reduced[drawn]
        placed = tsne(own, perplexity=SMOOTH)
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
