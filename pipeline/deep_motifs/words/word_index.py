"""Candidates for the nearest words under DTW: a low-dimensional embedding in an inverted file.

Words that DTW brings together pass through the same poses at different speeds. So a word is described by its path
however fast it is walked: its frames in the P directions of largest variance, at eight points equally far apart along
the path. The d principal components of this are clustered into cells by k-means; a query meets the words of the cells
nearest to its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final, Self

import numpy as np
from motionlake.arrays import Float32Array, Int64Array
from motionlake.deep_motifs.words.windows import WordSet
from numba import njit
from threadpoolctl import threadpool_limits

POINTS: Final = 8  # of a path
ROWS: Final = 20_000  # words described at a time
CELL_ROWS: Final = 4096  # words that meet all centroids at a time
SAMPLE: Final = 20_000  # words that the embedding is fitted to
FRAME_SAMPLE: Final = 5_000  # words that the directions of frames are fitted to
CELL_SAMPLE: Final = 40  # words that a cell's centroid is fitted to


@dataclass(frozen=True)
class IndexConfig:
    """What the index is made of.

    Attributes:
        directions: P, principal components of a frame.
        dimension: d, of the embedding.
        cell: about how many words a cell holds.
        seed: of samples and of k-means.
    """

    directions: int = 16
    dimension: int = 32
    cell: int = 250
    seed: int = 0


@dataclass(frozen=True)
class WordSpace:
    """Where words are embedded.

    Attributes:
        centre: [D] mean frame.
        basis: [D, P] orthonormal: distances of projected frames are lower bounds of distances of frames.
        mean: [F] mean description.
        components: [F, d].
    """

    centre: Float32Array
    basis: Float32Array
    mean: Float32Array
    components: Float32Array

    def project(self, words: WordSet, chosen: slice | Int64Array) -> Float32Array:
        """[n, length, P] frames of words in the directions of largest variance."""
        taken = words.take(chosen)
        n, length, width = taken.shape
        return np.asarray(((taken.reshape(-1, width) - self.centre) @ self.basis).reshape(n, length, -1))

    def embed(self, projected: Float32Array) -> Float32Array:
        """[n, d] of projected words [n, length, P]."""
        return np.ascontiguousarray((describe(projected) - self.mean) @ self.components)


@dataclass(frozen=True)
class WordIndex:
    """N embedded words in the order of their cells.

    Attributes:
        space: of the embedding.
        centroids: [K, d] of the cells.
        order: [N] words, cell by cell.
        offsets: [K + 1]: cell c holds `order[offsets[c] : offsets[c + 1]]`.
        embedded: [N, d] in that order.
        projected: [N * length, P] frames of the words, in that order.
        length: frames of a word.
    """

    space: WordSpace
    centroids: Float32Array
    order: Int64Array
    offsets: Int64Array
    embedded: Float32Array
    projected: Float32Array
    length: int

    @classmethod
    def of(
        cls,
        space: WordSpace,
        words: WordSet,
        centroids: Float32Array,
        order: Int64Array,
        offsets: Int64Array,
        embedded: Float32Array,
    ) -> Self:
        """The index of words whose embedding is known."""
        projected = np.empty((len(words), words.length, space.basis.shape[1]), dtype=np.float32)
        for first in _starts(len(words)):
            rows = slice(first, first + ROWS)
            projected[rows] = space.project(words, order[rows])
        flat = projected.reshape(-1, projected.shape[2])
        return cls(space, centroids, order, offsets, embedded, flat, words.length)

    @property
    def projected_words(self) -> Float32Array:
        """[N, length, P]."""
        return self.projected.reshape(len(self.order), self.length, -1)

    @cached_property
    def starts(self) -> Int64Array:
        """[N] first row of each word in `projected`."""
        return np.arange(len(self.order), dtype=np.int64) * self.length

    @cached_property
    def norms(self) -> Float32Array:
        """[N] squared norms of `embedded`."""
        return np.asarray(np.einsum("nd,nd->n", self.embedded, self.embedded))

    def probed(self, cell: int, words: int) -> Int64Array:
        """[M] positions of the words of the cells nearest to one, that cell first, at least `words` or all of them."""
        apart = np.sum((self.centroids - self.centroids[cell]) ** 2, axis=1)
        apart[cell] = -1
        cells = np.argsort(apart, kind="stable")
        sizes = np.diff(self.offsets)[cells]
        taken = cells[: int(np.searchsorted(np.cumsum(sizes), min(words, len(self.order)))) + 1]
        return np.concatenate([np.arange(self.offsets[c], self.offsets[c + 1]) for c in taken])


def fit_index(words: WordSet, config: IndexConfig) -> WordIndex:
    """Embed words and group them into cells; depends on the words and the seed alone.

    Raises:
        ValueError: no words, or features that are not finite.
    """
    if not len(words):
        raise ValueError("no words: nothing can be searched")
    if not all(np.isfinite(words.frames[first : first + ROWS]).all() for first in _starts(len(words.frames))):
        raise ValueError("words hold features that are not finite")
    with threadpool_limits(limits=1):
        space = fit_space(words, config)
        embedded = np.concatenate([_embed(space, words, first) for first in _starts(len(words))])
        centroids = _cells(embedded, config)
        cells = nearest_centroids(embedded, centroids)
        order = np.argsort(cells, kind="stable").astype(np.int64)
        offsets = np.searchsorted(cells[order], np.arange(len(centroids) + 1)).astype(np.int64)
        return WordIndex.of(space, words, centroids, order, offsets, embedded[order])


def nearest_centroids(vectors: Float32Array, centroids: Float32Array) -> Int64Array:
    """[n] nearest of `centroids` [K, d] to each of `vectors` [n, d], the lowest index where two tie."""
    own = np.einsum("kd,kd->k", centroids, centroids)
    blocks = [vectors[i : i + CELL_ROWS] for i in range(0, len(vectors), CELL_ROWS)]
    cells = [np.argmin(own - 2 * (block @ centroids.T), axis=1) for block in blocks]
    return np.concatenate([np.zeros(0, np.int64), *cells])


def _embed(space: WordSpace, words: WordSet, first: int) -> Float32Array:
    return space.embed(space.project(words, slice(first, first + ROWS)))


def fit_space(words: WordSet, config: IndexConfig) -> WordSpace:
    """Principal directions of frames, then of descriptions, from a sample of words."""
    rng = np.random.default_rng(config.seed)
    sample = np.sort(rng.permutation(len(words))[:SAMPLE])
    frames = words.take(sample[:: max(1, len(sample) // FRAME_SAMPLE)]).reshape(-1, words.width)
    centre = frames.mean(axis=0, dtype=np.float64).astype(np.float32)
    basis = _principal(frames - centre, config.directions)
    empty = np.zeros(0, np.float32)
    projected = WordSpace(centre, basis, empty, empty).project(words, sample)
    descriptions = describe(projected)
    mean = descriptions.mean(axis=0, dtype=np.float64).astype(np.float32)
    return WordSpace(centre, basis, mean, _principal(descriptions - mean, config.dimension))


def describe(words: Float32Array) -> Float32Array:
    """[n, POINTS * P]: the paths of words [n, length, P] at points equally far apart."""
    points = along_path(words, POINTS) / np.float32(np.sqrt(POINTS))
    return np.ascontiguousarray(points.reshape(len(words), -1))


def along_path(words: Float32Array, points: int) -> Float32Array:
    """[n, points, P] points equally far apart along the paths of words [n, length, P], ends included."""
    sampled = np.empty((len(words), points, words.shape[2]), dtype=np.float32)
    _along_path(np.ascontiguousarray(words), sampled)
    return sampled


def nearest_positions(
    distances: Float32Array, groups: Int64Array, others: Int64Array, apart: int, count: int
) -> Int64Array:
    """[q, count] columns of the smallest of `distances` [q, M], in no order; -1 where there are fewer.

    Left out are columns whose group in `others` [M] is closer than `apart` to the row's in `groups` [q].
    """
    chosen = np.full((len(distances), count), -1, dtype=np.int64)
    _smallest(distances, groups, others, apart, chosen)
    return chosen


def _starts(n: int) -> range:
    return range(0, n, ROWS)


def _principal(rows: Float32Array, count: int) -> Float32Array:
    """[F, count] directions of largest variance of centred rows, each with its largest component positive."""
    covariance = rows.T.astype(np.float64) @ rows.astype(np.float64)
    directions = np.linalg.eigh(covariance)[1][:, ::-1][:, :count]
    largest = np.take_along_axis(directions, np.abs(directions).argmax(axis=0)[None], axis=0)
    return np.ascontiguousarray(directions * np.sign(largest), dtype=np.float32)


def _cells(embedded: Float32Array, config: IndexConfig) -> Float32Array:
    """Centroids of at most N / `cell` clusters."""
    count = max(1, len(embedded) // config.cell)
    if count == 1:
        return np.asarray(embedded.mean(axis=0, keepdims=True))
    from sklearn.cluster import KMeans  # half a second, which small corpora need not pay

    chosen = np.random.default_rng(config.seed).permutation(len(embedded))[: count * CELL_SAMPLE]
    kmeans = KMeans(n_clusters=count, init="random", n_init=1, max_iter=10, tol=0, random_state=config.seed)
    return np.asarray(kmeans.fit(embedded[np.sort(chosen)]).cluster_centers_, dtype=np.float32)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _along_path(words: Float32Array, out: Float32Array) -> None:
    n, length, width = words.shape
    points = out.shape[1]
    travelled = np.zeros(length, dtype=np.float64)
    for word in range(n):
        for frame in range(1, length):
            step = 0.0
            for number in range(width):
                step += (words[word, frame, number] - words[word, frame - 1, number]) ** 2
            travelled[frame] = travelled[frame - 1] + np.sqrt(step)
        frame = 0
        for point in range(points):
            goal = travelled[length - 1] * point / max(points - 1, 1)
            while frame < length - 2 and travelled[frame + 1] < goal:
                frame += 1
            after = min(frame + 1, length - 1)
            between = travelled[after] - travelled[frame]
            share = np.float32(min(1.0, (goal - travelled[frame]) / between) if between > 0 else 0.0)
            for number in range(width):
                here = words[word, frame, number]
                out[word, point, number] = here + share * (words[word, after, number] - here)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _smallest(distances: Float32Array, groups: Int64Array, others: Int64Array, apart: int, out: Int64Array) -> None:
    """A buffer of twice the wanted size is cut to its smaller half whenever it is full."""
    count = out.shape[1]
    values = np.empty(2 * count, dtype=np.float32)
    columns = np.empty(2 * count, dtype=np.int64)
    for row in range(len(distances)):
        held, bound = 0, np.float32(np.inf)
        for column in range(distances.shape[1]):
            value = distances[row, column]
            if value < bound and abs(others[column] - groups[row]) >= apart:
                values[held], columns[held] = value, column
                held += 1
                if held == 2 * count:
                    bound = np.partition(values, count - 1)[count - 1]
                    held = _keep(values, columns, held, bound, count)
        if held > count:
            held = _keep(values, columns, held, np.partition(values[:held], count - 1)[count - 1], count)
        out[row, :held] = columns[:held]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _keep(values: Float32Array, columns: Int64Array, held: int, bound: float, count: int) -> int:
    """Move what is below `bound`, then the first of what equals it, to the front; returns `count`."""
    kept = 0
    equal = count
    for i in range(held):
        if values[i] < bound:
            equal -= 1
    for i in range(held):
        value = values[i]
        if value < bound or (value == bound and equal > 0):
            if value == bound:
                equal -= 1
            values[kept], columns[kept] = value, columns[i]
            kept += 1
    return kept
