"""Sets of motion words, and an index of them for the search of nearest words under DTW: an inverted file.

Words that DTW brings together pass through the same poses at different speeds. So a word is described by its path
however fast it is walked: its frames in the P directions of largest variance, at eight points equally far apart along
the path. The d principal components of this are clustered into cells by k-means; a query meets the words of the cells
nearest to its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, Self

import numpy as np
from motionlake.arrays import Float32Array, Int64Array
from motionlake.kernels import njit
from motionlake.motion.features import WordConfig, padded, windows
from motionlake.threads import limited

POINTS: Final = 8  # of a path
ROWS: Final = 20_000  # words described at a time
CELL_ROWS: Final = 4096  # words that meet all centroids at a time
SAMPLE: Final = 20_000  # words that the embedding is fitted to
FRAME_SAMPLE: Final = 5_000  # words that the directions of frames are fitted to
CELL_SAMPLE: Final = 40  # words that a cell's centroid is fitted to


@dataclass(frozen=True)
class WordSet:
    """N words of `length` frames: word i is `frames[starts[i] : starts[i] + length]`.

    Words of stride 4 and length 16 share their frames, so that N words of clips take 4 N frames of memory.

    Attributes:
        frames: [T, D] float32, C-contiguous.
        starts: [N] first frame of each word.
        length: frames of a word.

    Raises:
        ValueError: a word that reaches beyond the frames.
    """

    frames: Float32Array
    starts: Int64Array
    length: int

    def __post_init__(self) -> None:
        if len(self) and (self.starts.min() < 0 or self.starts.max() + self.length > len(self.frames)):
            raise ValueError("a word reaches beyond its clip")

    @classmethod
    def of_words(cls, words: Float32Array) -> Self:
        """`words` [N, length, D], each with frames of its own."""
        n, length, width = words.shape
        frames = np.ascontiguousarray(words, dtype=np.float32).reshape(n * length, width)
        return cls(frames, np.arange(n, dtype=np.int64) * length, length)

    @classmethod
    def of_clips(cls, features: Sequence[Float32Array], config: WordConfig) -> tuple[Self, Int64Array]:
        """The words of clips of [T, D] frames each, and [N] the index of the clip each word is of.

        Raises `ValueError` for no clip, or a clip without frames.
        """
        if not features:
            raise ValueError("no clips: no words")
        filled = [padded(np.asarray(clip, dtype=np.float32), config) for clip in features]
        firsts = np.cumsum([0, *(len(clip) for clip in filled[:-1])])
        starts = [windows(len(clip), config) for clip in features]
        clips = np.repeat(np.arange(len(features)), [len(s) for s in starts])
        placed = np.concatenate([first + s for first, s in zip(firsts, starts, strict=True)])
        return cls(np.ascontiguousarray(np.concatenate(filled)), placed, config.length), clips

    def __len__(self) -> int:
        return len(self.starts)

    @property
    def width(self) -> int:
        """D: numbers a frame."""
        return int(self.frames.shape[1])

    def take(self, chosen: slice | Int64Array) -> Float32Array:
        """[n, length, D] copies of chosen words."""
        return np.asarray(self.frames[self.starts[chosen][:, None] + np.arange(self.length)])

    def chosen(self, chosen: slice | Int64Array) -> WordSet:
        """Some of the words, with the same frames."""
        return WordSet(self.frames, self.starts[chosen], self.length)


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

    def embed_all(self, words: WordSet) -> Float32Array:
        """[N, d] of all words of a set."""
        parts = [self.embed(self.project(words, rows)) for rows in _blocks(len(words))]
        return np.concatenate([np.zeros((0, self.components.shape[1]), np.float32), *parts])


@dataclass(frozen=True)
class WordIndex:
    """N words prepared for search, in cells.

    Attributes:
        words: N of them.
        groups: [N] numbers; words of alike numbers are no neighbours, see `neighbours.search`.
        space: of the embedding.
        centroids: [K, d] of the cells.
        order: [N] words, cell by cell.
        offsets: [K + 1]: cell c holds `order[offsets[c] : offsets[c + 1]]`.
        embedded: [N, d] in that order.
    """

    words: WordSet
    groups: Int64Array
    space: WordSpace
    centroids: Float32Array
    order: Int64Array
    offsets: Int64Array
    embedded: Float32Array

    @cached_property
    def projected(self) -> WordSet:
        """The projected words, in the order of the cells."""
        found = np.empty((len(self.words), self.words.length, self.space.basis.shape[1]), dtype=np.float32)
        for rows in _blocks(len(found)):
            found[rows] = self.space.project(self.words, self.order[rows])
        return WordSet.of_words(found)

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


def fit_index(words: WordSet, groups: Int64Array | None = None, config: IndexConfig | None = None) -> WordIndex:
    """Embed words and group them into cells; depends on the words and the seed alone.

    Args:
        words: N words.
        groups: [N] see `WordIndex`; by default every word has its own.
        config: what the index is made of.

    Raises:
        ValueError: no words, features that are not finite, or groups of another number.
    """
    config = config or IndexConfig()
    numbers = np.arange(len(words)) if groups is None else np.asarray(groups, dtype=np.int64)
    if numbers.shape != (len(words),):
        raise ValueError(f"groups of shape {numbers.shape} do not fit {len(words)} words")
    if not len(words):
        raise ValueError("no words: nothing can be searched")
    if not all(np.isfinite(words.frames[rows]).all() for rows in _blocks(len(words.frames))):
        raise ValueError("words hold features that are not finite")
    with limited(1):
        space = _fit_space(words, config)
        embedded = space.embed_all(words)
        centroids = _cells(embedded, config)
        cells = nearest_centroids(embedded, centroids)
        order = np.argsort(cells, kind="stable").astype(np.int64)
        offsets = np.searchsorted(cells[order], np.arange(len(centroids) + 1)).astype(np.int64)
        return WordIndex(words, numbers, space, centroids, order, offsets, embedded[order])


def nearest_centroids(vectors: Float32Array, centroids: Float32Array) -> Int64Array:
    """[n] nearest of `centroids` [K, d] to each of `vectors` [n, d], the lowest index where two tie."""
    own = np.einsum("kd,kd->k", centroids, centroids)
    blocks = [vectors[i : i + CELL_ROWS] for i in range(0, len(vectors), CELL_ROWS)]
    cells = [np.argmin(own - 2 * (block @ centroids.T), axis=1) for block in blocks]
    return np.concatenate([np.zeros(0, np.int64), *cells])


def _fit_space(words: WordSet, config: IndexConfig) -> WordSpace:
    """Principal directions of frames, then of descriptions, from a sample of words."""
    rng = np.random.default_rng(config.seed)
    sample = np.sort(rng.permutation(len(words))[:SAMPLE])
    frames = words.take(sample[:: max(1, len(sample) // FRAME_SAMPLE)]).reshape(-1, words.width)
    centre = frames.mean(axis=0, dtype=np.float64).astype(np.float32)
    basis = _principal(frames - centre, config.directions)
    empty = np.zeros(0, np.float32)
    descriptions = describe(WordSpace(centre, basis, empty, empty).project(words, sample))
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


def _blocks(n: int) -> list[slice]:
    return [slice(first, min(first + ROWS, n)) for first in range(0, n, ROWS)]


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


@njit(cache=True, nogil=True)
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
