"""Whole clips of a lake by one method: it compares those that vectors in the shortlist choose."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

from motionlake.arrays import Float64Array
from motionlake.kernels import expect_many
from motionlake.lake.layout import Lake
from motionlake.retrieval.hits import Hit, Match
from motionlake.retrieval.lake_shortlist import LakeShortlist
from motionlake.retrieval.protocol import Finds, LakeSearcher, Query, Scope, Searcher
from motionlake.retrieval.shortlist import Cascade
from motionlake.retrieval.shortlist_methods import METHODS
from motionlake.stages.shortlist_files import needed_by


class ChosenSearcher(LakeSearcher):
    """Search by the signature, the string or the moves of clips (`METHODS`); a `Searcher`.

    Of a hundred answers some are not those of comparing every clip (docs/search.md); `registry.searcher` does that by
    `exact`.

    Args:
        lake: the lake.
        name: of the method.
        files: of the lake's shortlist.
        every: makes the searcher that compares every clip, which tells distances.

    Raises:
        UserError, DamagedError: as `LakeShortlist`.
    """

    finds: Finds = "clip"

    def __init__(self, lake: Lake, name: str, files: Sequence[str], every: Callable[[], Searcher]) -> None:
        super().__init__(lake)
        self.name, self._make_every = name, every
        asked = [name] if METHODS[name].told_by_vectors else METHODS
        self._cascade = Cascade(LakeShortlist(lake, files, needed_by(asked)))

    def warm_up(self) -> None:
        """As `FusedSearcher.warm_up`.

        Raises:
            DamagedError: a file of the shortlist is not as it was written.
        """
        expect_many()
        if self.name == "moves":
            self._cascade.files.moves.check_all()

    def nearest(self, queries: Sequence[Query], k: int, scope: Scope, *, mirrored: bool) -> list[list[Hit]]:
        return [self._cascade.by(self.name, query, k, scope, mirrored=mirrored) for query in queries]

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        return self._every.distances(queries, gallery)

    def matches(self, query: Query, hits: Sequence[Hit], *, mirrored: bool) -> dict[str, Match]:
        return self._cascade.matches(query, hits, mirrored=mirrored) if self.name == "moves" else {}

    @cached_property
    def _every(self) -> Searcher:
        return self._make_every()
