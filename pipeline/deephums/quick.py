"""Exact k nearest descriptors for one query at a time: codes of one byte a value are scanned, few rows computed.

Rows are turned into their principal directions and cut there into blocks. A block of a row is kept as integers c of
one byte, a scale s and the length e of what rounding lost; then |q - x| >= |q - s c| - e, and for the blocks that were
not looked at, |q - x| >= ||q| - |x||. The first block, of few directions with most of the variance, rules out most
rows; the next blocks of what is left are looked at in turn, and the exact distances of what is left then are computed
in the order of the bounds until the next bound exceeds the k-th smallest distance. Answers are those of
`nearest.DescriptorScan`, to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Self

import numpy as np
import torch
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.deephums.nearest import (
    Neighbours,
    checked_queries,
    checked_rows,
    nearest_of,
    squared_distances,
)
from numba import njit
from numpy.typing import ArrayLike, NDArray

WIDTHS: Final = (32, 64, 128)  # of the first block: the least that holds most of the variance
MOST: Final = 0.7  # of the variance; where no width does, one block of all directions is faster
SAMPLE: Final = 10_000  # rows that the directions are fitted to
ROWS: Final = 8192  # rows that are turned at a time
PROBES: Final = 4  # times k: rows whose exact distances give the first threshold
BATCH: Final = 64  # rows whose exact distances are computed before the threshold is looked at again
CODE: Final = 127
QUERY_CODE: Final = 8191
LARGEST_SUM: Final = 2**31 - 1  # of products of codes
SLACK: Final = 1e-9  # of the lengths: more than what float64 rounds off in a bound


@dataclass(frozen=True)
class Block:
    """Some directions of n rows.

    Attributes:
        codes: [n, w] int8.
        scales: [n] a row's codes times this are about its values.
        lengths: [n] of codes times scale.
        errors: [n] at least the length of what the codes leave out.
        rest: [n] length of the row in the directions after these.
    """

    codes: NDArray[np.int8]
    scales: Float64Array
    lengths: Float64Array
    errors: Float64Array
    rest: Float64Array


@dataclass(frozen=True)
class _Query:
    """A query in the directions of one block: codes of two bytes, as `Block` has them."""

    codes: NDArray[np.int16]
    scale: float
    length: float
    error: float
    rest: float


class QuickIndex:
    """n descriptors prepared for single queries; see the module.

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
        for first in range(0, max(1, len(rows)), ROWS):
            turned = (rows[first : first + ROWS] - centre) @ turn
            for part, start, stop in zip(parts, edges, edges[1:], strict=False):
                part.append(_block(turned[:, start:stop], turned[:, stop:]))
        return cls(rows, centre, turn, [_joined(part) for part in parts])

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
        slices = self._cut(query)
        slack = self._slack + SLACK * (slices[0].length + slices[0].error + slices[0].rest)
        rows = np.arange(len(self))
        done = np.zeros(len(self))  # squared bound over the blocks that were looked at
        bounds = np.empty(len(self))
        probes = np.zeros(0, dtype=np.int64)
        squares = np.zeros(0)
        for at, (block, part) in enumerate(zip(self.blocks, slices, strict=True)):
            bounds = np.empty(len(rows))
            _bounds(
                block.codes, block.scales, block.lengths, block.errors, block.rest, rows, done, bounds,
                part.codes, part.scale, part.length, part.error, part.rest,
            )  # fmt: skip
            if at == 0:
                probes = _least(bounds, PROBES * k)
                squares = squared_distances(self._rows[probes], query)
                probes, squares = _best(probes, squares, k)
            kept = np.flatnonzero(bounds <= _limit(squares, slack))
            rows, done, bounds = rows[kept], done[kept], bounds[kept]
        return self._settle(query, k, rows, bounds, (probes, squares), slack)

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
            best = _best(np.concatenate([best[0], rows[some]]), np.concatenate([best[1], squares]), k)
        return best[0]

    def _cut(self, query: Float32Array) -> list[_Query]:
        turned = (query - self._centre) @ self._turn
        found, start = [], 0
        for block in self.blocks:
            stop = start + block.codes.shape[1]
            values, rest = turned[start:stop], float(np.linalg.norm(turned[stop:]))
            most = min(QUERY_CODE, LARGEST_SUM // (CODE * max(1, stop - start)))
            scale = max(float(np.abs(values).max(initial=0.0)) / most, 1e-300)
            codes = np.rint(values / scale)
            error = float(np.linalg.norm(values - codes * scale))
            found.append(_Query(codes.astype(np.int16), scale, float(np.linalg.norm(codes)) * scale, error, rest))
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


def _block(values: Float64Array, rest: Float64Array) -> Block:
    scales = np.maximum(np.abs(values).max(axis=1, initial=0.0) / CODE, 1e-300)
    codes = np.rint(values / scales[:, None])
    restored = codes * scales[:, None]
    lengths, errors = np.linalg.norm(restored, axis=1), np.linalg.norm(values - restored, axis=1)
    return Block(codes.astype(np.int8), scales, lengths, errors, np.linalg.norm(rest, axis=1))


def _joined(parts: list[Block]) -> Block:
    names = ("codes", "scales", "lengths", "errors", "rest")
    return Block(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def _least(bounds: Float64Array, count: int) -> Int64Array:
    """The rows of so many smallest bounds, or all."""
    found = torch.topk(torch.from_numpy(bounds), min(count, len(bounds)), largest=False, sorted=False)
    return found.indices.numpy()


def _limit(squares: Float64Array, slack: float) -> float:
    """What exceeds this is no bound of an answer, where the k-th best of `squares` is the last."""
    return float(np.sqrt(squares[-1]) + slack) ** 2


def _best(rows: Int64Array, squares: Float64Array, k: int) -> tuple[Int64Array, Float64Array]:
    order = np.lexsort((rows, squares))[:k]
    return rows[order], squares[order]


@njit(cache=True)
def _bounds(codes, scales, lengths, errors, rest, rows, done, bounds, query, scale, length, error, beyond):  # type: ignore[no-untyped-def]
    """Squared lower bounds of the distances of some rows from the query, one more block of them looked at.

    Args:
        codes, scales, lengths, errors, rest: of the block.
        rows: [r] which.
        done: [r] squared bound over the blocks before; this block's is added.
        bounds: [r] written.
        query, scale, length, error, beyond: the query's, as a row's.
    """
    width = codes.shape[1]
    for at in range(len(rows)):
        row = rows[at]
        total = np.int32(0)
        for i in range(width):
            total = np.int32(total + np.int32(np.int32(codes[row, i]) * np.int32(query[i])))
        square = length * length + lengths[row] * lengths[row] - 2.0 * scale * scales[row] * total
        reach = length + lengths[row]
        apart = np.sqrt(max(0.0, square - 1e-13 * reach * reach)) - (errors[row] + error) * (1.0 + 1e-9)
        near = max(0.0, apart)
        done[at] += near * near
        bounds[at] = done[at] + (beyond - rest[row]) * (beyond - rest[row])
