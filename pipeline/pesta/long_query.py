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
from motionlake.kernels import njit
from motionlake.pesta.config import DEFAULT_ALIGNMENT, AlignmentConfig
from motionlake.pesta.kernels import join_column, joined_paths, segment_profile, segment_scanner
from motionlake.pesta.matches import (
    Alignment,
    Match,
    beginning,
    placed,
    strided_path,
    taken_symbols,
)
from motionlake.pesta.selection import ascending_blocks, next_column
from motionlake.pesta.strings import Boundaries, Distances, Repository, checked
from motionlake.pesta.vectors import LANES
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
        config: AlignmentConfig = DEFAULT_ALIGNMENT,
        *,
        segments: int | None = None,
        boundaries: Boundaries = "kept",
    ) -> None:
        if config.local:
            raise ValueError("sub-queries of a long query are aligned by sta or dtw, not by sw")
        self._strings = repository.aligned(boundaries)
        self.query, self._matrix = checked(query, repository, distances)
        count = -(-len(self.query) // SEGMENT_SYMBOLS) if segments is None else segments
        if not 1 <= count <= len(self.query):
            raise ValueError(f"a query of {len(self.query)} symbols has 1 to {len(self.query)} segments, not {count}")
        self.segment_length = -(-len(self.query) // count)
        filled = np.pad(self.query, (0, count * self.segment_length - len(self.query)), mode="edge")
        self._segments = np.ascontiguousarray(filled.reshape(count, self.segment_length))
        self._repository, self._stride, self.config = repository, config.reach, config
        self._inside = repository.offsets if boundaries == "dropped" else self._strings.offsets
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
        ends, starts = self._ends[cover], self._starts[cover]
        found, costs = _select(
            self._segments[cover], self._strings.symbols, self._matrix.matrix, self._stride, ends, starts,
            self._strings.offsets, self._inside, taken_symbols(barred, ends.shape[1]), k, np.float32(below),
            start - first, stop - first,
        )  # fmt: skip

        def path(end: int) -> Int64Array:
            return self._path(cover, end, start, stop)

        return placed(found, costs, self._repository, path if paths else None)

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
        begin = beginning(self._strings.offsets, end)
        pieces, column = [], end
        for segment in range(cover.stop - 1, cover.start - 1, -1):
            alignment = _alignment(self._segments[segment], self._strings.symbols, self._matrix.matrix, self._stride)
            path = _segment_path(alignment, self._starts[segment], column)
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
def _alignment(segment: Int32Array, symbols: Int32Array, distances: Float32Array, stride: int) -> Alignment:
    return Alignment(segment, symbols, distances, stride, False, np.float32(0), np.float32(0))


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _segment_path(segment: Alignment, starts: Int32Array, end: int) -> Int64Array:
    """[L, 2] path of one segment that ends in column `end`, by local rows."""
    path: Int64Array = strided_path(segment, starts[end], end, np.float32(np.inf))[0]
    return path


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _portion(
    first: Alignment,
    last: Alignment,
    ends: Float32Array,
    starts: Int32Array,
    begin: int,
    end: int,
    top: int,
    first_row: int,
    last_row: int,
) -> tuple[int, int]:
    """First and last column, from `top` to `end`, of a path in rows [first_row, last_row) of some segments."""
    n, n_rows = len(ends), len(first.query)
    low, high = top, end
    if last_row < n * n_rows:
        path = _segment_path(last, starts[n - 1], end)
        limit = last_row - (n - 1) * n_rows
        cell = len(path) - 1
        while cell > 0 and path[cell, 0] >= limit:
            cell -= 1
        high = path[cell, 1]
    if first_row > 0:
        column = np.int64(end)
        for segment in range(n - 2, -1, -1):
            column = np.int64(join_column(ends[segment], np.int64(starts[segment + 1, column]), begin, first.stride))
        path = _segment_path(first, starts[0], column)
        cell = 0
        while path[cell, 0] < first_row:
            cell += 1
        low = path[cell, 1]
    return low, max(low, high)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _select(
    segments: Int32Array,
    symbols: Int32Array,
    distances: Float32Array,
    stride: int,
    ends: Float32Array,
    starts: Int32Array,
    offsets: Int64Array,
    inside: Int64Array,
    taken: BoolArray,
    k: int,
    limit: np.float32,
    first_row: int,
    last_row: int,
) -> tuple[Int64Array, Float32Array]:
    """[h, 3] start, stop and end column of the best matches, and their costs [h].

    segments: [s, rows] those that cover the sub-query, which are its rows [first_row, last_row); ends, starts: [s, Y].
    """
    first = _alignment(segments[0], symbols, distances, stride)
    last = _alignment(segments[-1], symbols, distances, stride)
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
        begin = beginning(offsets, end)
        low, high = _portion(first, last, ends, starts, begin, end, tops[end], first_row, last_row)
        if low < beginning(inside, high) or np.any(taken[low : high + 1]):
            continue
        taken[low : high + 1] = True
        found[n, 0], found[n, 1], found[n, 2] = low, high + 1, end
        n += 1
    return found[:n], costs[found[:n, 2]]
