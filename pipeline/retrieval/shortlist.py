"""The default search of a large lake: clips are chosen by short vectors, and compared as in a small one.

Every method chooses by its own vectors, which stage "shortlist" keeps, and all that were chosen by any are compared by
all. The answers by a method are then its nearest among these.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final, TypeVar

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.deep_motifs.emd import ground_distances
from motionlake.deep_motifs.emd_search import SignatureIndex
from motionlake.deep_motifs.signatures import CorpusClip
from motionlake.errors import DamagedError, UserError
from motionlake.lake.catalog import Connection, fetch, fetch_table, reading
from motionlake.lake.layout import Lake
from motionlake.lake.models import check_served
from motionlake.lake.settings import served_config
from motionlake.motion.moves import KIND
from motionlake.motion.moves_index import Stack, aligned, floored
from motionlake.motion.sketches import instants, nearness
from motionlake.pesta.scan import nearest_strings
from motionlake.pesta.strings import Repository, SymbolDistances
from motionlake.retrieval.asked import Asked, Ranking
from motionlake.retrieval.hits import Hit, Match, clip_hit
from motionlake.retrieval.protocol import ClipFilter, Query, Scope, not_ready
from motionlake.retrieval.symbol_strings import encoded, query_of_symbols, served_dictionary
from motionlake.stages.shortlist_files import INSTANTS, ShortlistFiles, string_sketch

if TYPE_CHECKING:
    from motionlake.pesta.dictionary import PostureDictionary

Value = Any
Part = TypeVar("Part")
LOOKED_AT: Final = 5000  # clips whose outlines of moves are aligned
NEAR: Final = 500  # clips that a method chooses, at least
THREADS: Final = 2  # methods at once
_FACTS: Final = [each.name for each in fields(CorpusClip)]
Answers = tuple[Int64Array, Float64Array]  # rows and distances, nearest first


class Cascade:
    """The nearest clips of a large lake by each method that its shortlist has vectors for.

    Raises:
        UserError: the shortlist is of other motifs, postures or moves than the lake serves, or there is a newer model.
        DamagedError: a file of it is not as it was written.
    """

    def __init__(self, lake: Lake, files: Sequence[str]) -> None:
        self.lake, self.files = lake, ShortlistFiles.open(lake, files)
        with reading(lake) as con:
            served = {row["method"]: row["model"] for row in fetch(con, "models_compared")} | {"moves": KIND}
            self._catalog = fetch_table(con, "clips_with_parts")
            if self._stale(served):
                raise UserError(
                    f"{lake.root}: its shortlist of clips is of other models than it serves now; make it anew with "
                    "`motionlake run shortlist`"
                )
            check_served(con, lake, *self.files.methods)
            self._methods = {
                name: METHODS[name](lake, self.files, con) for name in METHODS if name in self.files.methods
            }
        self._admitted: dict[ClipFilter, Float32Array] = {}

    def _stale(self, served: Mapping[str, str]) -> bool:
        made = {name: self.files.models.get(name) for name in self.files.methods} | dict(self.files.models)
        return any(served.get(name) != model for name, model in made.items())

    def nearest(self, query: Query, k: int, scope: Scope, *, mirrored: bool, failed: list[UserError]) -> Asked[int]:
        """The k nearest by each method that can compare the query, in rows; `failed` gets why others cannot.

        Raises:
            UserError: none can.
        """
        values: dict[str, Value] = {}
        for name, method in self._methods.items():
            try:
                values[name] = self._value(method, query, mirrored=mirrored)
            except DamagedError:
                raise
            except UserError as error:
                failed.append(error)
        if failed and not values:
            raise failed[0]
        admitted = self._admits(scope.clips)
        count = min(max(k, NEAR), int(np.isfinite(admitted).sum()))
        chosen = self._at_once(values, lambda method, value: method.choose(value, count, admitted))
        rows = np.unique(np.concatenate(list(chosen.values())))
        among = self._at_once(values, lambda method, value: method.among(value, rows, k))
        by = {name: Ranking(found.tolist(), distances) for name, (found, distances) in among.items()}
        return Asked(by, None if query.clip is None else self._place(query.clip), self._as_hits)

    def _at_once(self, values: Mapping[str, Value], work: Callable[[Method, Value], Part]) -> dict[str, Part]:
        """What some work finds by each method, moves first: they take longest."""
        names = list(values)
        found = list(self._threads.map(lambda name: work(self._methods[name], values[name]), names[::-1]))
        return dict(zip(names, found[::-1], strict=True))

    @cached_property
    def _threads(self) -> ThreadPoolExecutor:
        """Which stay: to start some takes as long as a part of the work."""
        return ThreadPoolExecutor(THREADS, "search")

    def _as_hits(self, rows: Sequence[int], distances: Sequence[float]) -> list[Hit]:
        return [clip_hit(self._facts(row), distance) for row, distance in zip(rows, distances, strict=True)]

    def matches(self, query: Query, hits: Sequence[Hit], *, mirrored: bool) -> dict[str, Match]:
        """As `LakeSearcher.matches`, by moves."""
        method = self._methods.get("moves")
        if not isinstance(method, ByMoves):
            return {}
        from motionlake.retrieval.matched import asked_frames, matched_moves

        value, asked = self._value(method, query, mirrored=mirrored), asked_frames(self.lake, query)
        rows = np.array([self._row(hit.clip) for hit in hits], dtype=np.int64)
        known = rows[self.files.numbers("frames")[rows] > 0]
        pairs = zip(map(self._facts, known.tolist()), self.files.moves(known), strict=True)
        return {clip.clip: matched_moves(value, moves.astype(np.float32), asked, clip.frames) for clip, moves in pairs}

    def _value(self, method: Method, query: Query, *, mirrored: bool) -> Value:
        if query.clip is not None and query.whole and not mirrored:
            return method.of_row(self._row(query.clip))
        return method.of_query(query, mirrored=mirrored)

    def _facts(self, row: int) -> CorpusClip:
        entry = int(self._entries[row])
        return CorpusClip(*(self._catalog[name][entry].as_py() for name in _FACTS))

    def _row(self, clip: str) -> int:
        """Raises `UserError` for a clip that it does not hold, or that was another one when it was made."""
        row = self._place(clip)
        if row is None:
            raise not_ready(self.lake, clip, "place in the shortlist")
        return row

    def _place(self, clip: str) -> int | None:
        names = self.files.table["clip"]
        row = bisect_left(range(len(names)), clip, key=lambda at: names[at].as_py())
        known = row < len(names) and names[row].as_py() == clip and self._entries[row] >= 0
        return row if known else None

    @cached_property
    def _entries(self) -> Int64Array:
        """[n] the row in the catalog of each clip; -1 where it left the lake, or is another one since."""
        made, known = self.files.table, self._catalog
        if made["clip"].equals(known["clip"]) and made["part"].equals(known["part"]):
            return np.arange(len(made))
        rows = {pair: row for row, pair in enumerate(zip(*_names(known), strict=True))}
        return np.array([rows.get(pair, -1) for pair in zip(*_names(made), strict=True)], dtype=np.int64)

    def _admits(self, kept: ClipFilter) -> Float32Array:
        """[n] 0 for the clips that may be answers, minus infinity for all others."""
        if kept not in self._admitted:
            there = self._entries >= 0
            if kept != ClipFilter():
                with reading(self.lake) as con:
                    admitted = {row["clip"] for row in fetch(con, "clips_admitted", kept.as_parameters(con))}
                there &= [name in admitted for name in self.files.table["clip"].to_pylist()]
            self._admitted[kept] = np.where(there, np.float32(0), np.float32(-np.inf))
        return self._admitted[kept]


def _names(table: pa.Table) -> tuple[list[str], list[str]]:
    return table["clip"].to_pylist(), table["part"].to_pylist()


class Method(ABC):
    """What a method keeps of every clip, and how it compares a query with it."""

    name: str

    def __init__(self, lake: Lake, files: ShortlistFiles, con: Connection) -> None:
        self.lake, self.files = lake, files
        self._kept = files.arrays[f"{self.name}-sketches"]
        self._directions = files.directions(self.name)

    @abstractmethod
    def of_row(self, row: int) -> Value:
        """What is compared of a clip of the shortlist. Raises `UserError` where it has none."""

    @abstractmethod
    def of_query(self, query: Query, *, mirrored: bool) -> Value:
        """The same of a file, of a part of a clip, or mirrored. Raises `UserError` where it cannot be made."""

    @abstractmethod
    def sketch(self, value: Value) -> Float32Array:
        """[D] the vector that is projected and compared first."""

    @abstractmethod
    def among(self, value: Value, rows: Int64Array, k: int) -> Answers:
        """The k nearest of the clips of some rows; those that the method does not know are left out."""

    def choose(self, value: Value, count: int, admitted: Float32Array) -> Int64Array:
        """About so many rows that are likely to be the nearest of those admitted ([n] 0, else minus infinity)."""
        near = nearness(self._kept, self._directions.project(self.sketch(value))) + admitted
        return _largest(near, count)

    def _without(self, row: int, what: str) -> UserError:
        clip = self.files.table["clip"][row].as_py()
        return UserError(f"{clip}: has no {what} yet; make it with `motionlake run all`")


def _largest(near: Float32Array, count: int) -> Int64Array:
    """Rows of the `count` largest that are finite."""
    rows = np.argpartition(-near, count - 1)[:count] if count < len(near) else np.arange(len(near))
    return np.asarray(rows[np.isfinite(near[rows])], dtype=np.int64)


class BySignature(Method):
    """Signatures [K], by the earth mover's distance."""

    name = "signature"

    def __init__(self, lake: Lake, files: ShortlistFiles, con: Connection) -> None:
        super().__init__(lake, files, con)
        motifs = fetch(con, "corpus_motifs")
        self._ground = ground_distances(np.array([row["centroid"] for row in motifs], dtype=np.float32))
        self._idf = np.array([row["idf"] for row in motifs], dtype=np.float64)

    def of_row(self, row: int) -> Value:
        (signature,) = self._dense(np.array([row]))
        if not signature.any():
            raise self._without(row, "signature")
        return signature

    def of_query(self, query: Query, *, mirrored: bool) -> Value:
        from motionlake.retrieval.signature import signature_of

        return signature_of(self.lake, query, self._idf, mirrored=mirrored)

    def sketch(self, value: Value) -> Float32Array:
        return np.asarray(value @ self._ground, dtype=np.float32)

    def among(self, value: Value, rows: Int64Array, k: int) -> Answers:
        signatures = self._dense(rows)
        there = signatures.any(axis=1)
        if not there.any():
            return np.zeros(0, dtype=np.int64), np.zeros(0)
        found = SignatureIndex.build(signatures[there], self._ground).nearest(value, min(k, int(there.sum())))
        return rows[there][found.indices], found.distances

    def _dense(self, rows: Int64Array) -> Float32Array:
        dense = np.zeros((len(rows), len(self._ground)), dtype=np.float32)
        (held, lengths), (weights, _) = self.files.joined("motifs", rows), self.files.joined("weights", rows)
        dense[np.repeat(np.arange(len(rows)), lengths), held] = weights
        return dense


