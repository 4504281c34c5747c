"""Ranges by moves in a lake of some thousand clips: in those that hold what is most like the piece."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Final

from motionlake.deep_motifs.signatures import CorpusClip
from motionlake.retrieval.moves import MovesRangeSearcher
from motionlake.retrieval.protocol import Query, Scope
from motionlake.retrieval.submotion_search import SubmotionSearcher

CLIPS: Final = 2000  # that are compared: all of a lake of so many


class NearMovesSearcher(MovesRangeSearcher):
    """Ranges by moves in the clips that hold the windows of the sub-motion encoder nearest to the piece; a `Searcher`.

    Where the lake has no codes of windows all clips are compared.

    Raises:
        UserError: the lake has no moves.
    """

    @cached_property
    def _windows(self) -> SubmotionSearcher:
        return SubmotionSearcher(self.lake)

    def _compared(self, query: Query, k: int, scope: Scope, *, mirrored: bool) -> Sequence[CorpusClip]:
        if len(self.clips) <= max(CLIPS, k):
            return self.clips
        near = self._windows.clips_near(query, max(CLIPS, k), scope, mirrored=mirrored)
        if near is None:
            return self.clips
        return [clip for clip in self.clips if clip.clip in near or clip.clip == query.clip]
