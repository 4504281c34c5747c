"""The search of a lake of many clips: some are chosen by short vectors, and compared as in a small lake.

Each method says by its own vectors, which stage "shortlist" keeps, how near every clip is, and those that are nearest
by all methods together are compared by all. The answers by a method are then its nearest among these.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, FloatArray, Int64Array
from motionlake.errors import DamagedError, UserError
from motionlake.lake.catalog import reading
from motionlake.motion.diffusion import scale
from motionlake.retrieval.asked import Asked, Ranking
from motionlake.retrieval.hits import Hit, Match, clip_hit
from motionlake.retrieval.lake_shortlist import LakeShortlist
from motionlake.retrieval.protocol import Query, Scope
from motionlake.retrieval.shortlist_methods import (
    LEAST,
    METHODS,
    THREADS,
    Answers,
    ByMoves,
    Compare,
    Method,
    Value,
    largest,
)
from motionlake.retrieval.weighing import WEIGHTS, as_near
from motionlake.threads import in_threads, limited

ALONE_IN_FULL: Final = 400  # clips that are compared by all frames of moves, where these are asked alone


class Most(NamedTuple):
    """How many clips are compared.

    Attributes:
        chosen: by vectors, at least.
        in_full: of these by all frames of moves, where not twice as many answers are asked for.
        cells: pairs of a symbol of the query and one of a clip, by alignment: of a long query fewer clips.
    """

    chosen: int
    in_full: int
    cells: int = 10**12


LARGE: Final = Most(1500, 200, 60_000_000)
# In a lake with a graph, whose ways go on from all clips that are near by a method.
MIDDLE: Final = Most(3000, 700)


class Cascade:
    """The nearest clips of a lake by each method that its shortlist has vectors for."""

    def __init__(self, clips: LakeShortlist) -> None:
        self.lake, self.files, self._clips = clips.lake, clips.files, clips
        with reading(self.lake) as con:
            self._methods = {
                name: METHODS[name](self.lake, self.files, con) for name in METHODS if name in self.files.methods
            }

    @property
    def large(self) -> bool:
        """As `LakeShortlist.large`."""
        return self._clips.large

    @property
    def methods(self) -> list[str]:
        """The names of these methods."""
        return list(self._methods)

    def ranking(self, hits: Sequence[Hit]) -> Ranking[int]:
        """What another method has answered, in rows, without clips that the shortlist does not hold."""
        found = [(row, hit.distance) for hit in hits if (row := self._clips.place(hit.clip)) is not None]
        return Ranking([row for row, _ in found], np.array([distance for _, distance in found]))

    def nearest(self, query: Query, k: int, scope: Scope, *, mirrored: bool, failed: list[UserError]) -> Asked[int]:
        """The k nearest by each method that can compare the query, in rows; `failed` gets why others cannot.

        Raises:
            UserError: none can.
        """
        values = self._values(self._methods, query, failed, mirrored=mirrored)
        if failed and not values:
            raise failed[0]
        admitted = self._clips.admits(scope.clips)
        likeness = self._likeness(values)
        near = {name: each + admitted for name, each in likeness.items()}
        together = sum(likeness.values(), start=admitted)
        most = LARGE if self.large else MIDDLE
        rows = largest(together, max(k, most.chosen))
        rows = rows[np.lexsort((rows, -together[rows]))]  # the likeliest first
        first = self._shared(
            {name: self._methods[name].first(k) for name in values}, values,
            {name: np.sort(rows[: max(k, self._methods[name].affords(values[name], rows, most.cells))])
             for name in values},
        )  # fmt: skip
        by = {name: Ranking(found[:k].tolist(), distances[:k], self._reach(name, near[name], rows, k, distances[:k]))
              for name, (found, distances) in first.items() if name != ByMoves.name}  # fmt: skip
        if ByMoves.name in first:
            known, rough = first[ByMoves.name]
            others = together[known] / len(likeness)
            for name, each in by.items():
                others = others + WEIGHTS[name] / WEIGHTS[ByMoves.name] * _nearness(known, each)
            by[ByMoves.name] = self._moves(values[ByMoves.name], known, rough, others, k, most.in_full)
        own = None if query.clip is None else self._clips.place(query.clip)
        return Asked(by, own, self._as_hits, self._clips.names)

    def _moves(
        self, value: Value, rows: Int64Array, rough: Float64Array, others: FloatArray, k: int, in_full: int
    ) -> Ranking[int]:
        """The k nearest by moves of those clips that are likely to be near by all methods together.

        Args:
            value: of the query.
            rows, rough: all clips, and about how far each is, nearest first.
            others: how near each is by what else is known of it.
            k: how many.
            in_full: how many are compared by all frames, where not twice as many are asked for.
        """
        if not len(rows):
            return Ranking([], rough)
        name, method = ByMoves.name, self._methods[ByMoves.name]
        near = as_near(rough, np.float64(scale(rough))) + others
        likely = np.sort(largest(near, in_full if k < 2 * in_full else k))
        most = len(likely)
        compare = partial(method.among, k=most)
        found, distances = self._shared({name: compare}, {name: value}, {name: np.sort(rows[likely])})[name]
        if most == len(rows):
            return Ranking(found[:k].tolist(), distances[:k])
        # Not all of the k nearest need have been compared: how far they reach follows from about how far they are.
        known = distances[_places(found, rows[likely])]
        reach = np.median(known / np.maximum(rough[likely], LEAST)) * rough[min(k, len(rows) - 1)]
        return Ranking(found[:k].tolist(), distances[:k], float(reach))

    def _reach(self, name: str, near: Float32Array, rows: Int64Array, k: int, distances: Float64Array) -> float:
        """The distance of the last clip of some rows that is likely to be among the k nearest of all: as many of them
        are among the k nearest by vectors. Infinite where vectors do not tell."""
        if not self._methods[name].told_by_vectors or not len(distances) or k >= len(near):
            return np.inf
        there = int((near[rows] >= -np.partition(-near, k - 1)[k - 1]).sum())
        return float(distances[min(max(there, 1), len(distances)) - 1])

    def by(self, name: str, query: Query, k: int, scope: Scope, *, mirrored: bool) -> list[Hit]:
        """The k nearest by one method; not ranked yet.

        Clips are chosen by the vectors of all methods that can compare the query, unless the method's own tell enough.

        Raises:
            UserError: the shortlist has nothing of this method, or it cannot compare the query.
        """
        if name not in self._methods:
            raise UserError(f"{self.lake.root}: its shortlist has no {name}; make it anew with `motionlake run all`")
        method = self._methods[name]
        value = self._value(method, query, mirrored=mirrored)
        with limited(1):  # as of all methods together
            others = [] if method.told_by_vectors else [other for other in self._methods if other != name]
            likeness = self._likeness({**self._values(others, query, [], mirrored=mirrored), name: value})
            together = sum(likeness.values(), start=self._clips.admits(scope.clips))
            rows = np.sort(largest(together, max(k + 1, method.chosen)))
            found, distances = self._shared({name: method.first(k + 1)}, {name: value}, {name: rows})[name]
            if isinstance(method, ByMoves):
                nearest = self._moves(value, found, distances, together[found] / len(likeness), k + 1, ALONE_IN_FULL)
                found, distances = np.array(nearest.clips, dtype=np.int64), nearest.distances
        own = self._clips.place(query.clip) if query.clip is not None and not scope.own else None
        kept = np.flatnonzero(found != (-1 if own is None else own))[:k]
        return self._as_hits(found[kept].tolist(), distances[kept].tolist())

    def _values(
        self, names: Iterable[str], query: Query, failed: list[UserError], *, mirrored: bool
    ) -> dict[str, Value]:
        """What each of some methods compares of a query; `failed` gets why some cannot."""
        values: dict[str, Value] = {}
        for name in names:
            try:
                values[name] = self._value(self._methods[name], query, mirrored=mirrored)
            except DamagedError:
                raise
            except UserError as error:
                failed.append(error)
        return values

    def _likeness(self, values: Mapping[str, Value]) -> dict[str, Float32Array]:
        """[n] how near every clip is by the vectors of some methods."""
        names = _last(values)
        found = in_threads(lambda name: self._methods[name].likeness(values[name]), names, THREADS)
        return dict(zip(names, found, strict=True))

    def _shared(
        self, compare: Mapping[str, Compare], values: Mapping[str, Value], rows: Mapping[str, Int64Array]
    ) -> dict[str, Answers]:
        """What each way to compare finds among the clips of its rows, nearest first.

        Threads share the clips of a method, moves first: they take longest.
        """
        shares: list[tuple[str, Int64Array]] = []
        for name in _last(values):
            count = self._sharing(name)
            shares += [(name, rows[name][first::count]) for first in range(count)]
        found = in_threads(lambda share: compare[share[0]](values[share[0]], share[1]), shares, THREADS)
        answers: dict[str, list[Answers]] = {name: [] for name in values}
        for (name, _), answer in zip(shares, found, strict=True):
            answers[name].append(answer)
        return {name: _merged(parts) for name, parts in answers.items()}

    def _sharing(self, name: str) -> int:
        return THREADS if self._methods[name].shared else 1

    def _as_hits(self, rows: Sequence[int], distances: Sequence[float]) -> list[Hit]:
        return [clip_hit(self._clips.facts(row), distance) for row, distance in zip(rows, distances, strict=True)]

    def matches(self, query: Query, hits: Sequence[Hit], *, mirrored: bool) -> dict[str, Match]:
        """As `LakeSearcher.matches`, by moves."""
        method = self._methods.get("moves")
        if not isinstance(method, ByMoves):
            return {}
        from motionlake.retrieval.matched import asked_frames, matched_moves

        value, asked = self._value(method, query, mirrored=mirrored), asked_frames(self.lake, query)
        rows = np.array([self._clips.row(hit.clip) for hit in hits], dtype=np.int64)
        known = rows[self.files.numbers("frames")[rows] > 0]
        pairs = zip(map(self._clips.facts, known.tolist()), self.files.moves.of(known), strict=True)
        return {clip.clip: matched_moves(value, moves.astype(np.float32), asked, clip.frames) for clip, moves in pairs}

    def _value(self, method: Method, query: Query, *, mirrored: bool) -> Value:
        if query.clip is not None and query.whole and not mirrored:
            return method.of_row(self._clips.row(query.clip))
        return method.of_query(query, mirrored=mirrored)


def _last(values: Mapping[str, Value]) -> list[str]:
    """The names of methods, the last first."""
    return list(values)[::-1]


def _merged(parts: Sequence[Answers]) -> Answers:
    """Several answers, nearest first."""
    rows, distances = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    order = np.lexsort((rows, distances))
    return rows[order], distances[order]


def _nearness(rows: Int64Array, found: Ranking[int]) -> Float64Array:
    """[n] how near some rows are by a method; of those that it did not find, as near as the last."""
    if not found.clips:
        return np.zeros(len(rows))
    near = as_near(np.minimum(found.distances, found.reach), np.float64(scale(found.distances)))
    known = np.array(found.clips)
    places = _places(known, rows)
    return np.where(known[places] == rows, near[places], near[-1])


def _places(known: Int64Array, rows: Int64Array) -> Int64Array:
    """[n] where each of some rows stands among known ones, in any order; any place of one that does not."""
    order = np.argsort(known)
    return np.asarray(order[np.minimum(np.searchsorted(known, rows, sorter=order), len(known) - 1)])
