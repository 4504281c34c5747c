"""The nearest words under DTW (Deep Motifs, sections 3.3 and 3.4).

Two methods. "approximate" takes candidates from an embedding in an inverted file (`word_index`), aligns them in 16
dimensions, and aligns the best of those in full; what it misses `bench.neighbours` measures. "exact" goes on from
there: no word is left unaligned unless a lower bound shows it to be farther than the k-th found (`lower_bounds`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from motionlake.arrays import Float32Array, Int64Array
from motionlake.deep_motifs.words.dtw import listed_distances
from motionlake.deep_motifs.words.lower_bounds import WordBounds, survivors
from motionlake.deep_motifs.words.word_index import WordIndex, WordSet, WordSpace, nearest_centroids
from motionlake.kernels import njit
from motionlake.motion.dtw import Metric
from motionlake.threads import limited
from motionlake.weights import read_tensors, save_tensors

Method = Literal["exact", "approximate"]

QUERY_ROWS: Final = 256  # queries that meet their candidates in one matrix product
METADATA_KEY: Final = "word_index"


@dataclass(frozen=True)
class SearchConfig:
    """How the nearest words are sought.

    Attributes:
        method: "exact" or "approximate", see the module.
        metric: of frames. Bounds hold for "euclidean"; under "geodesic" the exact method aligns all pairs.
        apart: words whose groups differ by less are no neighbours.
        probed: words of the cells that a query meets.
        candidates: of them, nearest in the embedding, aligned in the index's directions.
        aligned: of these, aligned in full; at least twice the neighbours wanted.
    """

    method: Method = "approximate"
    metric: Metric = "euclidean"
    apart: int = 1
    probed: int = 40_000
    candidates: int = 768
    aligned: int = 64


@dataclass(frozen=True)
class Neighbours:
    """The k nearest words of each of n words, nearest first, the lower index first where two are equally near.

    Attributes:
        indices: [n, k] int64; -1 where there are fewer than k words to be found.
        distances: [n, k] float32 (`dtw.word_distances`); infinite where there is no word.
    """

    indices: Int64Array
    distances: Float32Array


def search(
    corpus: WordIndex,
    queries: WordSet,
    groups: Int64Array,
    k: int,
    config: SearchConfig | None = None,
    *,
    threads: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Neighbours:
    """The k nearest words of a corpus under DTW for each of n words, which need not be of it.

    Args:
        corpus: the words to be found, with their groups.
        queries: n words.
        groups: [n] of the queries; words whose groups differ by less than `apart` are no neighbours. Clips: the clip's
            index, for neighbours of other clips alone. Copies: the source word's index. Words of a clip that overlap:
            the place of the first frame, with `apart` the length of a word.
        k: neighbours of a word.
        config: how they are sought.
        threads: which share the work; the result does not depend on their number.
        progress: told of words done and their number.

    Raises:
        ValueError: k < 1, or queries of another shape.
    """
    config = config or SearchConfig()
    if k < 1:
        raise ValueError(f"k is {k}: there are no {k} nearest words")
    if queries.length != corpus.words.length or queries.width != corpus.words.width:
        raise ValueError("queries and corpus hold words of different shapes")
    projected, bounds = corpus.projected, None  # made here, before threads need it
    if config.method == "exact" and config.metric == "euclidean":
        bounds = WordBounds.of(projected.frames.reshape(len(projected), projected.length, -1))
    found = _Search(corpus, queries, groups.astype(np.int64), k, config, bounds)
    indices = np.full((len(queries), k), -1, dtype=np.int64)
    distances = np.full((len(queries), k), np.inf, dtype=np.float32)
    done = 0
    with limited(1), ThreadPoolExecutor(threads) as pool:
        for rows, answer in pool.map(found.answer, found.blocks()):
            indices[rows], distances[rows] = answer.indices, answer.distances
            done += len(rows)
            if progress:
                progress(done, len(queries))
    return Neighbours(indices, distances)


@dataclass(frozen=True)
class _Search:
    """One search: `blocks` are independent of one another; `bounds` of the corpus where they rule words out."""

    corpus: WordIndex
    queries: WordSet
    groups: Int64Array
    k: int
    config: SearchConfig
    bounds: WordBounds | None

    def blocks(self) -> Iterator[tuple[int, Int64Array]]:
        """(cell, queries of it), in the order of the cells."""
        cells = nearest_centroids(self.corpus.space.embed_all(self.queries), self.corpus.centroids)
        order = np.argsort(cells, kind="stable")
        for cell in np.unique(cells).tolist():
            low, high = np.searchsorted(cells[order], [cell, cell + 1])
            for first in range(low, high, QUERY_ROWS):
                yield cell, order[first : min(first + QUERY_ROWS, high)]

    def answer(self, block: tuple[int, Int64Array]) -> tuple[Int64Array, Neighbours]:
        """Some queries of one cell, and their neighbours."""
        cell, rows = block
        found = self._nearest(rows, self._candidates(cell, rows))
        if self.config.method == "approximate":
            return rows, found
        lists = [np.arange(len(self.corpus.words))] * len(rows)
        if self.bounds is not None:
            queries = WordBounds.of(self.corpus.space.project(self.queries, rows))
            lists = [self.corpus.order[p] for p in survivors(queries, self.bounds, found.distances[:, -1])]
        answers = []
        for i, (row, words) in enumerate(zip(rows, lists, strict=True)):
            allowed = words[np.abs(self.corpus.groups[words] - self.groups[row]) >= self.config.apart]
            answers.append(self._nearest(rows[i : i + 1], np.sort(allowed)[None]))
        return rows, Neighbours(
            np.concatenate([a.indices for a in answers]), np.concatenate([a.distances for a in answers])
        )

    def _candidates(self, cell: int, rows: Int64Array) -> Int64Array:
        """[n, C] words worth aligning in full; -1 where there are fewer."""
        corpus, config = self.corpus, self.config
        wanted = max(config.aligned, 2 * self.k)
        positions = corpus.probed(cell, config.probed)
        projected = corpus.space.project(self.queries, rows)
        vectors = corpus.space.embed(projected)
        gaps = corpus.norms[positions] - 2 * (vectors @ corpus.embedded[positions].T)
        near = np.full((len(rows), max(config.candidates, wanted)), -1, dtype=np.int64)
        _smallest(gaps, self.groups[rows], corpus.groups[corpus.order[positions]], config.apart, near)
        near = np.where(near >= 0, positions[near], -1)
        distances = listed_distances(WordSet.of_words(projected), corpus.projected, near)
        best = np.argsort(distances, axis=1, kind="stable")[:, :wanted]
        near = np.take_along_axis(near, best, axis=1)
        return np.where(near >= 0, corpus.order[near], -1)

    def _nearest(self, rows: Int64Array, lists: Int64Array) -> Neighbours:
        """The k nearest of listed words [n, C]."""
        centre = self.corpus.space.centre
        queries = self.queries.chosen(rows)
        distances = listed_distances(queries, self.corpus.words, lists, self.config.metric, centre=centre)
        best = np.lexsort((lists, distances), axis=1)[:, : self.k]
        empty = ((0, 0), (0, self.k - best.shape[1]))
        return Neighbours(
            np.pad(np.take_along_axis(lists, best, axis=1), empty, constant_values=-1),
            np.pad(np.take_along_axis(distances, best, axis=1), empty, constant_values=np.inf),
        )


def save_index(index: WordIndex, path: Path, notes: Mapping[str, Any]) -> None:
    """Write an index with notes of the caller's; what can be projected again is left out."""
    own = {name: getattr(index, name) for name in ("groups", "centroids", "order", "offsets", "embedded")}
    tensors = {**asdict(index.space), **own, "frames": index.words.frames, "starts": index.words.starts}
    save_tensors(path, tensors, METADATA_KEY, {**notes, "length": index.words.length})


def load_index(path: Path) -> tuple[WordIndex, dict[str, Any]]:
    """What `save_index` wrote, and the notes. Raises `ValueError` if the file holds something else."""
    found, notes = read_tensors(path, METADATA_KEY)
    words = WordSet(found.pop("frames"), found.pop("starts"), notes.pop("length"))
    space = WordSpace(*(found.pop(name) for name in ("centre", "basis", "mean", "components")))
    return WordIndex(words=words, space=space, **found), notes


@njit(cache=True, nogil=True)
def _smallest(distances: Float32Array, groups: Int64Array, others: Int64Array, apart: int, out: Int64Array) -> None:
    """out [q, C]: columns of the smallest of `distances` [q, M], in no order.

    Left out are columns whose group in `others` [M] is closer than `apart` to the row's in `groups` [q].
    """
    # A buffer of twice the wanted size is cut to its smaller half whenever it is full.
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


@njit(cache=True, nogil=True)
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
