"""Retrieval by sub-queries of one long query, PESTA-LQ (section 7).

The query is cut into K segments of equal length, its last symbol repeated to fill the last of them. A sub-query takes
the segments that cover it: from every column of the last row of the last segment's weight matrix a path goes back to
that segment's first row, from there to the cheapest of w + 1 cells in the last row of the segment before, and so on;
its cost is the sum of the costs of the last rows that it passes.

No weight matrix is kept: sub-queries are scanned side by side (`motionlake.pesta.segments`), and of each those columns
are kept that may end one of the best matches. If they do not suffice, more of them are kept in a second scan, so that
answers do not depend on how many there were.

Where the paper is silent:

- The window of w + 1 cells next to a path's top element in column a is columns a - w to a (none before the clip's
  first); of equal cells the diagonal neighbour a - 1 is taken, then a, then the nearest.
- Matches overlap if their portions do: the symbols that the path matches with the sub-query's own rows. They are found
  in ascending cost of the whole path, filling and neighbouring symbols of the covering segments included, by position
  where costs are equal.
- Should the path stride over all of the sub-query's rows inside one segment, the portion is the cell that it strides
  to.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Int32Array, Int64Array
from motionlake.pesta.config import DEFAULT_ALIGNMENT, AlignmentConfig
from motionlake.pesta.lanes import strip_lanes
from motionlake.pesta.long_query_paths import alignment, by_column, leg, select
from motionlake.pesta.matches import Match, beginning, placed, taken_symbols
from motionlake.pesta.paths import trace
from motionlake.pesta.segments import strip_profile, strip_scanner
from motionlake.pesta.selection import BLOCK
from motionlake.pesta.strings import Boundaries, Distances, Repository, checked
from motionlake.pesta.thread_work import useful_threads
from motionlake.threads import in_threads
from numpy.typing import ArrayLike

# Symbols of a segment where K is not given: how far the windows of section 8.3.3 slide.
SEGMENT_SYMBOLS: Final = 4
KEPT_BYTES: Final = 64 << 20  # of what is kept for a session; the sub-queries asked for first are forgotten first
MOST_IN_A_STRIP: Final = 6  # sub-queries of one lane
FOLLOWING: Final = 16  # sub-queries that are aligned together, where one is asked for
_BLOCK_BYTES: Final = 4 * BLOCK
_FEWEST_BLOCKS: Final = 32


class _Kept(NamedTuple):
    """What is kept of one sub-query: blocks of columns [c], ascending, the end costs within them [c * BLOCK] (infinite
    beyond the last column), and what a column outside of them costs at least."""

    blocks: Int32Array
    costs: Float32Array
    bound: np.float32


class _Strips(NamedTuple):
    """One scan: `gap` sub-queries of `chain` segments a lane, the first of which begins with segment first[lane]."""

    first: list[int]
    gap: int
    chain: int


class LongQuery:
    """A long query, and what has been found out about its sub-queries so far: at most `KEPT_BYTES`.

    Args:
        query: [X] symbols.
        repository: where to look.
        distances: [m, m] of the dictionary's symbols.
        config: "sta" without gaps, or "dtw".
        segments: K; as many as give segments of `SEGMENT_SYMBOLS` if not given.
        boundaries: as in `best_matches`.

    Raises:
        ValueError: an empty query, a symbol outside the dictionary, K outside 1 to X, Smith-Waterman, gaps.
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
        if config.gaps:
            raise ValueError("sub-queries of a long query are aligned without gaps: switch gaps off")
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
        self._kept: dict[tuple[int, int], _Kept] = {}
        self._bytes = 0

    def __len__(self) -> int:
        return len(self.query)

    def align(self, parts: Iterable[tuple[int, int]], k: int = 10, *, threads: int = 1) -> None:
        """Align sub-queries [start, stop) side by side, so that `best_matches` finds them ready.

        Args:
            parts: the sub-queries; of more than fit into `KEPT_BYTES` the first.
            k: how many matches of each will be asked for.
            threads: which share the work; the answers do not depend on their number.

        Raises:
            ValueError: as `best_matches`.
        """
        count = self._blocks(k)
        room = max(1, KEPT_BYTES // (count * _BLOCK_BYTES))
        covers = list(dict.fromkeys(self._cover(start, stop) for start, stop in parts))[:room]
        missing = {cover for cover in covers if cover not in self._kept}
        by_chain: dict[int, list[int]] = {}
        for first, chain in sorted(missing):
            by_chain.setdefault(chain, []).append(first)
        scans = [scan for chain, firsts in by_chain.items() for scan in _strips(firsts, chain, threads)]
        cells = len(self._strings.symbols) * strip_lanes() * self.segment_length
        threads = useful_threads(threads, cells * sum(scan.gap + scan.chain for scan in scans))
        for found in in_threads(lambda scan: self._scan(scan, missing, count), scans, threads):
            self._keep(found)

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

        Where it has not been aligned (`align`), it is, and the sub-queries that follow it with it.

        Args:
            start, stop: the sub-query.
            k, barred, below, paths: as in `matches.best_matches`. Query indices of paths count from the long query's
                first symbol.

        Returns:
            Matches in ascending cost of the paths through the covering segments.

        Raises:
            ValueError: an empty sub-query, or one that reaches beyond the query; k below 0.
        """
        if k < 0:
            raise ValueError(f"k is {k}: it is at least 0")
        cover = self._cover(start, stop)
        first, chain = cover
        segments = self._segments[first : first + chain]
        rows = start - first * self.segment_length, stop - first * self.segment_length
        if cover not in self._kept:
            following = range(first, min(first + FOLLOWING, len(self._segments) - chain + 1))
            wanted = {(each, chain) for each in following if (each, chain) not in self._kept}
            ready: dict[tuple[int, int], _Kept] = {}
            for strips in _strips(following, chain, 1):
                ready |= self._scan(strips, wanted, self._blocks(k))
            self._keep(ready)
        while True:
            taken = taken_symbols(barred, len(self._strings.symbols))
            found, costs, enough = select(
                segments, self._strings.symbols, self._matrix.matrix, self._stride, *self._kept[cover],
                self._strings.offsets, self._inside, taken, k, np.float32(below), *rows,
            )  # fmt: skip
            if enough:
                break
            count = min(8 * len(self._kept[cover].blocks), self._blocks(None))
            self._keep(self._scan(_Strips([first], 1, chain), {cover}, count))

        def path(end: int) -> Int64Array:
            return self._path(segments, first, end, start, stop)

        return placed(found, costs, self._repository, path if paths else None)

    def _cover(self, start: int, stop: int) -> tuple[int, int]:
        """The first segment that covers a sub-query, and how many do."""
        if not 0 <= start < stop <= len(self.query):
            raise ValueError(f"sub-query [{start}, {stop}) is not a part of a query of {len(self.query)} symbols")
        first = start // self.segment_length
        return first, -(-stop // self.segment_length) - first

    def _blocks(self, k: int | None) -> int:
        """How many blocks are kept for k matches; None: all."""
        every = -(-len(self._strings.symbols) // BLOCK)
        return max(1, every if k is None else min(every, max(_FEWEST_BLOCKS, 4 * k)))

    def _scan(self, strips: _Strips, wanted: set[tuple[int, int]], count: int) -> dict[tuple[int, int], _Kept]:
        """Align the `wanted` sub-queries of some strips; the `count` best blocks of each."""
        gap, chain, length, lanes = strips.gap, strips.chain, self.segment_length, strip_lanes()
        rows = np.arange((gap + chain - 1) * length)
        begins = np.array([strips.first[min(lane, len(strips.first) - 1)] for lane in range(lanes)])
        places = np.minimum(begins[:, None] * length + rows, self._segments.size - 1)
        covers = [
            (strips.first[lane] + j, chain) if lane < len(strips.first) else None
            for j in range(gap) for lane in range(lanes)
        ]  # fmt: skip
        blocks, minima = np.full((len(covers), count), -1, np.int32), np.full((len(covers), count), np.inf, np.float32)
        costs = np.empty((len(covers), count, BLOCK), np.float32)
        bounds = np.array([np.inf if cover in wanted else -np.inf for cover in covers], np.float32)
        strip_scanner(self._stride, chain, lanes)(
            strip_profile(self._segments.ravel()[places], self._matrix.matrix), length, chain, self._strings.symbols,
            self._strings.offsets, blocks, minima, costs, bounds,
        )  # fmt: skip
        if count >= self._blocks(None):
            bounds[:] = np.inf
        else:
            by_column(blocks, costs)
        return {
            cover: _Kept(blocks[each], costs[each].reshape(-1), bounds[each])
            for each, cover in enumerate(covers)
            if cover in wanted
        }

    def _keep(self, found: dict[tuple[int, int], _Kept]) -> None:
        """Remember what a scan has found, and forget what is oldest where it becomes too much."""
        for cover, kept in found.items():
            self._forget(cover)
            self._kept[cover] = kept
            self._bytes += kept.costs.nbytes
        while self._bytes > KEPT_BYTES and (oldest := next(iter(self._kept))) not in found:
            self._forget(oldest)

    def _forget(self, cover: tuple[int, int]) -> None:
        kept = self._kept.pop(cover, None)
        self._bytes -= kept.costs.nbytes if kept else 0

    def _path(self, segments: Int32Array, first: int, end: int, start: int, stop: int) -> Int64Array:
        """[L, 2] (query index, symbol of the repository) of the sub-query's own rows."""
        begin, pieces, column = beginning(self._strings.offsets, end), [], end
        for segment in range(len(segments) - 1, -1, -1):
            a = alignment(segments[segment], self._strings.symbols, self._matrix.matrix, self._stride)
            end, column, *_ = leg(a, begin, column, segment == len(segments) - 1, 0, self.segment_length)
            pieces.append(trace(a, begin, end) + np.array([(first + segment) * self.segment_length, 0]))
        whole = np.concatenate(pieces[::-1])
        rows = whole[:, 0]
        inside = (rows >= start) & (rows < stop)
        if not inside.any():
            inside[np.flatnonzero(rows >= start)[0]] = True
        return np.asarray(whole[inside], dtype=np.int64)


def _strips(firsts: Sequence[int], chain: int, threads: int) -> list[_Strips]:
    """Scans for sub-queries of `chain` segments that begin with some segments, ascending: the quickest on so many
    threads. More sub-queries of a lane share its segments, but need more lanes filled to be worth it."""

    lanes = strip_lanes()

    def begins(gap: int) -> list[int]:
        chosen: list[int] = []
        for first in firsts:
            if not chosen or first >= chosen[-1] + gap:
                chosen.append(first)
        return chosen

    def cost(gap: int) -> int:
        scans = -(-len(begins(gap)) // lanes)
        return -(-scans // max(threads, 1)) * (gap + chain - 1)

    gap = min(range(1, MOST_IN_A_STRIP + 1), key=cost) if len(firsts) > lanes else 1
    firsts = begins(gap)
    return [_Strips(firsts[at : at + lanes], gap, chain) for at in range(0, len(firsts), lanes)]
