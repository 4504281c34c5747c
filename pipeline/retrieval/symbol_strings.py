"""Queries as symbols: what alignment on a lake looks for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.errors import UserError
from motionlake.lake.frames import frame_range
from motionlake.lake.strings import LakeStrings
from motionlake.pesta.symbols import SymbolString
from numpy.typing import NDArray

SHORTEST: Final = 2  # symbols of a query


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


def query_of_symbols(symbols: NDArray[np.int32], name: str = "query") -> StringQuery:
    """A string without frames: these are its symbols.

    Raises:
        UserError: an empty string, or one symbol.
    """
    if symbols.ndim != 1:
        raise UserError(f"a query is one row of symbols, not an array of shape {symbols.shape}")
    places = np.arange(len(symbols) + 1, dtype=np.int64)
    string = SymbolString(symbols, places[:-1], places[1:])
    return _long_enough(StringQuery(name, string, 0, len(symbols), 0, len(symbols)))


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
