"""Query by example in millions of words: windows are bounded from below in one pass, and the nearest few compared.

The answers are those of `query_by_example.find_ranges`, unless more than `MOST` windows may be as near as the last of
them; then those with the least bounds are compared.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Float64Array, Int64Array
from motionlake.deep_motifs.query_by_example import (
    ExampleQuery,
    NearWindow,
    WordWindows,
    bags_of,
    beside,
    nearest_apart,
)
from motionlake.deep_motifs.range_bounds import WindowBounds, WordMotifs
from motionlake.refined import refined

# The frames [v, 2] that words [first, last) of clips [v] cover.
FramesOf = Callable[[Int64Array, Int64Array, Int64Array], Int64Array]
AHEAD: Final = 8  # clips whose windows are compared first for every hit wanted
MOST: Final = 1 << 14  # windows that are compared
_SLACK: Final = 1e-5  # relative: distances are of single precision


@dataclass(frozen=True)
class ManyWords:
    """The words of n clips.

    Attributes:
        words: their motifs.
        frames_of: the frames that they cover.
        idf: [K] of the motifs.
        ground: [K, K] distances of the motifs.
    """

    words: WordMotifs
    frames_of: FramesOf
    idf: Float64Array
    ground: Float64Array

    def nearest(
        self, query: ExampleQuery, k: int, admitted: BoolArray, without: tuple[int, int, int] | None = None
    ) -> list[NearWindow]:
        """The k ranges most like a query, nearest first; no two of one clip overlap.

        Args:
            query: what to look for.
            k: how many at most.
            admitted: [n] clips to look in.
            without: (clip, start, stop): windows of that clip that overlap these frames are left out.
        """
        sides = self._sides(query)
        bounds = self._bounds(sides, AHEAD * k, admitted)
        there = int(np.isfinite(bounds).sum())
        count = min(AHEAD * k, there)
        # Every window that is no farther than `enough` is among those that are compared.
        enough = float(np.partition(bounds, count - 1)[count - 1]) if count else np.inf
        hits: list[NearWindow] = []
        while count:
            windows, whole = self._within(sides, bounds, enough, without)
            hits = nearest_apart(windows, query, k, self.idf, self.ground)
            if not whole or np.isinf(enough) or (len(hits) == k and hits[-1].distance <= enough):
                break
            if len(hits) == k:
                enough = hits[-1].distance
            elif count < there:
                count = min(4 * count, there)
                enough = float(np.partition(bounds, count - 1)[count - 1])
            else:
                enough = np.inf
        return hits

    def clips_near(self, query: ExampleQuery, count: int, admitted: BoolArray) -> Int64Array:
        """So many clips, by index, whose windows may be nearest to a query, by the bounds of their distances."""
        bounds = self._bounds(self._sides(query), count, admitted)
        there = np.flatnonzero(np.isfinite(bounds))
        if len(there) <= count:
            return there
        farthest = np.partition(bounds[there], count - 1)[count - 1]
        nearer, alike = there[bounds[there] < farthest], there[bounds[there] == farthest]
        return np.sort(np.append(nearer, alike[: count - len(nearer)]))

    def _bounds(self, sides: list[WindowBounds], count: int, admitted: BoolArray) -> Float32Array:
        """[n] lower bounds of clips; those of the nearest, so many, are as great as can be told."""
        rough = np.min([side.roughly_of_clips(self.words) for side in sides], axis=0)
        rough[~admitted] = np.inf

        def exact(clips: Int64Array) -> Float32Array:
            return np.asarray(np.min([side.of_clips(self.words, clips) for side in sides], axis=0))

        return refined(rough, count, exact)

    def _sides(self, query: ExampleQuery) -> list[WindowBounds]:
        """Bounds of the query, and of the mirrored query."""
        return [WindowBounds.of(each, query.n_words, self.idf, self.ground) for each in query.signatures(self.idf)]

    def _within(
        self, sides: list[WindowBounds], bounds: Float32Array, enough: float, without: tuple[int, int, int] | None
    ) -> tuple[WordWindows, bool]:
        """The windows whose bound is no more than `enough`, and whether these are all: at most `MOST` of the least."""
        limit = enough * (1 + _SLACK) + _SLACK * float(self.ground.max())
        clips = np.flatnonzero(np.isfinite(bounds) & (bounds <= limit))
        whole = len(clips) <= MOST
        if not whole:  # each has a window that is as near as that
            clips = np.sort(clips[np.argpartition(bounds[clips], MOST)[:MOST]])
        clip, first, bound = sides[0].of_windows(self.words, clips)
        for side in sides[1:]:
            bound = np.minimum(bound, side.of_windows(self.words, clips)[2])
        near = np.flatnonzero(bound <= limit)
        n_words = np.minimum(sides[0].n_words, self.words.counts(clip[near]))
        ranges = self.frames_of(clip[near], first[near], first[near] + n_words)
        kept = np.flatnonzero(beside(clip[near], ranges, without))
        if len(kept) > MOST:
            whole = False
            kept = np.sort(kept[np.argpartition(bound[near[kept]], MOST)[:MOST]])
        chosen = near[kept]
        bags = bags_of(self.words.motifs, self.words.offsets[clip[chosen]] + first[chosen], n_words[kept])
        return WordWindows.of(clip[chosen], ranges[kept], bags, self.idf), whole
