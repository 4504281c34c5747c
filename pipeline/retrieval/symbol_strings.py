"""The symbol strings of a lake as arrays, and queries as symbols: what alignment on a lake reads."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import compress
from typing import Final

import numpy as np
import pyarrow.compute as pc
from motionlake.arrays import Int64Array
from motionlake.deep_motifs.signatures import CorpusClip
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch, fetch_table
from motionlake.lake.frames import frame_range
from motionlake.pesta.strings import Repository, SymbolDistances
from motionlake.pesta.symbols import SymbolString
from motionlake.retrieval.protocol import Scope
from numpy.typing import NDArray

SHORTEST: Final = 2  # symbols of a query


@dataclass(frozen=True)
class LakeStrings:
    """n clips by name, their strings of Y symbols one after another.

    Attributes:
        clips: n.
        repository: the strings.
        starts: [Y] first frame of each symbol, at the clip's own rate.
        stops: [Y] frame after its last.
        distances: of the m symbols.
        model: name of their dictionary: strings over two dictionaries do not compare.
    """

    clips: list[CorpusClip]
    repository: Repository
    starts: Int64Array
    stops: Int64Array
    distances: SymbolDistances
    model: str

    @cached_property
    def positions(self) -> dict[str, int]:
        """Index of each clip by its name."""
        return {c.clip: i for i, c in enumerate(self.clips)}

    def symbols_of(self, clip: int) -> slice:
        """Where the symbols of a clip stand."""
        return slice(int(self.repository.offsets[clip]), int(self.repository.offsets[clip + 1]))

    def string_of(self, clip: int) -> SymbolString:
        """The string of a clip."""
        own = self.symbols_of(clip)
        return SymbolString(self.repository.symbols[own], self.starts[own], self.stops[own])

    def among(self, scope: Scope) -> LakeStrings:
        """The strings of the clips that a scope admits; they are taken out once."""
        wanted = tuple(map(scope.admits, self.clips))
        if all(wanted):
            return self
        if wanted not in self._taken:
            chosen = np.array(wanted, dtype=np.bool_)
            kept = np.repeat(chosen, self.repository.lengths)
            offsets = np.concatenate([[0], np.cumsum(self.repository.lengths[chosen])]).astype(np.int64)
            self._taken[wanted] = replace(
                self,
                clips=list(compress(self.clips, wanted)),
                repository=Repository(self.repository.symbols[kept], offsets),
                starts=self.starts[kept],
                stops=self.stops[kept],
            )
        return self._taken[wanted]

    @cached_property
    def _taken(self) -> dict[tuple[bool, ...], LakeStrings]:
        return {}


def read_strings(con: Connection) -> LakeStrings:
    """The strings of a lake.

    Raises:
        UserError: the lake has none yet.
    """
    codes = fetch(con, "posture_codes")
    if not codes:
        raise UserError("the lake has no symbol strings yet; make them with `motionlake run all`")
    rows = fetch_table(con, "symbol_strings")
    known = rows.drop_columns(["symbols", "starts"]).to_pylist()
    lengths = pc.list_value_length(rows.column("symbols")).to_numpy().astype(np.int64)
    offsets = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
    starts = pc.list_flatten(rows.column("starts")).to_numpy().astype(np.int64)
    stops = np.append(starts[1:], 0)
    stops[offsets[1:] - 1] = rows.column("frames").to_numpy()
    from scipy.spatial.distance import cdist

    points = np.array([row["code"] for row in codes], dtype=np.float64)
    return LakeStrings(
        [CorpusClip(**row) for row in known],
        Repository(pc.list_flatten(rows.column("symbols")).to_numpy().astype(np.int32), offsets),
        starts,
        stops,
        SymbolDistances(cdist(points, points).astype(np.float32)),
        codes[0]["model"],
    )


@dataclass(frozen=True)
class StringQuery:
    """Symbols [first, last) of a string, which stand for frames [start, stop); `clip` where it is one of the lake."""

    name: str
    string: SymbolString
    first: int
    last: int
    start: int
    stop: int
    clip: str | None = None

    @property
    def symbols(self) -> NDArray[np.int32]:
        return self.string.symbols[self.first : self.last]

    def frames_of(self, symbol: int) -> tuple[int, int]:
        """The frames of the query that a symbol of the string stands for."""
        return max(self.start, int(self.string.starts[symbol])), min(self.stop, int(self.string.stops[symbol]))


def string_query(
    name: str, string: SymbolString, frames: int, start: int | None, stop: int | None, clip: str | None = None
) -> StringQuery:
    """The symbols that stand for frames [start, stop) of a clip of so many.

    Raises:
        UserError: there are no such frames, or they are one symbol.
    """
    first, last = frame_range(name, start, stop, frames)
    covered = np.flatnonzero((string.starts < last) & (string.stops > first))
    return _long_enough(StringQuery(name, string, int(covered[0]), int(covered[-1]) + 1, first, last, clip))


def query_of_symbols(symbols: NDArray[np.int32]) -> StringQuery:
    """A string that is no clip's; its frames are its symbols.

    Raises:
        UserError: an empty string, or one symbol.
    """
    if symbols.ndim != 1:
        raise UserError(f"a query is one row of symbols, not an array of shape {symbols.shape}")
    places = np.arange(len(symbols) + 1, dtype=np.int64)
    string = SymbolString(symbols, places[:-1], places[1:])
    return _long_enough(StringQuery("query", string, 0, len(symbols), 0, len(symbols)))


def _long_enough(query: StringQuery) -> StringQuery:
    count = len(query.symbols)
    if count == 0:
        raise UserError(f"{query.name}: is empty; a string to align has at least {SHORTEST} symbols")
    if count < SHORTEST:
        raise UserError(
            f"{query.name}: frames {query.start} to {query.stop} are one symbol, a posture that is held; take a longer "
            "range, one in which the body moves"
        )
    return query


def barred_symbols(strings: LakeStrings, query: StringQuery) -> NDArray[np.bool_] | None:
    """[Y] the symbols of the query's own frames in its own clip; None where it is not among the strings."""
    index = strings.positions.get(query.clip) if query.clip else None
    if index is None:
        return None
    own = strings.symbols_of(index)
    barred = np.zeros(len(strings.repository.symbols), dtype=np.bool_)
    barred[own] = (strings.starts[own] < query.stop) & (strings.stops[own] > query.start)
    return barred