class ByAlignment(Method):
    """Strings of symbols, by alignment both ways."""

    name = "alignment"

    def __init__(self, lake: Lake, files: ShortlistFiles, con: Connection) -> None:
        super().__init__(lake, files, con)
        codes = fetch(con, "posture_codes")
        self._codes = np.array([row["code"] for row in codes], dtype=np.float64)
        self._model = codes[0]["model"]
        self._distances = SymbolDistances(ground_distances(self._codes.astype(np.float32)).astype(np.float32))
        self._config = served_config(lake).alignment

    def of_row(self, row: int) -> Value:
        (symbols,) = self.files.lists("symbols", np.array([row]))
        if len(symbols) == 0:
            raise self._without(row, "symbol string")
        return query_of_symbols(symbols, self.files.table["clip"][row].as_py()).symbols

    def of_query(self, query: Query, *, mirrored: bool) -> Value:
        return encoded(self.lake, query, self._dictionary, mirrored=mirrored).symbols

    @cached_property
    def _dictionary(self) -> PostureDictionary:
        return served_dictionary(self.lake, self._model)

    def sketch(self, value: Value) -> Float32Array:
        return string_sketch(value, self._codes)

    def among(self, value: Value, rows: Int64Array, k: int) -> Answers:
        symbols, lengths = self.files.joined("symbols", rows)
        strings = Repository(symbols, np.concatenate([[0], np.cumsum(lengths)]))
        found = nearest_strings(value, strings, self._distances, k, self._config)  # of so few, in one thread
        return rows[[at for at, _ in found]], np.array([cost for _, cost in found])


