"""Pieces in a large lake by methods that would compare it whole: in clips that hold what is most like the piece.

For moves the windows of the sub-motion encoder tell which these are, for alignment words; docs/search.md says how much
of the answers they hold.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np
from motionlake.arrays import Float64Array, Int32Array, Int64Array
from motionlake.lake.catalog import reading
from motionlake.lake.layout import Lake
from motionlake.retrieval.hits import Hit
from motionlake.retrieval.lake_shortlist import LakeShortlist
from motionlake.retrieval.protocol import Finds, LakeSearcher, Query, Scope, Searcher
from motionlake.retrieval.query_by_example import WordsSearcher

if TYPE_CHECKING:
    from motionlake.lake.strings import LakeStrings
    from motionlake.pesta.strings import SymbolDistances
    from motionlake.retrieval.alignment import AlignmentRangeSearcher
    from motionlake.retrieval.moves import MovesRangeSearcher
    from motionlake.retrieval.submotion_search import SubmotionSearcher
    from motionlake.stages.moves import Tracks

CLIPS: Final = {"alignment": 1500, "moves": 100}  # that are compared


class NarrowedSearcher(LakeSearcher):
    """Ranges by alignment or moves in the clips that hold windows, or words, most like the piece; a `Searcher`.

    `registry.searcher` compares every clip by `exact`. What words choose from must have two of them.

    Args:
        lake: a lake with a shortlist.
        name: of the method.
        files: of the shortlist.
        every: makes the searcher that compares every clip, which tells distances.
        by_windows: whether windows of the encoder choose clips, where the shortlist has them; else words do.

    Raises:
        UserError, DamagedError: as `WordsSearcher`.
    """

    finds: Finds = "range"

    def __init__(
        self, lake: Lake, name: str, files: Sequence[str], every: Callable[[], Searcher], *, by_windows: bool
    ) -> None:
        super().__init__(lake)
        self.name, self._make_every = name, every
        chosen_by = (_windows_of(lake, files) if by_windows else None) or _words_of(lake)
        self._chooser: SubmotionSearcher | WordsSearcher = chosen_by[0]
        self._clips = chosen_by[1]
        self.several = name == "alignment"  # by moves each clip is an answer once

    def nearest(self, queries: Sequence[Query], k: int, scope: Scope, *, mirrored: bool) -> list[list[Hit]]:
        return [self._answers(query, k, scope, mirrored=mirrored) for query in queries]

    def _answers(self, query: Query, k: int, scope: Scope, *, mirrored: bool) -> list[Hit]:
        near = self._chooser.rows_near(query, max(k, CLIPS[self.name]), scope, mirrored=mirrored)
        rows = np.unique(near if query.clip is None else np.append(near, self._clips.row(query.clip)))
        found: list[Hit] = self._among(rows).nearest([query], k, scope, mirrored=mirrored)[0]
        return found

    def _among(self, rows: Int64Array) -> AlignmentRangeSearcher | MovesRangeSearcher:
        """The method in the clips of some rows alone."""
        if self.name == "moves":
            from motionlake.retrieval.moves import MovesRangeSearcher

            return MovesRangeSearcher(self.lake, (self._clips.facts_of(rows), self._tracks(rows)))
        from motionlake.retrieval.alignment import AlignmentRangeSearcher

        codes = None if self._clips.files.postures is None else self._codes
        return AlignmentRangeSearcher(self.lake, strings=self._strings(rows), codes=codes)

    def _tracks(self, rows: Int64Array) -> Tracks:
        """Of the clips of some rows."""
        from motionlake.stages.moves import Tracks, read_tracks

        joints = self._clips.files.joints
        if joints is None:
            return read_tracks(self.lake, self._clips.parts_of(rows))
        found = zip(self._clips.facts_of(rows), joints.of(rows), strict=True)
        return Tracks({clip.clip: own for clip, own in found if len(own)})

    def _codes(self, clips: Sequence[str]) -> dict[str, Int32Array]:
        """[T] symbols of the postures of clips, as the shortlist keeps them; without clips that have none there."""
        postures = self._clips.files.postures
        assert postures is not None
        found = postures.of(np.array([self._clips.row(clip) for clip in clips], dtype=np.int64))
        return {clip: codes for clip, codes in zip(clips, found, strict=True) if len(codes)}

    def _strings(self, rows: Int64Array) -> LakeStrings:
        """The strings of the clips of some rows, which an earlier version's shortlist has without frames."""
        from motionlake.lake.strings import read_strings, strings_of

        files = self._clips.files
        if not files.has("symbol_starts"):
            with reading(self.lake) as con:
                return read_strings(con, [clip.clip for clip in self._clips.facts_of(rows)])
        kept = rows[np.diff(files.flat("symbols")[1])[rows] > 0]
        (symbols, lengths), (starts, _) = (files.joined(name, kept) for name in ("symbols", "symbol_starts"))
        return strings_of(self._clips.facts_of(kept), symbols, starts, lengths, *self._distances)

    @cached_property
    def _distances(self) -> tuple[SymbolDistances, str]:
        from motionlake.lake.strings import read_distances

        with reading(self.lake) as con:
            return read_distances(con)

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        return self._every.distances(queries, gallery)

    @cached_property
    def _every(self) -> Searcher:
        return self._make_every()


def _windows_of(lake: Lake, files: Sequence[str]) -> tuple[SubmotionSearcher, LakeShortlist] | None:
    from motionlake.retrieval.submotion_search import SubmotionSearcher

    clips = LakeShortlist(lake, files)
    windows = SubmotionSearcher(lake, files, clips)
    return None if windows.shortlist is None else (windows, clips)


def _words_of(lake: Lake) -> tuple[WordsSearcher, LakeShortlist]:
    words = WordsSearcher(lake)
    assert words.large is not None
    return words, words.large.clips
