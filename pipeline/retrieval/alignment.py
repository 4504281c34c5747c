"""Strided temporal alignment on a lake (PESTA): a range of a clip, or a whole clip, looked for in every clip."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypedDict, Unpack, get_args

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import UserError
from motionlake.lake.catalog import reading
from motionlake.lake.layout import Lake
from motionlake.lake.settings import served_config
from motionlake.lake.strings import LakeStrings, read_strings
from motionlake.pesta.nearest import Both, nearest_strings
from motionlake.pesta.scan import pairwise
from motionlake.pesta.strings import Boundaries, Repository
from motionlake.retrieval.hits import Hit, PathStep, clip_hit
from motionlake.retrieval.matched_frames import MatchedFrames
from motionlake.retrieval.protocol import EVERYTHING, LakeSearcher, Query, Scope, about, not_ready, one_of
from motionlake.retrieval.string_queries import StringQuery, clip_query, query_of_symbols
from motionlake.retrieval.symbol_strings import ClipStrings, Codes, barred_symbols, encoded
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from motionlake.pesta.matches import Match
    from motionlake.retrieval.long_alignment import LongAlignment


class AlignmentOptions(TypedDict, total=False):
    """How strings are aligned.

    Attributes:
        method: "sta", "dtw" or "sw"; by default that of config.toml.
        stride: symbols that "sta" may stride over, plus one; by default that of config.toml.
        gaps: of "sta": whether symbols may be left out at a price; by default that of config.toml.
        strings: of the lake, where they have been read already.
        codes: gives the postures of some clips, where they need not be read from parts.
    """

    method: str | None
    stride: int | None
    gaps: bool | None
    strings: LakeStrings | None
    codes: Codes | None


def check_together(
    *, whole: bool, window: int | None, boundaries: str | None, ways: str | None, mirrored: bool, named: str = ""
) -> None:
    """Raises `UserError` where options of an alignment make no sense together; `named`: what their names begin with."""
    given = {"whole": whole, "mirrored": mirrored}
    if window is not None and (needless := [f"{named}{name}" for name, value in given.items() if value]):
        raise UserError(f"{named}window: looks for many ranges at once; leave {' and '.join(needless)} out")
    if whole and boundaries is not None:
        raise UserError(f"{named}whole: compares whole clips; leave {named}boundaries out")
    if ways is not None and not whole:
        raise UserError(f"{named}ways: is for {named}whole; ranges are found by the query in the clip alone")


class _Aligner(LakeSearcher):
    """What both ways to align share: the strings of a lake, read once, and queries as symbols of its dictionary.

    Raises:
        UserError: the lake has no symbol strings yet, or an unfit setting.
    """

    name = "alignment"
    compares = ("alignment",)

    def __init__(self, lake: Lake, **options: Unpack[AlignmentOptions]) -> None:
        super().__init__(lake)
        settings = served_config(lake)
        given: dict[str, Any] = {k: v for k, v in options.items() if k not in ("strings", "codes") and v is not None}
        try:
            own = settings.alignment
            self.config = replace(own.by(given["method"]) if "method" in given else own, **given)
        except ValueError as error:
            raise UserError(str(error)) from error
        self._threads = os.cpu_count() or 1
        strings = options.get("strings")
        if strings is None:
            with reading(lake) as con:
                strings = read_strings(con)
        self.strings, self._codes = strings, options.get("codes")

    def symbols_of(self, query: Query, *, mirrored: bool = False) -> StringQuery:
        """The symbols of a query.

        Raises:
            UserError: no such clip or file, no string yet, it has no such frames, or these are one symbol.
        """
        strings = self.strings
        if query.clip is not None and query.clip not in strings.positions:
            raise not_ready(self.lake, query.clip, "symbol string")
        if query.clip is None or mirrored or not query.whole:
            return encoded(self.lake, query, self.clip_strings.dictionary, mirrored=mirrored)
        index = strings.positions[query.clip]
        return clip_query(query.clip, strings.string_of(index), strings.clips[index].fps)

    @cached_property
    def clip_strings(self) -> ClipStrings:
        """The strings before their repeats are folded."""
        return ClipStrings(self.lake, self.strings, self._codes)

    def _pairwise(self, queries: Sequence[StringQuery], gallery: Sequence[StringQuery]) -> Float64Array:
        """[q, g] least cost of each query in each of some strings, for each symbol of the query."""
        own, known = ([each.symbols for each in side] for side in (queries, gallery))
        costs = pairwise(own, Repository.of(known), self.strings.distances, self.config, threads=self._threads)
        return np.asarray(costs / np.array([len(each) for each in own], np.float32)[:, None], dtype=np.float64)


class AlignmentSearcher(_Aligner):
    """Whole clips by alignment both ways, the query in the clip and the clip in the query; a `Searcher`.

    The distance of a clip is the cost of its best match for each symbol of the query. A short query is found in many
    clips, so the clip is looked for in the query as well, and the greater cost counts (section 6).

    Args:
        lake: which holds the dictionary and the configuration.
        ways: the greater ("max") or the "mean" of both; "query" looks for the query in the clips alone, as the
            paper does.
        paths: give every answer the path of the query's best match in it.
        options: `AlignmentOptions`.

    Raises:
        UserError: as `_Aligner`; unknown `ways`.
    """

    finds = "clip"

    def __init__(
        self, lake: Lake, *, ways: str | None = None, paths: bool = False, **options: Unpack[AlignmentOptions]
    ) -> None:
        super().__init__(lake, **options)
        self._both: Both = one_of("ways", ways or "max", get_args(Both))
        self._paths = paths

    def whole(self, query: StringQuery, k: int, scope: Scope = EVERYTHING) -> list[Hit]:
        """The k clips nearest to a string, in order and not ranked yet.

        Args:
            query: the string; its own clip is left out.
            k: how many at most.
            scope: which clips may be answers.
        """
        strings = self.strings.among(scope.admission(self.lake))
        own = strings.positions.get(query.clip) if query.clip and not scope.own else None
        with about(query.name):
            found = nearest_strings(
                query.symbols, strings.repository, strings.distances, k, self.config, both=self._both, without=own,
                threads=self._threads,
            )  # fmt: skip
        hits = [clip_hit(strings.clips[index], cost) for index, cost in found]
        if not self._paths:
            return hits
        return [
            replace(hit, path=self._path(query, strings, index)) for hit, (index, _) in zip(hits, found, strict=True)
        ]

    def _path(self, query: StringQuery, strings: LakeStrings, index: int) -> tuple[PathStep, ...]:
        """What of a clip the query's best match in it is aligned to; none where "sw" matches nothing."""
        from motionlake.pesta.matches import best_matches

        string = strings.string_of(index)
        alone = Repository.of([string.symbols])
        best = best_matches(query.symbols, alone, strings.distances, 1, self.config, paths=True)
        pairs = [] if not best or best[0].path is None else best[0].path.tolist()
        return tuple(PathStep(query.frames_of(x), (int(string.starts[y]), int(string.stops[y]))) for x, y in pairs)

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        own, others = ([self.symbols_of(query) for query in side] for side in (queries, gallery))
        there = self._pairwise(own, others)
        if self._both == "query":
            return there
        back = self._pairwise(others, own).T
        return np.maximum(there, back) if self._both == "max" else (there + back) / 2

    def nearest(self, queries: Sequence[Query], k: int, scope: Scope, *, mirrored: bool) -> list[list[Hit]]:
        return [self.whole(self.symbols_of(query, mirrored=mirrored), k, scope) for query in queries]


