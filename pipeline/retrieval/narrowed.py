"""Pieces in a large lake by methods that would compare it whole: in the clips whose words are most like the piece's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Final

from motionlake.arrays import Float64Array
from motionlake.lake.catalog import reading
from motionlake.lake.layout import Lake
from motionlake.retrieval.hits import Hit
from motionlake.retrieval.protocol import Finds, LakeSearcher, Query, Scope, Searcher
from motionlake.retrieval.query_by_example import WordsSearcher

if TYPE_CHECKING:
    from motionlake.retrieval.alignment import AlignmentRangeSearcher
    from motionlake.retrieval.moves import MovesRangeSearcher

CLIPS: Final = {"alignment": 300, "moves": 64}  # that are compared


class NarrowedSearcher(LakeSearcher):
    """Ranges by alignment or moves in the clips that words find near; a `Searcher`.

    `registry.searcher` compares every clip by `exact`. What is no answer by words cannot be one here, and a piece must
    have two words.

    Args:
        lake: a lake with a shortlist.
        name: of the method.
        every: makes the searcher that compares every clip, which tells distances.

    Raises:
        UserError, DamagedError: as `WordsSearcher`.
    """

    finds: Finds = "range"

    def __init__(self, lake: Lake, name: str, every: Callable[[], Searcher]) -> None:
        super().__init__(lake)
        self.name, self._words, self._make_every = name, WordsSearcher(lake), every
        self.several = name == "alignment"  # by moves each clip is an answer once

    def nearest(self, queries: Sequence[Query], k: int, scope: Scope, *, mirrored: bool) -> list[list[Hit]]:
        return [self._answers(query, k, scope, mirrored=mirrored) for query in queries]

    def _answers(self, query: Query, k: int, scope: Scope, *, mirrored: bool) -> list[Hit]:
        clips = self._words.clips_near(query, max(k, CLIPS[self.name]), scope, mirrored=mirrored)
        found: list[Hit] = self._among(clips).nearest([query], k, scope, mirrored=mirrored)[0]
        return found

    def _among(self, clips: Sequence[str]) -> AlignmentRangeSearcher | MovesRangeSearcher:
        """The method in some clips alone."""
        if self.name == "moves":
            from motionlake.retrieval.moves import MovesRangeSearcher

            return MovesRangeSearcher(self.lake, clips)
        from motionlake.lake.strings import read_strings
        from motionlake.retrieval.alignment import AlignmentRangeSearcher

        with reading(self.lake) as con:
            return AlignmentRangeSearcher(self.lake, strings=read_strings(con, clips))

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        return self._every.distances(queries, gallery)

    @cached_property
    def _every(self) -> Searcher:
        return self._make_every()
