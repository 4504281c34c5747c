"""Retrieval by sub-queries of one long query, PESTA-LQ (section 7).

The query is cut into K segments of equal length, its last symbol repeated to fill the last of them. Each segment is
aligned to the repository at most once, and of its weight matrix the last row is kept, with the column where the path of
each of its cells begins. A sub-query takes the segments that cover it: from every column of the last row of the last
segment a path goes back to that segment's first row, from there to the cheapest of w + 1 cells in the last row of the
segment before, and so on; its cost is the sum of the costs of the last rows that it passes.

Where the paper is silent:

- The window of w + 1 cells next to a path's top element in column a is columns a - w to a (none before the clip's
  first); of equal cells the diagonal neighbour a - 1 is taken, then a, then the nearest.
- Matches overlap if their portions do: the symbols that the path matches with the sub-query's own rows. They are found
  in ascending cost of the whole path, filling and neighbouring symbols of the covering segments included, by position
  where costs are equal.
- Should the path stride over all of the sub-query's rows inside one segment, the portion is the cell that it strides
  to.
- Several segments are aligned in one pass, since that takes no longer than one.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Int32Array, Int64Array
from motionlake.pesta.alignment.kernels import (
    Columns,
    join_column,
    joined_paths,
    segment_profile,
    segment_scanner,
)
from motionlake.pesta.alignment.matches import Match, ascending_blocks, next_column, taken_symbols
from motionlake.pesta.alignment.scan import Boundaries
from motionlake.pesta.alignment.strings import Distances, Repository, SymbolDistances, checked
from motionlake.pesta.alignment.trace import strided_path, strided_weights
from motionlake.pesta.alignment.vectors import LANES
from motionlake.pesta.config import AlignmentConfig
from numba import njit
from numpy.typing import ArrayLike

# Symbols of a segment where K is not given: how far the windows of section 8.3.3 slide.
SEGMENT_SYMBOLS: Final = 4


class LongQuery:
    """A long query, and what has been computed for its segments so far: 8 bytes for each symbol of the repository and
    segment aligned.

    Args:
        query: [X] symbols.
        repository: where to look.
        distances: [m, m] of the dictionary's symbols.
        config: "sta" or "dtw".
        segments: K; as many as give segments of `SEGMENT_SYMBOLS` if not given.
        boundaries: as in `best_matches`.

    Raises:
        ValueError: an empty query, a symbol outside the dictionary, K outside 1 to X, Smith-Waterman.
    """

    def __init__(
        self,
        query: ArrayLike,
        repository: Repository,
        distances: Distances,
        config: AlignmentConfig | None = None,
        *,
        segments: int | None = None,
        boundaries: Boundaries = "kept",
    ) -> None:
        config = config or AlignmentConfig()
        if config.local:
            raise ValueError("sub-queries of a long query are aligned by sta or dtw, not by sw")
        if boundaries not in ("kept", "crossed", "dropped"):
            raise ValueError(f"boundaries is {boundaries!r}, not kept, crossed or dropped")
        self._matrix = SymbolDistances.of(distances)
        self.query = checked(query, repository, self._matrix)
        count = -(-len(self.query) // SEGMENT_SYMBOLS) if segments is None else segments
        if not 1 <= count <= len(self.query):
            raise ValueError(f"a query of {len(self.query)} symbols has 1 to {len(self.query)} segments, not {count}")
        self.segment_length = -(-len(self.query) // count)
        filled = np.pad(self.query, (0, count * self.segment_length - len(self.query)), mode="edge")
        self._segments = np.ascontiguousarray(filled.reshape(count, self.segment_length))
        self._repository, self._dropped = repository, boundaries == "dropped"
        self._strings = repository if boundaries == "kept" else repository.joined
        self._stride = config.reach
        self._ends = np.empty((count, len(repository.symbols)), dtype=np.float32)
        self._starts = np.empty(self._ends.shape, dtype=np.int32)
        self._known = np.zeros(count, dtype=np.bool_)

    def __len__(self) -> int:
        return len(self.query)

    def best_matches(
        self,
        start: int,
        stop: int,
        k: int,
        *,
        barred: BoolArray | None = None,
        below: float = np.inf,
        paths: bool = False,
    ) -> list[Match]:
        """The k best matches of the sub-query of symbols [start, stop) that do not overlap.

        Args:
            start, stop: the sub-query.
            k, barred, below, paths: as in `matches.best_matches`. Query indices of paths count from the long query's
                first symbol.

        Returns:
            Matches in ascending cost of the paths through the covering segments.

        Raises:
            ValueError: an empty sub-query, or one that reaches beyond the query; k below 0.
        """
        if not 0 <= start < stop <= len(self.query):
            raise ValueError(f"sub-query [{start}, {stop}) is not a part of a query of {len(self.query)} symbols")
        if k < 0:
            raise ValueError(f"k is {k}: it is at least 0")
        cover = slice(start // self.segment_length, -(-stop // self.segment_length))
        self._align(cover)
        first = cover.start * self.segment_length
        inside = self._repository.offsets if self._dropped else self._strings.offsets
        matches = []
        found, costs = _select(
            self._ends[cover], self._starts[cover], self._segments[cover], self._strings.symbols,
            self._strings.offsets, inside, taken_symbols(barred, self._ends.shape[1]), k, np.float32(below),
            self._matrix.matrix, self._stride, start - first, stop - first,
        )  # fmt: skip
        offsets = self._repository.offsets
        clips = np.searchsorted(offsets, found[:, 0], side="right") - 1
        spans = found.tolist()
        for (low, high, end), clip, begin, cost in zip(
            spans, clips.tolist(), offsets[clips].tolist(), costs.tolist(), strict=True
        ):
            path = self._path(cover, end, start, stop) - np.array([0, begin]) if paths else None
            matches.append(Match(clip, low - begin, high - begin, cost, path))
        return matches

    def _align(self, cover: slice) -> None:
        """Align the blocks of segments that hold one that is wanted and not known."""
        for segment in range(cover.start, cover.stop):
            if self._known[segment]:
                continue
            block = slice(segment // LANES * LANES, segment // LANES * LANES + LANES)
            segment_scanner(self._stride)(
                segment_profile(self._segments[block], self._matrix.matrix), self.segment_length,
                self._strings.symbols, self._strings.offsets, self._ends[block], self._starts[block],
            )  # fmt: skip
            self._known[block] = True

    def _path(self, cover: slice, end: int, start: int, stop: int) -> Int64Array:
        """[L, 2] (query index, symbol of the repository) of the sub-query's own rows."""
        offsets = self._strings.offsets
        begin = offsets[np.searchsorted(offsets, end, side="right") - 1]
        pieces, column = [], end
        for segment in range(cover.stop - 1, cover.start - 1, -1):
            path = _segment_path(
                self._segments[segment], self._strings.symbols, self._starts[segment], column,
                self._matrix.matrix, self._stride,
            )  # fmt: skip
            pieces.append(path + np.array([segment * self.segment_length, 0]))
            if segment > cover.start:
                column = int(join_column(self._ends[segment - 1], path[0, 1], begin, self._stride))
        whole = np.concatenate(pieces[::-1])
        rows = whole[:, 0]
        inside = (rows >= start) & (rows < stop)
        if not inside.any():
            inside[np.flatnonzero(rows >= start)[0]] = True
        return np.asarray(whole[inside], dtype=np.int64)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _segment_path(
    segment: Int32Array, symbols: Int32Array, starts: Columns, end: int, distances: Float32Array, stride: int
) -> Int64Array:
    """[L, 2] path of one segment that ends in column `end`, by local rows."""
    low = starts[end]
    weights = strided_weights(segment, symbols, low, end, distances, stride, np.float32(np.inf))
    path: Int64Array = strided_path(segment, symbols, low, end, distances, stride, weights)[0]
    return path


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _portion(
    ends: Float32Array,
    starts: Columns,
    segments: Int32Array,
    symbols: Int32Array,
    begin: int,
    end: int,
    first: int,
    distances: Float32Array,
    stride: int,
    first_row: int,
    last_row: int,
) -> tuple[int, int]:
    """First and last column, from `first` to `end`, of a path in rows [first_row, last_row) of some segments."""
    n, n_rows = segments.shape
    low, high = first, end
    cut_below, cut_above = last_row < n * n_rows, first_row > 0
    if not (cut_below or cut_above):
        return low, high
    if cut_below:
        path = _segment_path(segments[n - 1], symbols, starts[n - 1], end, distances, stride)
        limit = last_row - (n - 1) * n_rows
        cell = len(path) - 1
        while cell > 0 and path[cell, 0] >= limit:
            cell -= 1
        high = path[cell, 1]
    if cut_above:
        column = np.int64(end)
        for segment in range(n - 2, -1, -1):
            top = np.int64(starts[segment + 1, column])
            column = np.int64(join_column(ends[segment], top, begin, stride))
        path = _segment_path(segments[0], symbols, starts[0], column, distances, stride)
        cell = 0
        while path[cell, 0] < first_row:
            cell += 1
        low = path[cell, 1]
    return low, max(low, high)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _select(
    ends: Float32Array,
    starts: Columns,
    segments: Int32Array,
    symbols: Int32Array,
    offsets: Int64Array,
    inside: Int64Array,
    taken: BoolArray,
    k: int,
    limit: np.float32,
    distances: Float32Array,
    stride: int,
    first_row: int,
    last_row: int,
) -> tuple[Int64Array, Float32Array]:
    """[h, 3] start, stop and end column of the best matches, and their costs [h]."""
    costs, tops = joined_paths(ends, starts, offsets, stride)
    found = np.empty((min(k, len(costs)), 3), dtype=np.int64)
    n = 0
    # A path that goes on below the sub-query may end on a symbol that is taken.
    ended = taken if last_row == segments.size else np.zeros_like(taken)
    heap = ascending_blocks(costs)
    while n < len(found):
        end = next_column(heap, costs, ended)
        if end < 0 or not costs[end] < limit:
            break
        begin = offsets[np.searchsorted(offsets, end, side="right") - 1]
        low, high = _portion(
            ends, starts, segments, symbols, begin, end, tops[end], distances, stride, first_row, last_row
        )
        if low < inside[np.searchsorted(inside, high, side="right") - 1] or np.any(taken[low : high + 1]):
            continue
        taken[low : high + 1] = True
        found[n, 0], found[n, 1], found[n, 2] = low, high + 1, end
        n += 1
    return found[:n], costs[found[:n, 2]]