class AlignmentRangeSearcher(_Aligner):
    """Ranges of frames by alignment of the query with a part of a clip; a `Searcher`.

    The distance of a range is its cost for each symbol of the query. Answers do not overlap one another, nor the query.
    Of a repeat that was folded every cycle is one, or as many in a row as the query has (`pesta.cycles`).

    Args:
        boundaries: of clips: "kept", each is aligned by itself; "crossed", a match may begin in one clip and end in a
            later one; "dropped", all clips make one string as well, and matches that cross are left out.
        paths: give every answer its path.
        options: as of `AlignmentSearcher`.

    Raises:
        UserError: as `_Aligner`; unknown `boundaries`.
    """

    finds = "range"
    several = True

    def __init__(
        self,
        lake: Lake,
        *,
        boundaries: str | None = None,
        paths: bool = False,
        **options: Unpack[AlignmentOptions],
    ) -> None:
        super().__init__(lake, **options)
        self._boundaries: Boundaries = one_of("boundaries", boundaries or "kept", get_args(Boundaries))
        self._paths = paths

    def in_symbols(
        self, symbols: ArrayLike, k: int, scope: Scope = EVERYTHING, *, model: str | None = None
    ) -> list[Hit]:
        """The k best matches of a string over the lake's dictionary (`model`, where its name is known).

        In paths, the query's frames are its symbols.

        Raises:
            UserError: an empty string, one symbol, or a string over another dictionary.
        """
        served = self.strings.model
        if model is not None and model != served:
            raise UserError(f"a string over {model} does not compare with strings over {served}; make it again")
        return scope.near(self.matched(query_of_symbols(np.asarray(symbols, dtype=np.int32)), k, scope))

    def long_query(self, query: Query, scope: Scope = EVERYTHING, window: int | None = None) -> LongAlignment:
        """A clip whose ranges will be looked for one after another (section 7).

        Args:
            query: the clip.
            scope: which clips may be answers.
            window: how many symbols the ranges will have: they are cut into three segments. Without it, segments have
                `SEGMENT_SYMBOLS`.

        Raises:
            UserError: as `symbols_of`; Smith-Waterman.
        """
        from motionlake.pesta.long_query import LongQuery
        from motionlake.retrieval.long_alignment import LongAlignment, step_of

        long, strings = self.symbols_of(query), self.strings.among(scope.admission(self.lake))
        segments = None if window is None else -(-len(long.symbols) // step_of(window))
        with about(long.name):
            kept = LongQuery(
                long.symbols, strings.repository, strings.distances, self.config, segments=segments,
                boundaries=self._boundaries,
            )  # fmt: skip
        symbols = served_config(self.lake).symbols
        return LongAlignment(long, strings, kept, self.clip_strings, symbols, scope, self._threads, self._boundaries)

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        return self._pairwise(*([self.symbols_of(query) for query in side] for side in (queries, gallery)))

    def nearest(self, queries: Sequence[Query], k: int, scope: Scope, *, mirrored: bool) -> list[list[Hit]]:
        return [self.matched(self.symbols_of(query, mirrored=mirrored), k, scope) for query in queries]

    def matched(self, query: StringQuery, k: int, scope: Scope = EVERYTHING) -> list[Hit]:
        """The k best matches of a string, in order and not ranked yet."""
        from motionlake.pesta.matches import best_matches

        strings = self.strings.among(scope.admission(self.lake))
        barred = None if scope.own else barred_symbols(strings, query, self.clip_strings)

        def best(count: int) -> list[Match]:
            with about(query.name):
                return best_matches(
                    query.symbols, strings.repository, strings.distances, count, self.config,
                    boundaries=self._boundaries, barred=barred, paths=self._paths, threads=self._threads,
                )  # fmt: skip

        crossing = self._boundaries == "crossed"
        return MatchedFrames(strings, self.clip_strings, query, own=scope.own, crossing=crossing).hits(best, k)
