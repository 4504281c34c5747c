"""Exact k nearest descriptors by Euclidean distance: a scan in torch, and an index for one query at a time.

Distances of answers are computed in float64 from the differences. What comes before only says which rows can be
answers, with a bound on its rounding; so answers do not depend on threads, chunks or the order of summation.

The scan multiplies all rows with the queries in float32.

The index scans codes of one byte a value. Rows are turned into their principal directions and cut there into blocks. A
block of a row is kept as integers c of one byte, a scale s and the length e of what rounding lost; then
|q - x| >= |q - s c| - e, and for the blocks not scanned yet, |q - x| >= ||q| - |x||. The first block, of few directions
with most of the variance, rules out most rows; the next blocks of the other rows are scanned in turn, and exact
distances are then computed in the order of the bounds until the next bound exceeds the k-th smallest distance.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final, NamedTuple, Self

import numpy as np
import torch
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.deephums.exact import (
    Neighbours,
    best_of,
    checked_queries,
    checked_rows,
    nearest_of,
    squared_distances,
)
from motionlake.kernels import njit
from numpy.typing import ArrayLike, NDArray

SPARE: Final = 32  # rows that a scan looks at beyond k, for those that rounding puts in the wrong order
SCANNED: Final = 1 << 24  # values that a scan holds at a time
UNIT: Final = 2.0**-24  # rounding of float32

WIDTHS: Final = (32, 64, 128)  # of the first block: the least that holds most of the variance
MOST: Final = 0.7  # of the variance; where no width does, one block of all directions is faster
SAMPLE: Final = 10_000  # rows that the directions are fitted to
TURNED: Final = 8192  # rows that are turned at a time
PROBES: Final = 4  # times k: rows whose exact distances give the first threshold
BATCH: Final = 64  # rows whose exact distances are computed before the threshold is looked at again
CODE: Final = 127
QUERY_CODE: Final = 8191
LARGEST_SUM: Final = 2**31 - 1  # of products of codes
SLACK: Final = 1e-9  # of the lengths: more than what float64 rounds off in a bound


class DescriptorScan:
    """n descriptors prepared for exact search by scanning all of them.

    Holds them by columns as well: torch multiplies these with a query at twice the speed of rows.

    Args:
        descriptors: [n, d], finite.

    Raises:
        ValueError: another shape, or a value that is not finite.
    """

    def __init__(self, descriptors: ArrayLike) -> None:
        self._rows = checked_rows(descriptors)
        self._columns = torch.from_numpy(np.ascontiguousarray(self._rows.T))
        squares = squared_distances(self._rows, np.zeros(self._rows.shape[1], dtype=np.float32))
        self._squares = torch.from_numpy(squares.astype(np.float32))
        self._longest = float(np.sqrt(squares.max(initial=0.0)))

    def __len__(self) -> int:
        return len(self._rows)

    def nearest(self, queries: ArrayLike, k: int) -> Neighbours:
        """The k descriptors nearest to each of m queries; all n where there are fewer.

        Args:
            queries: [m, d], or [d] for one.
            k: how many for each.

        Raises:
            ValueError: k < 1, queries of another width, or values that are not finite.
        """
        checked = checked_queries(queries, self._rows.shape[1], k)
        k = min(k, len(self))
        indices = np.empty((len(checked), k), dtype=np.int64)
        distances = np.empty((len(checked), k))
        step = max(1, SCANNED // max(1, len(self)))
        for first in range(0, len(checked) if k else 0, step):
            some = checked[first : first + step]
            for at, (query, candidates) in enumerate(zip(some, self._candidates(some, k), strict=True), start=first):
                indices[at], distances[at] = nearest_of(self._rows, candidates, query, k)
        return Neighbours(indices, distances)

    def _candidates(self, queries: Float32Array, k: int) -> Iterator[Int64Array]:
        """For each query, rows that hold the k nearest whatever the scan's rounding."""
        width = min(k + SPARE, len(self))
        with _full_precision():
            if len(queries) == 1:  # a product with one row takes the faster kernel
                scanned = torch.addmv(self._squares, self._columns.T, torch.from_numpy(queries[0]), alpha=-2)[None]
            else:
                scanned = torch.addmm(self._squares, torch.from_numpy(queries), self._columns, alpha=-2)
        least, rows = torch.topk(scanned, width, largest=False, sorted=True)
        for at, query in enumerate(queries):
            limit = float(least[at, k - 1]) + 2 * self._rounding(query)
            if width < len(self) and float(least[at, -1]) <= limit:
                yield torch.nonzero(scanned[at].double() <= limit)[:, 0].numpy()
            else:
                yield rows[at].numpy()

    def _rounding(self, query: Float32Array) -> float:
        """How far |x|^2 - 2 q.x as scanned may be from what `squared_distances` gives, less |q|^2."""
        length, d = float(np.linalg.norm(query.astype(np.float64))), len(query)
        scan = UNIT * (2 * (d + 4) * length * self._longest + 4 * self._longest**2)
        return 1.01 * scan + 1e-12 * (length + self._longest) ** 2 + (d + 4) * float(np.finfo(np.float32).tiny)


