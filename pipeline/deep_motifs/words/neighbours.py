"""The nearest words of every word under DTW, and all pairs (Deep Motifs, sections 3.3 and 3.4).

Two methods. "approximate" takes candidates from an embedding in an inverted file (`word_index`), aligns them in 16
dimensions, and aligns the best of those in full; what it misses `bench.neighbours` measures. "exact" goes on from
there: no word is left unaligned unless a lower bound shows it to be farther than the k-th found (`lower_bounds`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Final, Literal

import numpy as np
from motionlake.arrays import Float32Array, Int64Array
from motionlake.deep_motifs.words.dtw import clip_pair_dtw, listed_distances
from motionlake.deep_motifs.words.lower_bounds import WordBounds, survivors
from motionlake.deep_motifs.words.windows import WordSet
from motionlake.deep_motifs.words.word_index import (
    IndexConfig,
    WordIndex,
    WordSpace,
    fit_index,
    nearest_centroids,
    nearest_positions,
)
from motionlake.motion.dtw import Metric
from safetensors import safe_open
from safetensors.numpy import save_file
from threadpoolctl import threadpool_limits

Method = Literal["exact", "approximate"]

QUERY_ROWS: Final = 256  # queries that meet their candidates in one matrix product
COLUMN_WORDS: Final = 4096  # columns of one block of all pairs


@dataclass(frozen=True)
class SearchConfig:
    """How neighbours are sought.

    Attributes:
        probed: words of the cells that a query meets.
        candidates: of them, nearest in the embedding, aligned in `index.directions` dimensions.
        aligned: of these, aligned in full; at least twice the neighbours wanted.
        index: of the embedding.
    """

    probed: int = 40_000
    candidates: int = 768
    aligned: int = 64
    index: IndexConfig = field(default_factory=IndexConfig)


@dataclass(frozen=True)
class Neighbours:
    """The k nearest words of each of n words, nearest first, the lower index first where two are equally near.

    Attributes:
        indices: [n, k] int64; -1 where there are fewer than k words to be found.
        distances: [n, k] float32 (`dtw.word_distances`); infinite where there is no word.
    """

    indices: Int64Array
    distances: Float32Array


@dataclass(frozen=True)
class Searched:
    """Words prepared for search.

    Attributes:
        words: N of them.
        groups: [N] as in `nearest_words`.
        index: their embedding.
    """

    words: WordSet
    groups: Int64Array
    index: WordIndex


def nearest_words(
    words: WordSet | Float32Array,
    k: int,
    *,
    groups: Int64Array | None = None,
    apart: int = 1,
    method: Method = "exact",
    metric: Metric = "euclidean",
    config: SearchConfig | None = None,
    threads: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Neighbours:
    """The k nearest words of each word of a corpus under DTW.

    Args:
        words: N words, as a `WordSet` or an array [N, length, D].
        k: neighbours of a word.
        groups: [N] numbers; words whose numbers differ by less than `apart` are no neighbours. Clips: the clip's
            index, for neighbours of other clips alone. Copies: the source word's index. Words of a clip that overlap:
            the place of the first frame, with `apart` the length of a word. Left out: every word but the word itself.
        apart: see `groups`.
        method: "exact" or "approximate", see the module.
        metric: of frames. Bounds hold for "euclidean"; under "geodesic" the exact method aligns all pairs.
        config: how candidates are found.
        threads: which share the work; the result does not depend on their number.
        progress: told of words done and their number.

    Raises:
        ValueError: no words, k < 1, features that are not finite, or groups of another number.
    """
    corpus = words if isinstance(words, WordSet) else WordSet.of_words(words)
    chosen = config or SearchConfig()
    searched = prepare(corpus, groups, chosen)
    return search(
        searched, corpus, searched.groups, k, apart=apart, method=method, metric=metric, config=chosen,
        threads=threads, progress=progress,
    )  # fmt: skip


def prepare(words: WordSet, groups: Int64Array | None = None, config: SearchConfig | None = None) -> Searched:
    """Index a corpus, for searches with any queries."""
    numbers = np.arange(len(words)) if groups is None else np.asarray(groups)
    if numbers.shape != (len(words),):
        raise ValueError(f"groups of shape {numbers.shape} do not fit {len(words)} words")
    return Searched(words, numbers.astype(np.int64), fit_index(words, (config or SearchConfig()).index))


def search(
    corpus: Searched,
    queries: WordSet,
    groups: Int64Array,
    k: int,
    *,
    apart: int = 1,
    method: Method = "approximate",
    metric: Metric = "euclidean",
    config: SearchConfig | None = None,
    threads: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Neighbours:
    """The k nearest words of a corpus for words that need not be of it; arguments as in `nearest_words`.

    Args:
        groups: [n] of the queries; a number `apart` from all others leaves nothing out.

    Raises:
        ValueError: k < 1, or queries of another shape.
    """
    if k < 1:
        raise ValueError(f"k is {k}: there are no {k} nearest words")
    if method not in ("exact", "approximate"):
        raise ValueError(f"method is {method!r}, not exact or approximate")
    if queries.length != corpus.words.length or queries.width != corpus.words.width:
        raise ValueError("queries and corpus hold words of different shapes")
    found = _Search(corpus, queries, groups.astype(np.int64), k, apart, metric, config or SearchConfig())
    indices = np.full((len(queries), k), -1, dtype=np.int64)
    distances = np.full((len(queries), k), np.inf, dtype=np.float32)
    bounds = WordBounds.of(corpus.index.projected_words) if method == "exact" and metric == "euclidean" else None
    done = 0
    with threadpool_limits(limits=1), ThreadPoolExecutor(threads) as pool:
        for rows, answer in pool.map(lambda block: found.answer(block[0], block[1], method, bounds), found.blocks()):
            indices[rows], distances[rows] = answer.indices, answer.distances
            done += len(rows)
            if progress:
                progress(done, len(queries))
    return Neighbours(indices, distances)


def all_pairs(words: WordSet, metric: Metric = "euclidean", rows: int = 512) -> Iterator[tuple[slice, Float32Array]]:
    """DTW distances of all pairs, some rows at a time: (words, [n, N] distances).

    Each pair of frames is compared once a block, so words that overlap cost little more than their alignment.
    Memory holds one block.
    """
    for first in range(0, len(words), rows):
        block = slice(first, min(first + rows, len(words)))
        distances = np.empty((block.stop - block.start, len(words)), dtype=np.float32)
        left, left_starts = _frames_of(words, block)
        for start in range(0, len(words), COLUMN_WORDS):
            columns = slice(start, min(start + COLUMN_WORDS, len(words)))
            right, right_starts = _frames_of(words, columns)
            distances[:, columns] = clip_pair_dtw(left, left_starts, right, right_starts, words.length, metric)
        yield block, distances


def _frames_of(words: WordSet, chosen: slice) -> tuple[Float32Array, Int64Array]:
    """The stretch of frames that holds some words, and where they start in it."""
    starts = words.starts[chosen]
    low, high = int(starts.min()), int(starts.max()) + words.length
    return words.frames[low:high], starts - low


@dataclass(frozen=True)
class _Search:
    """One search: `blocks` are independent of one another."""

    corpus: Searched
    queries: WordSet
    groups: Int64Array
    k: int
    apart: int
    metric: Metric
    config: SearchConfig

    def blocks(self) -> Iterator[tuple[int, Int64Array]]:
        """(cell, queries of it), in the order of the cells."""
        cells = self._cells()
        order = np.argsort(cells, kind="stable")
        for cell in np.unique(cells).tolist():
            low, high = np.searchsorted(cells[order], [cell, cell + 1])
            for first in range(low, high, QUERY_ROWS):
                yield cell, order[first : min(first + QUERY_ROWS, high)]

    def _cells(self) -> Int64Array:
        index = self.corpus.index
        cells = np.empty(len(self.queries), dtype=np.int64)
        for first in range(0, len(cells), COLUMN_WORDS):
            rows = slice(first, min(first + COLUMN_WORDS, len(cells)))
            cells[rows] = nearest_centroids(index.space.embed(index.space.project(self.queries, rows)), index.centroids)
        return cells

    def answer(
        self, cell: int, rows: Int64Array, method: Method, bounds: WordBounds | None
    ) -> tuple[Int64Array, Neighbours]:
        """The neighbours of some queries of one cell."""
        found = self._nearest(rows, self._candidates(cell, rows))
        if method == "approximate":
            return rows, found
        if bounds is None:
            lists = [np.arange(len(self.corpus.words))] * len(rows)
        else:
            queries = WordBounds.of(self.corpus.index.space.project(self.queries, rows))
            lists = [self.corpus.index.order[p] for p in survivors(queries, bounds, found.distances[:, -1])]
        answers = [
            self._nearest(rows[i : i + 1], np.sort(self._allowed(row, lists[i]))[None]) for i, row in enumerate(rows)
        ]
        return rows, Neighbours(
            np.concatenate([a.indices for a in answers]), np.concatenate([a.distances for a in answers])
        )

    def _allowed(self, query: int, words: Int64Array) -> Int64Array:
        return np.asarray(words[np.abs(self.corpus.groups[words] - self.groups[query]) >= self.apart])

    def _candidates(self, cell: int, rows: Int64Array) -> Int64Array:
        """[n, C] words worth aligning in full; -1 where there are fewer."""
        index, config = self.corpus.index, self.config
        wanted = max(config.aligned, 2 * self.k)
        positions = index.probed(cell, config.probed)
        projected = index.space.project(self.queries, rows)
        vectors = index.space.embed(projected)
        apart = index.norms[positions] - 2 * (vectors @ index.embedded[positions].T)
        others = self.corpus.groups[index.order[positions]]
        near = nearest_positions(apart, self.groups[rows], others, self.apart, max(config.candidates, wanted))
        near = np.where(near >= 0, positions[near], -1)
        own = np.arange(len(rows), dtype=np.int64) * index.length
        frames = projected.reshape(-1, projected.shape[2])
        distances = listed_distances(frames, own, index.projected, index.starts, near, index.length)
        best = np.argsort(distances, axis=1, kind="stable")[:, :wanted]
        near = np.take_along_axis(near, best, axis=1)
        return np.where(near >= 0, index.order[near], -1)

    def _nearest(self, rows: Int64Array, lists: Int64Array) -> Neighbours:
        """The k nearest of listed words [n, C]."""
        queries, words = self.queries, self.corpus.words
        distances = listed_distances(
            queries.frames, queries.starts[rows], words.frames, words.starts, lists, words.length, self.metric,
            centre=self.corpus.index.space.centre,
        )  # fmt: skip
        best = np.lexsort((lists, distances), axis=1)[:, : self.k]
        indices = np.full((len(rows), self.k), -1, dtype=np.int64)
        nearest = np.full((len(rows), self.k), np.inf, dtype=np.float32)
        indices[:, : best.shape[1]] = np.take_along_axis(lists, best, axis=1)
        nearest[:, : best.shape[1]] = np.take_along_axis(distances, best, axis=1)
        return Neighbours(indices, nearest)


LENGTH = "length"


def save_searched(searched: Searched, path: Path, notes: Mapping[str, str]) -> None:
    """Write a corpus and its index, with notes of the caller's; what can be projected again is left out."""
    index = searched.index
    tensors = {
        **asdict(index.space),
        "centroids": index.centroids,
        "order": index.order,
        "offsets": index.offsets,
        "embedded": index.embedded,
        "frames": searched.words.frames,
        "starts": searched.words.starts,
        "groups": searched.groups,
    }
    save_file(tensors, path, {**notes, LENGTH: str(searched.words.length)})


def load_searched(path: Path) -> tuple[Searched, dict[str, str]]:
    """What `save_searched` wrote, and the notes."""
    with safe_open(path, framework="numpy") as file:
        notes = dict(file.metadata())
        found = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    space = WordSpace(found["centre"], found["basis"], found["mean"], found["components"])
    words = WordSet(found["frames"], found["starts"], int(notes.pop(LENGTH)))
    index = WordIndex.of(space, words, found["centroids"], found["order"], found["offsets"], found["embedded"])
    return Searched(words, found["groups"], index), notes
