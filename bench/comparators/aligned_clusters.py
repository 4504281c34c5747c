"""Aligned cluster analysis: ACA (Zhou, De la Torre, Hodgins 2008) and HACA, in levels (2013).

A sequence is cut into segments, none longer than `most`, each of one of k clusters, so that segments are near the
mean of their cluster in the space of a kernel of sequences, the dynamic time alignment kernel: kernel k-means in
which the borders move too. Given the segments there are, dynamic programming finds those, of any borders and
clusters, whose distances from the present means sum to the least; this is done until nothing gets better. HACA does
the same twice: the segments of the first level, shorter ones, are the elements of the second, which are as alike as
the kernel says, and count in it by their lengths.

What the descriptions leave open: both begin with segments of half of `most` and kernel k-means (k-means++) of these,
several times, and keep the least sum; the kernel of frames is a Gaussian as wide as frames are from the nearest share
of all frames, on average; the first level of HACA has twice the clusters and a quarter of `most`. Frames are not
grouped first (every second one is seen), and HACA's levels are not gone through again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray, Int64Array
from motionlake.kernels import njit

ROUNDS: Final = 20
STARTS: Final = 3


@dataclass(frozen=True)
class Clusters:
    """m segments: borders [m + 1] among n elements, cluster [m] of each, and the sum of their distances."""

    borders: Int64Array
    labels: Int64Array
    cost: float

    def of_elements(self) -> Int64Array:
        """[n] cluster of each element."""
        return np.repeat(self.labels, np.diff(self.borders))


def frame_kernel(features: FloatArray, share: float) -> Float64Array:
    """[n, n] Gaussian kernel of frames [n, D], as wide as they are from the nearest `share` of all, on average."""
    rows = features.astype(np.float64)
    norms = (rows**2).sum(axis=1)
    squared = np.maximum(norms[:, None] + norms[None] - 2 * rows @ rows.T, 0.0)
    nearest = np.sort(squared, axis=1)[:, 1 : 1 + max(1, round(share * len(rows)))]
    found = np.exp(-squared / (2 * max(float(nearest.mean()), 1e-12)))
    np.fill_diagonal(found, 1.0)
    return np.asarray(found)


def aca(features: FloatArray, k: int, most: int, share: float, seed: int) -> Int64Array:
    """[n] cluster of each frame [n, D] by segments of at most `most` frames."""
    kernel = frame_kernel(features, share)
    return aligned_clusters(kernel, np.ones(len(kernel)), k, most, seed).of_elements()


def haca(features: FloatArray, k: int, most: int, share: float, seed: int) -> Int64Array:
    """[n] cluster of each frame [n, D] by two levels of segments."""
    kernel = frame_kernel(features, share)
    first = aligned_clusters(kernel, np.ones(len(kernel)), 2 * k, max(2, most // 4), seed)
    alike = alignments(kernel, np.ones(len(kernel)), first.borders)
    lengths = np.diff(first.borders)
    second = aligned_clusters(alike, lengths.astype(np.float64), k, most, seed)
    return np.repeat(second.of_elements(), lengths)


def aligned_clusters(
    kernel: Float64Array, lengths: Float64Array, k: int, most: float, seed: int, starts: int = STARTS
) -> Clusters:
    """Segments of n elements in k clusters, the best of several starts.

    Args:
        kernel: [n, n] how alike elements are, 1 of an element and itself.
        lengths: [n] of the elements.
        k: clusters.
        most: length of a segment; an element that is longer is one by itself.
        seed: of the starts.
        starts: how many.
    """
    rng = np.random.default_rng(seed)
    found = [_descended(kernel, lengths, k, most, rng) for _ in range(starts)]
    return min(found, key=lambda each: each.cost)


def _descended(kernel: Float64Array, lengths: Float64Array, k: int, most: float, rng: np.random.Generator) -> Clusters:
    borders = _cut(lengths, most / 2, rng)
    alike = alignments(kernel, lengths, borders)
    best = Clusters(borders, _grouped(alike, k, rng), np.inf)
    for _ in range(ROUNDS):
        present = alignments(kernel, lengths, best.borders)
        better = Clusters(
            *resegmented(kernel, lengths, best.borders, best.labels, _scatter(present, best.labels, k), most)
        )
        if better.cost >= best.cost - 1e-9:
            break
        best = better
    return best


def _cut(lengths: Float64Array, size: float, rng: np.random.Generator) -> Int64Array:
    """Borders of segments of about `size`, the first of which is of any length up to that."""
    place = np.cumsum(lengths) + rng.uniform(0, size)
    changes = np.flatnonzero(np.diff(np.floor(place / size))) + 1
    return np.array([0, *changes, len(lengths)], dtype=np.int64)


def _grouped(alike: Float64Array, k: int, rng: np.random.Generator) -> Int64Array:
    """[m] kernel k-means of segments, alike by [m, m], from k-means++."""
    far = np.maximum(2 - 2 * alike, 0.0)
    chosen = [int(rng.integers(len(far)))]
    while len(chosen) < min(k, len(far)):
        nearest = far[:, chosen].min(axis=1)
        total = nearest.sum()
        weights = nearest / total if total > 0 else np.full(len(far), 1 / len(far))
        chosen.append(int(rng.choice(len(far), p=weights)))
    labels: Int64Array = np.argmin(far[:, chosen], axis=1).astype(np.int64)
    for _ in range(ROUNDS):
        member = labels[:, None] == np.arange(k)
        sizes = np.maximum(member.sum(axis=0), 1)
        cost = _scatter(alike, labels, k) - 2 * (alike @ member) / sizes
        cost[:, ~member.any(axis=0)] = np.inf
        again = np.argmin(cost, axis=1).astype(np.int64)
        if np.array_equal(again, labels):
            break
        labels = again
    return labels


def _scatter(alike: Float64Array, labels: Int64Array, k: int) -> Float64Array:
    """[k] mean of the kernel over pairs of segments of each cluster."""
    member = (labels[:, None] == np.arange(k)).astype(np.float64)
    sizes = np.maximum(member.sum(axis=0), 1)
    return np.asarray(np.einsum("ic,ij,jc->c", member, alike, member, optimize=True) / sizes**2)


@njit(cache=True)
def alignments(kernel: Float64Array, lengths: Float64Array, borders: Int64Array) -> Float64Array:
    """[m, m] the dynamic time alignment kernel of segments.

    The path with the largest sum of kernel values, each step times the lengths that it goes on by in both segments,
    over the lengths of both.
    """
    m = len(borders) - 1
    found = np.ones((m, m))
    before = np.empty(len(lengths) + 1)
    row = np.empty(len(lengths) + 1)
    for a in range(m):
        for b in range(a):
            before[:] = -np.inf
            before[0] = 0.0
            size = 0.0
            for i in range(borders[a], borders[a + 1]):
                size += lengths[i]
                row[0] = -np.inf
                for j in range(borders[b], borders[b + 1]):
                    at, value = j - borders[b], kernel[i, j]
                    row[at + 1] = max(
                        before[at] + (lengths[i] + lengths[j]) * value,
                        before[at + 1] + lengths[i] * value,
                        row[at] + lengths[j] * value,
                    )
                before[:] = row
            other = lengths[borders[b] : borders[b + 1]].sum()
            found[a, b] = found[b, a] = before[borders[b + 1] - borders[b]] / (size + other)
    return found


@njit(cache=True)
def resegmented(
    kernel: Float64Array,
    lengths: Float64Array,
    borders: Int64Array,
    labels: Int64Array,
    scatter: Float64Array,
    most: float,
) -> tuple[Int64Array, Int64Array, float]:
    """Borders, clusters and sum of the segments that lie nearest to the means of the present ones.

    Args:
        kernel, lengths, most: as `aligned_clusters`.
        borders, labels: [m + 1] and [m] of the present segments.
        scatter: [k] mean kernel of pairs of segments of each cluster.
    """
    n, m, k = len(lengths), len(labels), len(scatter)
    members = np.zeros(k)
    sizes = np.empty(m)
    for s in range(m):
        members[labels[s]] += 1
        sizes[s] = lengths[borders[s] : borders[s + 1]].sum()
    least = np.full(n + 1, np.inf)
    least[0] = 0.0
    came = np.zeros(n + 1, dtype=np.int64)
    chosen = np.zeros(n + 1, dtype=np.int64)
    before = np.empty(n)
    row = np.empty(n)
    alike = np.empty(k)
    for start in range(n):
        size = 0.0
        for i in range(start, n):
            size += lengths[i]
            if i > start and size > most:
                break
            alike[:] = 0.0
            for s in range(m):
                for j in range(borders[s], borders[s + 1]):
                    value = kernel[i, j]
                    if i == start:
                        best = (lengths[i] + lengths[j]) * value if j == borders[s] else row[j - 1] + lengths[j] * value
                    else:
                        best = before[j] + lengths[i] * value
                        if j > borders[s]:
                            best = max(
                                best,
                                before[j - 1] + (lengths[i] + lengths[j]) * value,
                                row[j - 1] + lengths[j] * value,
                            )
                    row[j] = best
                alike[labels[s]] += row[borders[s + 1] - 1] / (size + sizes[s])
            before[:] = row
            for c in range(k):
                if members[c]:
                    cost = least[start] + 1.0 - 2.0 * alike[c] / members[c] + scatter[c]
                    if cost < least[i + 1]:
                        least[i + 1], came[i + 1], chosen[i + 1] = cost, start, c
    edges, at = [n], n
    while at > 0:
        at = came[at]
        edges.append(at)
    found = np.array(edges[::-1])
    return found, chosen[found[1:]], least[n]