@contextmanager
def _full_precision() -> Iterator[None]:
    """Products in float32, whatever a training in this process has set."""
    before = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision("highest")
    try:
        yield
    finally:
        torch.set_float32_matmul_precision(before)


class Block(NamedTuple):
    """Some directions of n rows, or of a query (n = 1).

    Attributes:
        codes: [n, w] int8; int16 of a query.
        scales: [n] a row's codes times this are about its values.
        lengths: [n] of codes times scale.
        errors: [n] at least the length of what the codes leave out.
        rest: [n] length of the row in the directions after these.
    """

    codes: NDArray[Any]
    scales: Float64Array
    lengths: Float64Array
    errors: Float64Array
    rest: Float64Array


class QuickIndex:
    """n descriptors prepared for single queries; answers are those of `DescriptorScan`, to the last bit.

    Attributes:
        blocks: of the turned rows.
    """

    def __init__(self, rows: Float32Array, centre: Float64Array, turn: Float64Array, blocks: list[Block]) -> None:
        self._rows, self._centre, self._turn, self.blocks = rows, centre, turn, blocks
        self._slack = SLACK * float(sum(b.lengths + b.errors for b in blocks).max(initial=0.0))  # type: ignore[union-attr]

    def __len__(self) -> int:
        return len(self._rows)

    @classmethod
    def build(cls, descriptors: ArrayLike, cuts: tuple[int, ...] | None = None) -> Self:
        """From `descriptors` [n, d], finite, cut into blocks of directions at `cuts`, or as their variance suggests.

        Raises:
            ValueError: another shape, or a value that is not finite.
        """
        rows = checked_rows(descriptors)
        d = rows.shape[1]
        centre, turn, variances = _directions(rows)
        cuts = _cuts(variances) if cuts is None else cuts
        edges = [0, *(cut for cut in cuts if 0 < cut < d), d]
        parts: list[list[Block]] = [[] for _ in edges[1:]]
        for first in range(0, max(1, len(rows)), TURNED):
            turned = (rows[first : first + TURNED] - centre) @ turn
            for part, start, stop in zip(parts, edges, edges[1:], strict=False):
                part.append(_block(turned[:, start:stop], turned[:, stop:]))
        blocks = [Block(*map(np.concatenate, zip(*part, strict=True))) for part in parts]
        return cls(rows, centre, turn, blocks)

    def nearest(self, query: ArrayLike, k: int) -> Neighbours:
        """The k descriptors nearest to a query [d]; all n where there are fewer. Arrays are [1, k].

        Raises:
            ValueError: k < 1, several queries, another width, or values that are not finite.
        """
        checked = checked_queries(query, self._rows.shape[1], k)
        if len(checked) != 1:
            raise ValueError(f"{len(checked)} queries: the quick index answers one at a time")
        k = min(k, len(self))
        found = nearest_of(self._rows, self._candidates(checked[0], k), checked[0], k)
        return Neighbours(found[0][None], found[1][None])

    def _candidates(self, query: Float32Array, k: int) -> Int64Array:
        """Rows that hold the k nearest."""
        if k == 0:
            return np.zeros(0, dtype=np.int64)
        cut = self._cut(query)
        slack = self._slack + SLACK * float((cut[0].lengths + cut[0].errors + cut[0].rest)[0])
        rows = np.arange(len(self))
        done = np.zeros(len(self))  # squared bound over the blocks that were looked at
        bounds, best = np.empty(0), (np.zeros(0, dtype=np.int64), np.zeros(0))
        for at, (block, part) in enumerate(zip(self.blocks, cut, strict=True)):
            bounds = _bounds(block, part, rows, done)
            if at == 0:
                count = min(PROBES * k, len(bounds))
                probes = torch.topk(torch.from_numpy(bounds), count, largest=False, sorted=False).indices.numpy()
                best = best_of(probes, squared_distances(self._rows[probes], query), k)
            kept = np.flatnonzero(bounds <= _limit(best[1], slack))
            rows, done, bounds = rows[kept], done[kept], bounds[kept]
        return self._settle(query, k, rows, bounds, best, slack)

    def _settle(
        self,
        query: Float32Array,
        k: int,
        rows: Int64Array,
        bounds: Float64Array,
        best: tuple[Int64Array, Float64Array],
        slack: float,
    ) -> Int64Array:
        """The k nearest among `rows` and the k `best` so far, exact distances computed in the order of the bounds."""
        fresh = ~np.isin(rows, best[0])
        rows, bounds = rows[fresh], bounds[fresh]
        order = np.argsort(bounds, kind="stable")
        for first in range(0, len(order), BATCH):
            some = order[first : first + BATCH]
            if bounds[some[0]] > _limit(best[1], slack):
                break
            squares = squared_distances(self._rows[rows[some]], query)
            best = best_of(np.concatenate([best[0], rows[some]]), np.concatenate([best[1], squares]), k)
        return best[0]

    def _cut(self, query: Float32Array) -> list[Block]:
        """The query in the directions of each block."""
        turned = ((query - self._centre) @ self._turn)[None]
        found, start = [], 0
        for block in self.blocks:
            stop = start + block.codes.shape[1]
            most = min(QUERY_CODE, LARGEST_SUM // (CODE * max(1, stop - start)))
            found.append(_block(turned[:, start:stop], turned[:, stop:], most, np.int16))
            start = stop
        return found


def _directions(rows: Float32Array) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Centre [d], principal directions [d, d] as orthonormal columns, and variance [d] along each, largest first."""
    d = rows.shape[1]
    if not len(rows):
        return np.zeros(d), np.eye(d), np.zeros(d)
    sample = rows[np.linspace(0, len(rows) - 1, min(len(rows), SAMPLE)).astype(np.int64)].astype(np.float64)
    centre = sample.mean(axis=0)
    sample -= centre
    variances, directions = np.linalg.eigh(sample.T @ sample)
    return centre, np.ascontiguousarray(directions[:, ::-1]), np.maximum(variances[::-1], 0.0)


def _cuts(variances: Float64Array) -> tuple[int, ...]:
    shares = np.cumsum(variances) / max(float(variances.sum()), 1e-300)
    return tuple([width for width in WIDTHS if width < len(shares) and shares[width - 1] >= MOST][:1])


def _block(values: Float64Array, rest: Float64Array, most: int = CODE, kind: type[np.integer] = np.int8) -> Block:
    """Rows by codes of at most `most`."""
    scales = np.maximum(np.abs(values).max(axis=1, initial=0.0) / most, 1e-300)
    codes = np.rint(values / scales[:, None])
    restored = codes * scales[:, None]
    lengths, errors = np.linalg.norm(restored, axis=1), np.linalg.norm(values - restored, axis=1)
    return Block(codes.astype(kind), scales, lengths, errors, np.linalg.norm(rest, axis=1))


def _limit(squares: Float64Array, slack: float) -> float:
    """What exceeds this is no bound of an answer, where the k-th best of `squares` is the last."""
    return float(np.sqrt(squares[-1]) + slack) ** 2


@njit(cache=True)
def _bounds(block: Block, query: Block, rows: Int64Array, done: Float64Array) -> Float64Array:
    """[r] squared lower bounds of the distances of `rows` [r] from the query, one more block of them scanned.

    done: [r] squared bound over the blocks before; this block's is added.
    """
    bounds = np.empty(len(rows))
    codes, query_codes = block.codes, query.codes[0]
    scale, length, error, beyond = query.scales[0], query.lengths[0], query.errors[0], query.rest[0]
    for at in range(len(rows)):
        row = rows[at]
        total = np.int32(0)
        for i in range(len(query_codes)):
            total = np.int32(total + np.int32(np.int32(codes[row, i]) * np.int32(query_codes[i])))
        square = length * length + block.lengths[row] * block.lengths[row] - 2.0 * scale * block.scales[row] * total
        reach = length + block.lengths[row]
        apart = np.sqrt(max(0.0, square - 1e-13 * reach * reach)) - (block.errors[row] + error) * (1.0 + 1e-9)
        near = max(0.0, apart)
        done[at] += near * near
        bounds[at] = done[at] + (beyond - block.rest[row]) * (beyond - block.rest[row])
    return bounds
