"""Many ranges of one long clip by alignment, its windows among them (PESTA, section 7)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from motionlake.errors import UserError
from motionlake.lake.frames import frame_range
from motionlake.lake.strings import LakeStrings
from motionlake.pesta.config import SymbolsConfig
from motionlake.pesta.long_query import LongQuery
from motionlake.pesta.matches import Match, best_matches
from motionlake.pesta.strings import Boundaries
from motionlake.retrieval.hits import Hit
from motionlake.retrieval.matched_frames import MatchedFrames
from motionlake.retrieval.protocol import EVERYTHING, Scope
from motionlake.retrieval.string_queries import StringQuery, string_query
from motionlake.retrieval.symbol_strings import ClipStrings, barred_symbols


@dataclass(frozen=True, kw_only=True)
class WindowHit(Hit):
    """An answer to one window of a long query: frames [query_start, query_stop) of it, at its own rate."""

    query_start: int
    query_stop: int


def step_of(window: int) -> int:
    """How many symbols windows slide: a third of a window (section 8.3.3)."""
    return max(1, window // 3)


@dataclass(frozen=True)
class LongAlignment:
    """A long query, of which every segment is aligned at most once: look for as many ranges of it as you like.

    The postures of a range are those of the long query. Where its string, reduced for itself, is a part of the long
    query's, that part is looked for by the segments that cover it, and else it is aligned by itself: such a range
    begins or ends within a repeat that the long query has folded.

    Attributes:
        query: the long query.
        strings: where to look.
        kept: what is known of its sub-queries.
        clips: the strings before their repeats are folded.
        reduced: how a range is reduced.
        scope: which of the strings' answers count.
        threads: which share the work.
        boundaries: as of `kept`.
    """

    query: StringQuery
    strings: LakeStrings
    kept: LongQuery
    clips: ClipStrings
    reduced: SymbolsConfig
    scope: Scope = EVERYTHING
    threads: int = 1
    boundaries: Boundaries = "kept"

    def windows(self, symbols: int, k: int, *, paths: bool = False) -> list[WindowHit]:
        """The k best matches of every window of some symbols, which slide by a third of them over the long query.

        Raises:
            UserError: windows of fewer than two symbols.
        """
        if symbols < 2:
            raise UserError(f"window is {symbols}: it has at least 2 symbols")
        string, step = self.query.string, step_of(symbols)
        count = len(self.query.symbols)
        begins = range(0, max(count - symbols + step - 1, 0) + 1, step)
        parts = [(first, min(first + symbols, count)) for first in begins if first + 2 <= count]
        self.kept.align(parts, k, threads=self.threads)
        found: list[WindowHit] = []
        for first, last in parts:
            start, stop = int(string.starts[first]), int(string.stops[last - 1])
            if start < stop:  # at a low rate symbols may stand for no frame
                hits = self.matches(start, stop, k, paths=paths)
                found += [WindowHit(**vars(hit), query_start=start, query_stop=stop) for hit in hits]
        return found

    def matches(self, start: int | None, stop: int | None, k: int, *, paths: bool = False) -> list[Hit]:
        """The k best matches of frames [start, stop) of the long query, at its own rate.

        Raises:
            UserError: there are no such frames, or they are one symbol.
        """
        part = self.part(start, stop)
        barred = None if self.scope.own else barred_symbols(self.strings, part, self.clips)
        first = self.place(part)

        def best(count: int) -> list[Match]:
            strings = self.strings
            if first is None:
                return best_matches(
                    part.symbols, strings.repository, strings.distances, count, self.kept.config,
                    boundaries=self.boundaries, barred=barred, paths=paths, threads=self.threads,
                )  # fmt: skip
            last = first + len(part.symbols)
            found = self.kept.best_matches(first, last, count, barred=barred, paths=paths)
            return [replace(m, path=None if m.path is None else m.path - np.array([first, 0])) for m in found]

        crossing = self.boundaries == "crossed"
        framed = MatchedFrames(self.strings, self.clips, part, own=self.scope.own, crossing=crossing)
        return self.scope.near(framed.hits(best, k))

    def part(self, start: int | None, stop: int | None) -> StringQuery:
        """The string of a range, reduced for itself. Raises `UserError` as `matches`."""
        whole, string = self.query, self.clips.of_query(self.query)
        assert string is not None
        first, last = frame_range(whole.name, start, stop, whole.stop)
        return string_query(whole.name, string.part(first, last, self.reduced), whole.fps, whole.clip)

    def place(self, part: StringQuery) -> int | None:
        """Where a string stands in the long query's, nearest to its frames; None where it does not."""
        whole, wanted = self.query, part.symbols
        if len(wanted) > len(whole.symbols):
            return None
        windows = np.lib.stride_tricks.sliding_window_view(whole.symbols, len(wanted))
        found = np.flatnonzero((windows == wanted).all(axis=1))
        if not len(found):
            return None
        return int(found[np.argmin(np.abs(whole.string.starts[found] - part.start))])
