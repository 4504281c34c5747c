"""Symbol strings to look for: of a clip, of some frames of one or of a file, or of symbols alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Int32Array
from motionlake.errors import UserError
from motionlake.pesta.symbols import SymbolString, UnfoldedString
from numpy.typing import NDArray

SHORTEST: Final = 2  # symbols of a query


class OnePostureError(UserError):
    """A query whose frames are one symbol: there is nothing to align."""


@dataclass(frozen=True)
class StringQuery:
    """A string that stands for frames [start, stop) of a clip or file; `clip` where it is one of the lake.

    Attributes:
        string: its frames count from the first of the clip or file.
        unfolded: the same with every cycle of its repeats; None of a whole clip of the lake (`ClipStrings` has it), and
            of symbols that have no frames.
        fps: of the frames; 0 without any.
    """

    name: str
    string: SymbolString
    start: int
    stop: int
    clip: str | None = None
    unfolded: UnfoldedString | None = None
    fps: float = 0.0

    @property
    def symbols(self) -> Int32Array:
        return self.string.symbols

    def frames_of(self, symbol: int) -> tuple[int, int]:
        """The frames of the query that a symbol of the string stands for."""
        return int(self.string.starts[symbol]), int(self.string.stops[symbol])


def string_query(name: str, string: UnfoldedString, fps: float, clip: str | None = None) -> StringQuery:
    """A string as a query for the frames that it stands for.

    Raises:
        OnePostureError: it is one symbol.
    """
    start, stop = int(string.starts[0]), int(string.stops[-1])
    return _long_enough(StringQuery(name, string.folded, start, stop, clip, string, fps))


def clip_query(name: str, string: SymbolString, fps: float) -> StringQuery:
    """A whole clip of the lake as a query.

    Raises:
        OnePostureError: it is one symbol.
    """
    return _long_enough(StringQuery(name, string, 0, int(string.stops[-1]), name, None, fps))


def query_of_symbols(symbols: NDArray[np.int32], name: str = "query") -> StringQuery:
    """A string without frames: these are its symbols.

    Raises:
        UserError: an empty string, or one symbol.
    """
    if symbols.ndim != 1:
        raise UserError(f"a query is one row of symbols, not an array of shape {symbols.shape}")
    places = np.arange(len(symbols) + 1, dtype=np.int64)
    string = SymbolString(symbols, places[:-1], places[1:])
    return _long_enough(StringQuery(name, string, 0, len(symbols)))


def _long_enough(query: StringQuery) -> StringQuery:
    count = len(query.symbols)
    if count == 0:
        raise UserError(f"{query.name}: is empty; a string to align has at least {SHORTEST} symbols")
    if count < SHORTEST:
        raise OnePostureError(
            f"{query.name}: frames {query.start} to {query.stop} are one symbol, a posture that is held; take a longer "
            "range, one in which the body moves"
        )
    return query
