"""Clusters of postures: k-means with soft heads, neural gas and self-organising maps, where neighbours whiten space."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Int64Array
from motionlake.deep_motifs.motifs import Motifs, assign, fit_motifs
from motionlake.deep_motifs.words.linear import LinearConfig, linear_embedding

WHITENED: Final = LinearConfig(components=24, whitening=0.0, neighbours=5)
SOM_EPOCHS: Final = 30
GAS_EPOCHS: Final = 30
ROWS: Final = 4096
# Neural gas: ranks beyond so many widths count for nothing; above so many ranks of width a share of the points tells
# where heads go.
_REACH: Final = 6
_WIDE: Final = 4.0
_SHARE: Final = 4


def whitened(postures: Float32Array, clips: Int64Array, seed: int, config: LinearConfig = WHITENED) -> Float32Array:
    """[d, D] the map of postures [n, D] of clips [n] to components in which neighbours in other clips differ equally.

    What a posture differs by from its nearest postures in other clips is mostly who moves, and how exactly: directions
    of great such differences are shrunk, as for words (`motionlake.deep_motifs.words.linear`).
    """
    return linear_embedding(postures[:, None], clips, config, seed)


def kmeans(points: Float32Array, m: int, softness: float, seed: int) -> Float32Array:
    """[m, d] heads of points [n, d], of the densest cluster first.

    Each head is the mean of all points, weighted by a softmax over their squared distances from the centroids of
    k-means, in units of twice `softness` times the mean square distance of a point from its centroid. Soft heads lie
    nearer together than centroids of disjoint cells, so that symbols on either side of a border cost little to
    exchange. With a softness of 0 the centroids are the heads.
    """
    centroids = fit_motifs(points, m, seed).centroids
    if not softness:
        return centroids
    centres = centroids.astype(np.float64)
    parts = np.split(points.astype(np.float64), range(ROWS, len(points), ROWS))
    norms = np.square(centres).sum(axis=1)
    apart = [np.square(part).sum(axis=1)[:, None] + norms - 2 * part @ centres.T for part in parts]
    least = [squares.min(axis=1, keepdims=True) for squares in apart]
    unit = 2 * softness * max(float(np.concatenate(least).mean()), 1e-12)
    sums, weights = np.zeros(centres.shape), np.zeros((len(centres), 1))
    for part, squares, nearest in zip(parts, apart, least, strict=True):
        near = np.exp((nearest - squares) / unit)
        near /= near.sum(axis=1, keepdims=True)
        sums += near.T @ part
        weights += near.sum(axis=0)[:, None]
    return np.asarray(sums / weights, dtype=np.float32)


def neural_gas(points: Float32Array, m: int, softness: float, seed: int) -> Float32Array:
    """[m, d] heads of points [n, d], by neural gas trained in batches [Martinetz and Schulten 1991, Cottrell 2006].

    Each epoch every head becomes the mean of all points, weighted by exp(-rank / width): its rank is 0 for points that
    it is the nearest head of, 1 where it is the second nearest, and so on. The width falls from a tenth of the heads
    to `softness`. Heads lean to their neighbours, and lie where points are: hardly one is nobody's nearest, as nodes of
    a self-organising map between far places are.

    Args:
        points: n of them, m at least.
        m: number of heads.
        softness: the last width, in ranks; with 0 the heads are the centroids of their own points.
        seed: of the points that heads begin at.
    """
    rng = np.random.default_rng(seed)
    heads = points[np.sort(rng.choice(len(points), m, replace=False))].astype(np.float32)
    last = max(softness, 1e-3)
    first = max(m / 10, last)
    for epoch in range(GAS_EPOCHS):
        width = first * (last / first) ** (epoch / (GAS_EPOCHS - 1))
        some = points[epoch % _SHARE :: _SHARE] if width > _WIDE and len(points) >= _SHARE * ROWS else points
        heads = moved_by_rank(some, heads, width)
    return heads


def moved_by_rank(points: Float32Array, heads: Float32Array, width: float) -> Float32Array:
    """[m, d] heads after one epoch of neural gas; one that no point reaches stays where it is."""
    count = min(len(heads), int(np.ceil(_REACH * width)) + 1)
    weights = np.exp(-np.arange(count) / width).astype(np.float32)
    norms = np.square(heads).sum(axis=1) / 2
    sums, reached = np.zeros(heads.shape), np.zeros(len(heads))
    for part in np.split(points, range(ROWS, len(points), ROWS)):
        apart = norms - part @ heads.T
        nearest = np.argpartition(apart, count - 1, axis=1)[:, :count]
        order = np.argsort(np.take_along_axis(apart, nearest, axis=1), axis=1, kind="stable")
        shares = np.zeros(apart.shape, np.float32)
        ranked = np.take_along_axis(nearest, order, axis=1)
        np.put_along_axis(shares, ranked, np.broadcast_to(weights, ranked.shape), axis=1)
        sums += shares.T @ part
        reached += shares.sum(axis=0)
    means = sums / np.maximum(reached, 1e-12)[:, None]
    return np.where(reached[:, None] > 1e-9, means, heads).astype(np.float32)


def grid(m: int) -> tuple[int, int]:
    """Rows and columns of a map of m nodes, as nearly square as m divides."""
    rows = max(r for r in range(1, int(m**0.5) + 1) if m % r == 0)
    return rows, m // rows


def self_organising_map(postures: Float32Array, rows: int, columns: int, seed: int) -> Float32Array:
    """[rows * columns, D] nodes, row by row, of a map trained in batches [Wu et al. 2009].

    Each epoch every node becomes the mean of all postures, weighted by a Gaussian of the distance on the grid
    between it and their nearest nodes; its width falls from half the longer side to a third of a node.
    """
    rng = np.random.default_rng(seed)
    places = np.stack(np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"), axis=-1).reshape(-1, 2)
    steps = np.square(places[:, None] - places[None]).sum(axis=2)
    nodes = _plane(postures, places, rng)
    first, last = max(rows, columns) / 2, 1 / 3
    for epoch in range(SOM_EPOCHS):
        width = first * (last / first) ** (epoch / (SOM_EPOCHS - 1))
        nearest = assign(postures, Motifs(nodes, np.ones(len(nodes))))
        counts = np.bincount(nearest, minlength=len(nodes)).astype(np.float64)
        sums = np.zeros(nodes.shape)
        np.add.at(sums, nearest, postures)
        near = np.exp(-steps / (2 * width**2))
        reached = near @ counts
        moved = (near @ sums) / np.maximum(reached, 1e-12)[:, None]
        nodes = np.where(reached[:, None] > 1e-9, moved, nodes).astype(np.float32)
    return nodes


def _plane(postures: Float32Array, places: np.ndarray, rng: np.random.Generator) -> Float32Array:
    """Nodes laid out over the plane of the first two principal components, a little disturbed."""
    mean = postures.mean(axis=0, dtype=np.float64)
    centred = postures - mean
    variances, directions = np.linalg.eigh(centred.T @ centred / len(postures))
    first = directions[:, -2:] * np.sqrt(np.maximum(variances[-2:], 0))
    spans = np.maximum(places.max(axis=0), 1)
    at = 2 * (places / spans) - 1
    flat = mean + at @ first[:, ::-1].T
    return np.asarray(flat + 1e-3 * rng.standard_normal(flat.shape) * centred.std(), dtype=np.float32)
