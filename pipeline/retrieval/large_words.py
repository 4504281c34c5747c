"""The words of a large lake, as its shortlist keeps them: where pieces are looked for in it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from motionlake.arrays import Float64Array, Int64Array
from motionlake.columns import numbers
from motionlake.deep_motifs.emd import ground_distances
from motionlake.deep_motifs.many_ranges import ManyWords
from motionlake.deep_motifs.query_by_example import ExampleQuery, NearWindow, words_within
from motionlake.deep_motifs.range_bounds import WordMotifs
from motionlake.deep_motifs.signatures import CorpusClip
from motionlake.errors import UserError
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.frames import frame_range
from motionlake.lake.layout import Lake
from motionlake.lake.settings import served_config
from motionlake.motion.features import native_ranges
from motionlake.retrieval.lake_shortlist import LakeShortlist
from motionlake.retrieval.protocol import Query, Scope
from motionlake.stages.shortlist_files import lists_named
from numpy.typing import NDArray


class LakeWords:
    """The words of a large lake, read where they are needed.

    Args:
        lake: the lake.
        files: of its shortlist.

    Attributes:
        clips: those of the shortlist.

    Raises:
        UserError, DamagedError: as `LakeShortlist`.
    """

    def __init__(self, lake: Lake, files: Sequence[str]) -> None:
        self.clips = LakeShortlist(lake, files, lists_named("words"))
        self._config = served_config(lake).words
        with reading(lake) as con:
            motifs = fetch(con, "corpus_motifs")
        centroids = np.array([row["centroid"] for row in motifs], dtype=np.float32)
        if not self.clips.files.has("words"):
            raise UserError(
                f"{lake.root}: its shortlist was made without words, by an earlier version; make it anew with "
                "`motionlake run shortlist`"
            )
        self._words = WordMotifs(*self.clips.files.flat("words"))
        idf = np.array([row["idf"] for row in motifs], dtype=np.float64)
        self._many = ManyWords(self._words, self._frames_of, idf, ground_distances(centroids))
        catalog = self.clips.known.table
        self._fps, self._frames = (
            numbers(catalog[name])[np.maximum(self.clips.entries, 0)] for name in ("fps", "frames")
        )

    def facts(self, row: int) -> CorpusClip:
        """What the catalog says of a clip."""
        return self.clips.facts(row)

    def row(self, clip: str) -> int:
        """Raises `UserError` for a clip that the shortlist does not hold, or that has no words there."""
        row = self.clips.row(clip)
        if not self._words.counts(np.array([row]))[0]:
            raise self.clips.files.lacks(row, "signature")
        return row

    def motifs_of(self, query: Query) -> NDArray[np.int32]:
        """[n] motifs of the words that lie wholly within a query, which is a clip of the lake or a part of one.

        Raises:
            UserError: as `row`, or the clip has no such frames.
        """
        row = self.row(query.name)
        motifs = self._words.of(row)
        starts, stops = self._frames_of(
            np.full(len(motifs), row), np.arange(len(motifs)), np.arange(1, len(motifs) + 1)
        ).T
        frames = frame_range(query.name, query.start, query.stop, int(self._frames[row]))
        return motifs[words_within(starts, stops, *frames)]

    def nearest(self, query: ExampleQuery, asked: Query, k: int, scope: Scope) -> list[NearWindow]:
        """The k ranges most like a query of the words that were asked for, nearest first."""
        without = None
        if asked.clip is not None and not scope.own:
            row = self.row(asked.clip)
            without = (row, asked.start or 0, int(self._frames[row]) if asked.stop is None else asked.stop)
        return self._many.nearest(query, k, np.isfinite(self.clips.admits(scope.clips)), without)

    def rows_near(self, query: ExampleQuery, count: int, scope: Scope) -> Int64Array:
        """The rows of so many clips that hold what is likely to be most like a query."""
        return self._many.clips_near(query, count, np.isfinite(self.clips.admits(scope.clips)))

    @property
    def idf(self) -> Float64Array:
        """[K] of the motifs."""
        return self._many.idf

    @property
    def ground(self) -> Float64Array:
        """[K, K] distances of the motifs."""
        return self._many.ground

    def _frames_of(self, clip: Int64Array, first: Int64Array, last: Int64Array) -> Int64Array:
        """The frames [v, 2] that words [first, last) of clips cover, as stage "words" gives them."""
        fps, frames, stride = self._fps[clip], self._frames[clip], self._config.stride
        begin = native_ranges(first * stride, fps, frames, self._config)[:, 0]
        return np.column_stack([begin, native_ranges((last - 1) * stride, fps, frames, self._config)[:, 1]])
