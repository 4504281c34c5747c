"""How each method of a search by shortlist chooses clips by short vectors, and compares those that were chosen."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, FloatArray, Int64Array
from motionlake.deep_motifs.emd import ground_distances
from motionlake.deep_motifs.emd_search import SignatureIndex
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import Lake
from motionlake.lake.settings import served_config
from motionlake.motion.moves import VELOCITY
from motionlake.motion.moves_index import floored
from motionlake.motion.sketches import Sketches, instants
from motionlake.motion.stacks import Halves, aligned_halves
from motionlake.pesta.nearest import LeastCosts, nearest_strings
from motionlake.pesta.strings import Repository, SymbolDistances
from motionlake.retrieval.protocol import Query
from motionlake.retrieval.string_queries import query_of_symbols
from motionlake.stages.shortlist_files import INSTANTS, ShortlistFiles, string_sketch

if TYPE_CHECKING:
    from motionlake.pesta.dictionary import PostureDictionary

Value = Any
ALONE: Final = 2000  # clips that are compared by a method which is asked alone
ALONE_STRINGS: Final = 6000  # by alignment: vectors tell less of it, and strings are compared sooner than moves
FEWEST: Final = 500  # clips that are aligned with a long query
UNIT: Final = 1000  # the distance by vectors of the clip at this place is the scale of others
LEAST: Final = np.float32(1e-6)  # of such a distance
EVERY: Final = 4  # frames of moves, of which one is compared before all
THREADS: Final = 2
Answers = tuple[Int64Array, Float64Array]  # rows and distances, nearest first
Compare = Callable[[Value, Int64Array], Answers]  # of a query and the clips of some rows


class Method(ABC):
    """What a method keeps of every clip, and how it compares a query with it."""

    name: str
    chosen: ClassVar[int] = ALONE  # clips that are compared where it is asked alone
    shared: ClassVar[bool] = True  # several threads compare sooner than one
    told_by_vectors: ClassVar[bool] = False  # how many of its nearest are among some clips, their vectors tell

    def __init__(self, lake: Lake, files: ShortlistFiles, con: Connection) -> None:
        self.lake, self.files = lake, files
        self._directions = files.directions(self.name)

    @cached_property
    def _kept(self) -> Sketches:
        return self.files.sketches(self.name)

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

    def affords(self, value: Value, rows: Int64Array, cells: int) -> int:
        """How many of the clips of some rows, the likeliest first, it compares beside other methods."""
        return len(rows)

    def first(self, k: int) -> Compare:
        """How shares of the clips that were chosen for a query are compared first: the k nearest of all are found, and
        what may be left out of a share is none of them."""
        return partial(self.among, k=k)

    def likeness(self, value: Value) -> Float32Array:
        """[n] how near every clip is by its vector, from 0 to 1: a half at the distance of the `UNIT`th nearest, and 0
        where the method does not know it."""
        sketch = self._directions.project(self.sketch(value))
        apart = np.float32(sketch @ sketch) - 2 * self._kept.nearness(sketch)
        np.sqrt(np.maximum(apart, 0, out=apart), out=apart)
        known = int(np.isfinite(apart).sum())
        if not known:
            return np.zeros_like(apart)
        place = min(UNIT, known) - 1
        return np.asarray(1 / (1 + apart / max(np.partition(apart, place)[place], LEAST)))


def largest(near: FloatArray, count: int) -> Int64Array:
    """Rows of the `count` largest numbers, of those that are finite."""
    rows = np.argpartition(-near, count - 1)[:count] if count < len(near) else np.arange(len(near))
    return np.asarray(rows[np.isfinite(near[rows])], dtype=np.int64)


class BySignature(Method):
    """Signatures [K], by the earth mover's distance."""

    name = "signature"
    shared = False  # the k nearest of all are found with fewer transports than those of each share
    told_by_vectors = True

    def __init__(self, lake: Lake, files: ShortlistFiles, con: Connection) -> None:
        super().__init__(lake, files, con)
        motifs = fetch(con, "corpus_motifs")
        self._ground = ground_distances(np.array([row["centroid"] for row in motifs], dtype=np.float32))
        self._idf = np.array([row["idf"] for row in motifs], dtype=np.float64)

    def of_row(self, row: int) -> Value:
        (signature,) = self._dense(np.array([row]))
        if not signature.any():
            raise self.files.lacks(row, "signature")
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
    chosen = ALONE_STRINGS

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
            raise self.files.lacks(row, "symbol string")
        return query_of_symbols(symbols.astype(np.int32), self.files.table["clip"][row].as_py()).symbols

    def of_query(self, query: Query, *, mirrored: bool) -> Value:
        from motionlake.retrieval.symbol_strings import encoded

        return encoded(self.lake, query, self._dictionary, mirrored=mirrored).symbols

    @cached_property
    def _dictionary(self) -> PostureDictionary:
        from motionlake.retrieval.symbol_strings import served_dictionary

        return served_dictionary(self.lake, self._model)

    def sketch(self, value: Value) -> Float32Array:
        return string_sketch(value, self._codes)

    def affords(self, value: Value, rows: Int64Array, cells: int) -> int:
        _, starts = self.files.flat("symbols")
        symbols = np.cumsum(starts[rows + 1] - starts[rows])
        return max(FEWEST, int(np.searchsorted(len(value) * symbols, cells, side="right")))

    def first(self, k: int) -> Compare:
        return partial(self.among, k=k, so_far=LeastCosts(k))

    def among(self, value: Value, rows: Int64Array, k: int, so_far: LeastCosts | None = None) -> Answers:
        # Of so few in one thread.
        found = nearest_strings(value, self._strings(rows), self._distances, k, self._config, so_far=so_far)
        return rows[[at for at, _ in found]], np.array([cost for _, cost in found])

    def _strings(self, rows: Int64Array) -> Repository:
        symbols, lengths = self.files.joined("symbols", rows)
        return Repository(symbols, np.concatenate([[0], np.cumsum(lengths)]))


class ByMoves(Method):
    """Moves, by dynamic time warping, first of some of their frames."""

    name = "moves"

    def of_row(self, row: int) -> Value:
        if self.files.numbers("frames")[row] == 0:
            raise self.files.lacks(row, "moves")
        return self.files.moves.of(np.array([row]))[0].astype(np.float32)

    def of_query(self, query: Query, *, mirrored: bool) -> Value:
        from motionlake.retrieval.moves import track_of

        return track_of(self.lake, query, mirrored=mirrored).moves()

    def sketch(self, value: Value) -> Float32Array:
        return instants(value, INSTANTS).ravel()

    def first(self, k: int) -> Compare:
        return self.roughly

    def roughly(self, value: Value, rows: Int64Array) -> Answers:
        """All clips of some rows that have moves, by the velocities, which count most, of some of their frames: about
        how far each is."""
        known = rows[self.files.numbers("frames")[rows] > 0]
        halves = Halves(*self.files.moves.where(known))
        return known, aligned_halves(np.ascontiguousarray(value[::EVERY, VELOCITY]), halves, EVERY, VELOCITY)

    def among(self, value: Value, rows: Int64Array, k: int) -> Answers:
        known = rows[self.files.numbers("frames")[rows] > 0]
        distances = floored(aligned_halves(value, Halves(*self.files.moves.where(known))))
        order = np.lexsort((known, distances))[:k]
        return known[order], distances[order]


METHODS: Final[Mapping[str, type[Method]]] = {"signature": BySignature, "alignment": ByAlignment, "moves": ByMoves}
