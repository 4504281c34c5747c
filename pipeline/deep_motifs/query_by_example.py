"""Query by example inside sequences (Deep Motifs, section 6.1).

The query is a run of words; a window of as many words slides over every clip, and the Earth Mover's Distance
between the signature of each window and the query's ranks the windows. Windows that overlap in one clip speak
of one event: the nearest of them is the hit (by clip and start where distances tie), the others are dropped.

A window's signature depends on which motifs it holds and how often, not on their order, so windows of the
same motifs are weighed once, and lower bounds rule most of the others out (`emd`). The answer is that
of computing every distance.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Float64Array, Int32Array, Int64Array, IntArray
from motionlake.deep_motifs.emd import emd_many
from motionlake.deep_motifs.emd_search import SignatureIndex
from motionlake.deep_motifs.signatures import Corpus, tf_idf, window_signatures
from motionlake.errors import UserError
from numpy.typing import NDArray

LEAST_WORDS: Final = 2
# Distinct windows looked at first for every hit wanted; twice as many while hits are still missing.
_AHEAD: Final = 4


@dataclass(frozen=True)
class ExampleQuery:
    """What to look for: the motifs of consecutive words.

    Attributes:
        motifs: [n] of the query's words, n >= 2.
        mirrored: [n] motifs of the same words mirrored left to right, to be looked for as well; or None.

    Raises:
        UserError: fewer than two words.
    """

    motifs: Int32Array
    mirrored: Int32Array | None = None

    def __post_init__(self) -> None:
        if len(self.motifs) < LEAST_WORDS:
            raise UserError(
                f"the query is too short: it holds {len(self.motifs)} motion words (of half a second, by default), and "
                f"at least {LEAST_WORDS} are needed; give a longer range (--from, --to)"
            )

    @property
    def n_words(self) -> int:
        return len(self.motifs)

    def signatures(self, idf: Float64Array) -> Float32Array:
        """[1 or 2, K]: of the query, and of the mirrored query."""
        rows = [self.motifs] if self.mirrored is None else [self.motifs, self.mirrored]
        return np.concatenate([window_signatures(motifs, idf, self.n_words) for motifs in rows])


@dataclass(frozen=True)
class RangeHit:
    """Frames [start, stop) of a clip, at its own rate, and their distance from the query.

    `mirrored`: the mirrored query is nearer than the query itself.
    """

    rank: int
    clip: str
    start: int
    stop: int
    distance: float
    mirrored: bool


def words_within(starts: Int64Array, stops: Int64Array, start: int, stop: int) -> slice:
    """The words that lie wholly within frames [start, stop); `starts`, `stops` [w] ascending."""
    first = int(np.searchsorted(starts, start))
    return slice(first, max(first, int(np.searchsorted(stops, stop, side="right"))))


def find_ranges(
    corpus: Corpus,
    query: ExampleQuery,
    k: int,
    *,
    clips: Collection[int] | None = None,
    without: tuple[int, int, int] | None = None,
) -> list[RangeHit]:
    """The k ranges most like a query, nearest first; no two of one clip overlap.

    Args:
        corpus: where to look. A clip of fewer words than the query is compared as a whole.
        query: what to look for.
        k: how many hits at most.
        clips: indices of the clips to look in; None for all.
        without: (clip, start, stop): windows of that clip that overlap these frames are left out.
    """
    windows = _windows(corpus, query.n_words, clips, without)
    return [
        RangeHit(rank, corpus.clips[near.clip].clip, near.start, near.stop, near.distance, near.mirrored)
        for rank, near in enumerate(nearest_apart(windows, query, k, corpus.idf, corpus.ground), start=1)
    ]


def distances_along(corpus: Corpus, clip: int, query: ExampleQuery) -> Float64Array:
    """[v] distance of the query from each window along a clip (figure 11); the lesser of both where it is mirrored."""
    windows = corpus.windows_of(clip, query.n_words)
    unique, where = np.unique(windows, axis=0, return_inverse=True)
    sides = [emd_many(signature, unique, corpus.ground) for signature in query.signatures(corpus.idf)]
    return np.asarray(np.min(sides, axis=0)[where.ravel()], dtype=np.float64)


def window_ranges(corpus: Corpus, clip: int, n_words: int) -> Int64Array:
    """[v, 2] half-open frames of each window of `n_words` words along a clip, at its own rate."""
    words = corpus.words_of(clip)
    starts, stops = corpus.starts[words], corpus.stops[words]
    width = min(n_words, len(starts))
    return np.column_stack([starts[: len(starts) - width + 1], stops[width - 1 :]])


@dataclass(frozen=True)
class WordWindows:
    """Windows of n words: where they lie, and which of the distinct ones each is.

    Attributes:
        clip, start, stop: [v] of each window, by clip and start.
        kind: [v] row of `signatures` [u, K], of windows that hold different motifs.
    """

    clip: Int64Array
    start: Int64Array
    stop: Int64Array
    kind: Int64Array
    signatures: Float32Array

    @staticmethod
    def of(clip: Int64Array, ranges: Int64Array, bags: Int32Array, idf: Float64Array) -> WordWindows:
        """Of their clips [v], frames [v, 2] and sorted motifs [v, n] (-1: none)."""
        unique, kind = distinct(bags)
        return WordWindows(clip, ranges[:, 0], ranges[:, 1], kind, signatures_of_bags(unique, idf))


def distinct(bags: Int32Array) -> tuple[Int32Array, Int64Array]:
    """Rows [u, n] that differ, and [v] which of these each of some rows [v, n] is.

    As `np.unique` by rows, but in another order and in a tenth of the time: rows are told apart by a number made of
    each, and looked at themselves once. Where two that differ have the same number, `np.unique` takes over.
    """
    _, first, where = np.unique(_numbers(bags), return_index=True, return_inverse=True)
    if not np.array_equal(bags[first][where], bags):
        unique, where = np.unique(bags, axis=0, return_inverse=True)
        return unique, where.ravel()
    return bags[first], where


def _numbers(rows: Int32Array) -> NDArray[np.uint64]:
    """[v] a number made of each of some rows."""
    factors = np.random.default_rng(0).integers(1 << 63, size=rows.shape[1], dtype=np.uint64) * np.uint64(2)
    return np.asarray(rows.astype(np.uint64) @ (factors + np.uint64(1)))


@dataclass(frozen=True)
class NearWindow:
    """Frames [start, stop) of a clip, by its index, and their distance from a query, or from its mirror image."""

    clip: int
    start: int
    stop: int
    distance: float
    mirrored: bool


def _windows(
    corpus: Corpus, n_words: int, clips: Collection[int] | None, without: tuple[int, int, int] | None
) -> WordWindows:
    """Every window of n words of some clips."""
    chosen = range(len(corpus.clips)) if clips is None else sorted(clips)
    ranges = np.concatenate([np.zeros((0, 2), np.int64), *(window_ranges(corpus, clip, n_words) for clip in chosen)])
    bags = [_bags(corpus.motifs[corpus.words_of(clip)], n_words) for clip in chosen]
    owners = np.repeat(np.array(list(chosen), dtype=np.int64), [len(bag) for bag in bags])
    kept = beside(owners, ranges, without)
    all_bags = np.concatenate([np.zeros((0, n_words), np.int32), *bags])
    return WordWindows.of(owners[kept], ranges[kept], all_bags[kept], corpus.idf)


def beside(clip: Int64Array, ranges: Int64Array, without: tuple[int, int, int] | None) -> BoolArray:
    """[v] which frames [v, 2] of clips [v] share none with (clip, start, stop)."""
    barred, first, last = without or (-1, 0, 0)
    return np.asarray(~((clip == barred) & (ranges[:, 0] < last) & (ranges[:, 1] > first)))


def _bags(motifs: Int32Array, n_words: int) -> Int32Array:
    """[v, n_words] sorted motifs of each window; a clip of fewer words is filled up with -1."""
    if len(motifs) < n_words:
        return np.sort(np.pad(motifs, (0, n_words - len(motifs)), constant_values=-1))[None]
    return np.sort(np.lib.stride_tricks.sliding_window_view(motifs, n_words), axis=1)


def bags_of(motifs: IntArray, first: Int64Array, words: Int64Array) -> Int32Array:
    """[v, n] sorted motifs of runs of words, n of the longest; of a shorter one -1 for what it lacks.

    Args:
        motifs: [W] of all words.
        first: [v] of each run.
        words: [v] how many it has.
    """
    steps = np.arange(words.max(initial=0))
    found = motifs[np.minimum(first[:, None] + steps, len(motifs) - 1)]
    return np.sort(np.where(steps < words[:, None], found, np.int32(-1)), axis=1)


def signatures_of_bags(bags: Int32Array, idf: Float64Array) -> Float32Array:
    """[u, K] signatures of windows by their motifs [u, n] (-1: none)."""
    counts = np.zeros((len(bags), len(idf) + 1), dtype=np.int64)
    np.add.at(counts, (np.arange(len(bags))[:, None], bags), 1)  # -1 falls into a last column, which is dropped
    return tf_idf(counts[:, :-1], idf)


def nearest_apart(
    windows: WordWindows, query: ExampleQuery, k: int, idf: Float64Array, ground: Float64Array
) -> list[NearWindow]:
    """The k windows nearest to a query, nearest first; no two of one clip overlap."""
    if k < 1 or not len(windows.clip):
        return []
    index = SignatureIndex.build(windows.signatures, ground)
    signatures = query.signatures(idf)
    count = _AHEAD * k
    while True:
        sides = np.full((len(signatures), len(index)), np.inf)
        floor = np.inf
        for side, signature in zip(sides, signatures, strict=True):
            nearest = index.nearest(signature, count)
            side[nearest.indices] = nearest.distances
            if count < len(index):
                floor = min(floor, nearest.distances[-1])
        distance = sides.min(axis=0)
        chosen = _apart(windows, distance[windows.kind], floor, k)
        if len(chosen) == k or count >= len(index):
            break
        count *= 2
    mirrored, kind = sides.argmin(axis=0) == 1, windows.kind
    return [
        NearWindow(
            int(windows.clip[at]), int(windows.start[at]), int(windows.stop[at]), float(distance[kind[at]]),
            bool(mirrored[kind[at]]),
        )
        for at in chosen
    ]  # fmt: skip


def _apart(windows: WordWindows, distance: Float64Array, floor: float, k: int) -> list[int]:
    """The first k windows by distance, of those nearer than `floor`, that overlap none taken before."""
    candidates = np.flatnonzero(distance < floor)
    taken: dict[int, list[tuple[int, int]]] = {}
    chosen: list[int] = []
    for i in candidates[np.argsort(distance[candidates], kind="stable")].tolist():
        if len(chosen) == k:
            break
        start, stop = int(windows.start[i]), int(windows.stop[i])
        ranges = taken.setdefault(int(windows.clip[i]), [])
        if all(stop <= first or start >= last for first, last in ranges):
            ranges.append((start, stop))
            chosen.append(i)
    return chosen
