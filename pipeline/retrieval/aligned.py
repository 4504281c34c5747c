"""What is asked of the strings of a lake, and what is answered: frames on both sides of `alignment`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Final

import numpy as np
from motionlake.errors import UserError
from motionlake.lake.frames import frame_range
from motionlake.pesta.alignment.matches import Match
from motionlake.pesta.symbols import SymbolString
from motionlake.retrieval.lake_strings import LakeStrings
from numpy.typing import NDArray

SHORTEST: Final = 2  # symbols of a query


@dataclass(frozen=True)
class PathStep:
    """Frames of the query, and those of the clip that they are aligned to; half-open, each at its own rate."""

    query: tuple[int, int]
    clip: tuple[int, int]


@dataclass(frozen=True)
class AlignedHit:
    """One answer: frames [start, stop) of a clip at its own rate, and what aligning them to the query costs.

    Attributes:
        cost: W of section 6; of "sw", minus the score.
        normalised_cost: cost for each symbol of the query.
        start_seconds: when it starts.
        seconds: how long it lasts.
        stop_clip: where clip boundaries are crossed: the clip that `stop` is a frame of.
        path: where it was asked for; symbols that are strided over are left out. Where clip boundaries are crossed, a
            step's frames are those of the clip that it lies in.
    """

    rank: int
    clip: str
    start: int
    stop: int
    cost: float
    normalised_cost: float
    label: str | None
    dataset: str
    start_seconds: float
    seconds: float
    stop_clip: str | None = None
    path: tuple[PathStep, ...] | None = None

    def as_row(self) -> dict[str, object]:
        row = asdict(self)
        for name in ("stop_clip", "path"):
            if row[name] is None:
                del row[name]
        return row


@dataclass(frozen=True)
class WholeHit:
    """One answer to a whole clip: its cost is that of both ways, each for every symbol of its query."""

    rank: int
    clip: str
    cost: float
    label: str | None
    dataset: str
    seconds: float

    def as_row(self) -> dict[str, object]:
        return asdict(self)


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
            "range, or a larger m below [postures] in config.toml"
        )
    return query


def barred_symbols(strings: LakeStrings, query: StringQuery) -> NDArray[np.bool_] | None:
    """[Y] the query's own symbols in its own clip; None where it is not among the strings."""
    index = strings.positions.get(query.clip) if query.clip else None
    if index is None:
        return None
    barred = np.zeros(len(strings.repository.symbols), dtype=np.bool_)
    own = strings.symbols_of(index).start
    barred[own + query.first : own + query.last] = True
    return barred


def aligned_hits(
    strings: LakeStrings, query: StringQuery, matches: Sequence[Match], *, path_from: int, crossing: bool = False
) -> list[AlignedHit]:
    """Matches as frames; the paths' query indices count from symbol `path_from` of the query's string."""
    return [
        _hit(strings, query, rank, match, path_from, crossing) for rank, match in enumerate(matches, start=1)
    ]  # fmt: skip


def _hit(
    strings: LakeStrings, query: StringQuery, rank: int, match: Match, path_from: int, crossing: bool
) -> AlignedHit:
    known, own = strings.clips[match.clip], strings.symbols_of(match.clip).start
    first, last = own + match.start, own + match.stop - 1
    end = int(np.searchsorted(strings.repository.offsets, last, side="right")) - 1
    start, stop = int(strings.starts[first]), int(strings.stops[last])
    seconds = (stop - start) / known.fps
    if end != match.clip:
        before = sum(c.frames / c.fps for c in strings.clips[match.clip : end])
        seconds = before - start / known.fps + stop / strings.clips[end].fps
    path = None
    if match.path is not None:
        path = tuple(
            PathStep(query.frames_of(x + path_from), (int(strings.starts[own + y]), int(strings.stops[own + y])))
            for x, y in match.path.tolist()
        )
    return AlignedHit(
        rank, known.clip, start, stop, match.cost, match.cost / len(query.symbols), known.label, known.dataset,
        start / known.fps, seconds, strings.clips[end].clip if crossing else None, path,
    )  # fmt: skip


def whole_hits(strings: LakeStrings, found: Sequence[tuple[int, float]]) -> list[WholeHit]:
    """(clip, cost) as answers."""
    hits = []
    for rank, (index, cost) in enumerate(found, start=1):
        clip = strings.clips[index]
        hits.append(WholeHit(rank, clip.clip, cost, clip.label, clip.dataset, clip.frames / clip.fps))
    return hits