class ByMoves(Method):
    """Moves, by dynamic time warping: first of outlines, moves at a few instants along a few directions."""

    name = "moves"

    def __init__(self, lake: Lake, files: ShortlistFiles, con: Connection) -> None:
        super().__init__(lake, files, con)
        outlines, self._frames = files.arrays["moves-outlines"], files.directions("outlines")
        self._looked = np.asarray(outlines).reshape(-1, outlines.shape[-1])  # [n * INSTANTS, w]

    def of_row(self, row: int) -> Value:
        if self.files.numbers("frames")[row] == 0:
            raise self._without(row, "moves")
        return self.files.moves(np.array([row]))[0].astype(np.float32)

    def of_query(self, query: Query, *, mirrored: bool) -> Value:
        from motionlake.retrieval.moves import track_of

        return track_of(self.lake, query, mirrored=mirrored).moves()

    def sketch(self, value: Value) -> Float32Array:
        return instants(value, INSTANTS).ravel()

    def choose(self, value: Value, count: int, admitted: Float32Array) -> Int64Array:
        rows = super().choose(value, max(count, min(LOOKED_AT, len(admitted))), admitted)
        if len(rows) <= count:
            return rows
        rows.sort()
        outline = self._frames.project(instants(value, INSTANTS))
        stack = Stack.of_halves(self._looked, rows * INSTANTS, np.full(len(rows), INSTANTS))
        apart = stack.spread(aligned(outline, stack))
        return rows[np.argpartition(apart, count - 1)[:count]]

    def among(self, value: Value, rows: Int64Array, k: int) -> Answers:
        known = rows[self.files.numbers("frames")[rows] > 0]
        frames, starts, counts = self.files.moves_at(known)
        stack = Stack.of_halves(frames, starts, counts)
        distances = floored(stack.spread(aligned(value, stack)))
        order = np.lexsort((known, distances))[:k]
        return known[order], distances[order]


METHODS: Final[Mapping[str, type[Method]]] = {"signature": BySignature, "alignment": ByAlignment, "moves": ByMoves}
