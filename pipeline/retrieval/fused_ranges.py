"""Ranges by several methods at once, along the graph of their likeness: the way to find that commands take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Float64Array, Int64Array
from motionlake.deep_motifs.emd import emd_many
from motionlake.deep_motifs.end_to_end import Stretches, nearest_end_to_end
from motionlake.deep_motifs.query_by_example import LEAST_WORDS, ExampleQuery, bags_of, signatures_of_bags
from motionlake.deep_motifs.word_sets import set_distances, set_matrix, spread
from motionlake.errors import DamagedError, UserError
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.layout import Lake
from motionlake.lake.settings import served_config
from motionlake.retrieval.encode import asked_words, query_motifs, query_vectors
from motionlake.retrieval.hits import Hit, range_hit
from motionlake.retrieval.moves import MovesRangeSearcher
from motionlake.retrieval.protocol import EVERYTHING, Finds, LakeSearcher, Query, Scope, not_ready
from motionlake.retrieval.query_by_example import WordsSearcher
from motionlake.retrieval.registry import ready
from motionlake.retrieval.window_graph import along_windows
from motionlake.stages.embed import vectors_of_clips
from motionlake.stages.reader import LakeReader
from motionlake.stages.shortlist_files import MOST

# How much each counts, looked at on five sets of recordings; none was left out.
WEIGHTS: Final = {"signature": 1.0, "embedding": 1.0, "moves": 2.0}
DIRECT: Final = 0.1  # what the distance itself counts beside the way along the graph
UNIT: Final = 10  # the answer by whose distance others are measured
REACH: Final = 6000  # windows nearest by their embedded words, which are compared by all
NODES: Final = 2000  # windows of the graph
_LEAST: Final = 1e-12
_EQUAL: Final = 1e-6  # units
_ROUNDING: Final = 5e-3  # of distances of moves
_FAR: Final = 1000


@dataclass(frozen=True)
class _Asked:
    """The words of a query: their motifs [n] and embeddings [n, d]; its moves [m, 135], where these can be compared."""

    motifs: np.ndarray
    vectors: Float32Array
    moves: Float32Array | None


@dataclass(frozen=True)
class _Windows:
    """[v] windows of as many words as the query, or of whole clips of fewer, by clip and start.

    Attributes:
        clip: index of each.
        first: of its words, counted within the clip.
        words: how many it has.
        start, stop: its frames.
    """

    clip: Int64Array
    first: Int64Array
    words: Int64Array
    start: Int64Array
    stop: Int64Array

    def of(self, chosen: BoolArray) -> _Windows:
        return _Windows(*(values[chosen] for values in vars(self).values()))


class FusedRangeSearcher(LakeSearcher):
    """Ranges by signature, embedded words and moves, along the graph of their likeness; a `Searcher`.

    Windows of as many words as the query are compared with it in three ways. By a way with distance d, and u ten
    answers on, a window is as near as 1 / (1 + d / u); it is near by the mean of these, by `WEIGHTS`. Among the nearest
    windows what is near the query passes on to what is near them (`along_windows`). The distance of a window is one
    less n (a + .1 n) / 1.1, with a along the graph and n how near it is by itself, which says where exactly a movement
    lies. Answers do not overlap.

    A lake of more than 20,000 clips is searched by signatures alone.

    Raises:
        UserError: the lake has no motifs or no embedded words yet.
    """

    name = "fused"
    finds: Finds = "range"
    several = True

    def __init__(self, lake: Lake) -> None:
        super().__init__(lake)
        self._words = WordsSearcher(lake)
        with reading(lake) as con:
            (count,) = fetch(con, "count_clips")
        self._large = count["clips"] > MOST
        if self._large:
            return
        self.corpus = self._words.corpus
        with reading(lake) as con:
            parts = {row["clip"]: row["part"] for row in fetch(con, "clips_with_parts")}
            known = vectors_of_clips(LakeReader(con, lake, served_config(lake)), parts)
        counts = np.diff(self.corpus.offsets).tolist()
        if any(len(known.get(clip.clip, ())) != count for clip, count in zip(self.corpus.clips, counts, strict=True)):
            raise UserError(f"{lake.root}: has words that are not embedded yet; embed them with `motionlake run all`")
        self._vectors = np.concatenate([known[clip.clip] for clip in self.corpus.clips])
        self._moves = MovesRangeSearcher(lake) if "moves" in ready(lake, "range") else None

    def search(self, queries: Sequence[Query], k: int, scope: Scope = EVERYTHING) -> list[list[Hit]]:
        """As `Searcher.search`."""
        return self._words.search(queries, k, scope) if self._large else super().search(queries, k, scope)

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        """As `Searcher.distances`, by signatures and moves alone; u is the distance of the tenth of the gallery."""
        found = self._words.distances(queries, gallery)
        if self._large or self._moves is None or not found.size:
            return found
        of_each = {"signature": found, "moves": _rounded(self._moves.distances(queries, gallery))}
        near = [WEIGHTS[name] * _near(row, _unit(row, 1)) for name, rows in of_each.items() for row in rows]
        total = sum(WEIGHTS[name] for name in of_each)
        return np.asarray(1 - np.array(near).reshape(2, *found.shape).sum(axis=0) / total)

    def nearest(self, queries: Sequence[Query], k: int, scope: Scope, *, mirrored: bool) -> list[list[Hit]]:
        return [self._answers(query, scope, k, mirrored=mirrored) for query in queries]

    def _answers(self, query: Query, scope: Scope, k: int, *, mirrored: bool) -> list[Hit]:
        corpus = self.corpus
        if query.clip is not None and query.clip not in corpus.positions:
            raise not_ready(self.lake, query.clip, "signature")
        asked = self._asked(query, mirrored=mirrored)
        barred = None
        if query.clip is not None and not scope.own:
            at = corpus.positions[query.clip]
            barred = (at, query.start or 0, corpus.clips[at].frames if query.stop is None else query.stop)
        windows = self._windows(len(asked.motifs), scope, barred)
        if not len(windows.clip):
            return []
        found = Stretches(windows.clip, windows.start, windows.stop, self._distances(asked, windows))
        answers = nearest_end_to_end(found, np.array([clip.frames for clip in corpus.clips]), k, barred)
        return [
            range_hit(corpus.clips[clip], start, stop, distance)
            for clip, start, stop, distance in zip(*(v.tolist() for v in vars(answers).values()), strict=True)
        ]

    def _asked(self, query: Query, *, mirrored: bool) -> _Asked:
        with reading(self.lake) as con:
            motifs = query_motifs(con, self.lake, query, least=LEAST_WORDS, mirrored=mirrored)
            if query.clip is None or mirrored:
                vectors = query_vectors(con, self.lake, query, mirrored=mirrored)
            else:
                at = self.corpus.words_of(self.corpus.positions[query.clip])
                vectors = self._vectors[at][asked_words(con, self.lake, query).chosen]
        moves = None
        if self._moves is not None:
            try:
                moves = self._moves.moves(query, mirrored=mirrored)
            except DamagedError:
                raise
            except UserError:  # too long: by words alone
                moves = None
        return _Asked(motifs, vectors, moves)

    def _windows(self, n_words: int, scope: Scope, barred: tuple[int, int, int] | None) -> _Windows:
        """The windows of the clips in scope that share no barred frames."""
        corpus = self.corpus
        counts = np.diff(corpus.offsets)
        each = np.maximum(1, counts - n_words + 1)
        clip = np.repeat(np.arange(len(counts)), each)
        first = np.arange(each.sum()) - np.repeat(np.cumsum(each) - each, each)
        words = np.minimum(n_words, counts)[clip]
        at = corpus.offsets[clip] + first
        windows = _Windows(clip, first, words, corpus.starts[at], corpus.stops[at + words - 1])
        admits = scope.admission(self.lake)
        kept = np.array([admits(known) for known in corpus.clips], dtype=np.bool_)[clip]
        if barred is not None:
            kept &= (clip != barred[0]) | (windows.start >= barred[2]) | (windows.stop <= barred[1])
        return windows.of(kept)

    def _distances(self, asked: _Asked, windows: _Windows) -> Float64Array:
        """[v] of windows from the query."""
        n_words = len(asked.motifs)
        compared = spread(n_words)
        places = np.minimum(windows.first[:, None] + compared, (windows.first + windows.words - 1)[:, None])
        runs = self.corpus.offsets[windows.clip][:, None] + places
        sets = set_distances(asked.vectors[compared], self._vectors, runs)
        near, same = self._near(asked, windows, sets)
        along = np.zeros(len(near))
        grid = np.flatnonzero(windows.first % max(1, n_words // 2) == 0)
        if not len(grid):
            grid = np.arange(len(near))
        nodes = grid[_least(-near[grid], NODES)]
        apart = set_matrix(self._vectors, runs[nodes])
        clip, first = windows.clip[nodes], windows.first[nodes]
        apart[(clip[:, None] == clip) & (np.abs(first[:, None] - first) < n_words)] = np.inf
        along[nodes] = along_windows(apart, near[nodes])
        line = windows.clip * (_FAR * (windows.first.max() + 1)) + windows.first  # of clips that are far apart
        along = np.interp(line, line[grid], along[grid])
        along[same] = near[same] = 1.0
        return _together(along, near)

    def _near(self, asked: _Asked, windows: _Windows, sets: Float64Array) -> tuple[Float64Array, BoolArray]:
        """[v] how near windows are by all ways, and which hold the very words of the query."""
        n_words = len(asked.motifs)
        reached = _least(sets, REACH)
        others = np.ones(len(sets), dtype=np.bool_)
        others[reached] = False
        of_each = {"embedding": sets[reached], "signature": self._signatures(asked, windows, reached)}
        if asked.moves is not None:
            of_each["moves"] = self._by_moves(asked.moves, windows, reached)
        total = sum(WEIGHTS[name] for name in of_each)
        parts = [WEIGHTS[name] * _near(found, _unit(found, n_words)) for name, found in of_each.items()]
        near = np.empty(len(sets))
        near[reached] = sum(parts) / total
        # Of windows out of reach no more is known than that they are farther.
        near[others] = near[reached].min() * sets[reached].max() / np.maximum(sets[others], _LEAST)
        same = np.zeros(len(sets), dtype=np.bool_)
        same[reached] = (of_each["signature"] <= _EQUAL) & (of_each["embedding"] <= _EQUAL)
        return near, same

    def _signatures(self, asked: _Asked, windows: _Windows, chosen: Int64Array) -> Float64Array:
        corpus, signature = self.corpus, ExampleQuery(asked.motifs).signatures(self.corpus.idf)[0]
        at = corpus.offsets[windows.clip[chosen]] + windows.first[chosen]
        unique, where = np.unique(bags_of(corpus.motifs, at, windows.words[chosen]), axis=0, return_inverse=True)
        found = emd_many(signature, signatures_of_bags(unique, corpus.idf), corpus.ground)
        return np.asarray(found[where.ravel()])

    def _by_moves(self, moves: Float32Array, windows: _Windows, chosen: Int64Array) -> Float64Array:
        assert self._moves is not None
        found = np.empty(len(chosen))
        clips, middles = windows.clip[chosen], (windows.start[chosen] + windows.stop[chosen]) // 2
        bounds = [*np.flatnonzero(np.diff(clips, prepend=-1)).tolist(), len(clips)]
        for begin, end in pairwise(bounds):
            name = self.corpus.clips[clips[begin]].clip
            found[begin:end] = self._moves.distances_about(moves, name, middles[begin:end])
        return _rounded(found)


def _together(along: Float64Array, near: Float64Array) -> Float64Array:
    """Distance of what is so near along the graph and by itself."""
    return np.asarray(1 - near * (along + DIRECT * near) / (1 + DIRECT))


def _least(values: Float64Array, count: int) -> Int64Array:
    """[count] which are the least, ascending, of equal ones the first; all where there are no more."""
    if count >= len(values):
        return np.arange(len(values))
    last = np.partition(values, count - 1)[count - 1]
    below = np.flatnonzero(values < last)
    return np.sort(np.concatenate([below, np.flatnonzero(values == last)[: count - len(below)]]))


def _rounded(moves: Float64Array) -> Float64Array:
    return np.where(moves < _ROUNDING, 0.0, moves)


def _unit(distances: Float64Array, apart: int) -> float:
    """The distance ten answers on, of which so many windows are one."""
    finite = np.sort(distances[np.isfinite(distances)])
    return max(float(finite[: UNIT * apart + 1][-1]) if len(finite) else 1.0, _LEAST)


def _near(distances: Float64Array, unit: float) -> Float64Array:
    return np.asarray(1 / (1 + distances / unit))
