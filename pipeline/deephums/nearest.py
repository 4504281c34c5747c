"""Exact k nearest descriptors by Euclidean distance: a scan in torch.

Distances of answers are computed in float64 from the differences; the scan in float32 only says which rows can be
answers, with a bound on its rounding. So answers do not depend on threads, chunks or the order of summation.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final, NamedTuple

import numpy as np
import torch
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from numpy.typing import ArrayLike

SPARE: Final = 32  # rows that a scan looks at beyond k, for those that rounding puts in the wrong order
SCANNED: Final = 1 << 24  # values that a scan holds at a time
ROWS: Final = 4096  # rows whose exact distances are computed at a time
LARGEST: Final = 1e15  # squares of larger values leave the range of float32
UNIT: Final = 2.0**-24  # rounding of float32


class Neighbours(NamedTuple):
    """The nearest rows of m queries, nearest first, ties by index: `indices` [m, k] and `distances` [m, k]."""

    indices: Int64Array
    distances: Float64Array


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


def nearest(queries: ArrayLike, descriptors: ArrayLike, k: int) -> Neighbours:
    """The k of `descriptors` [n, d] nearest to each of `queries` [m, d]; see `DescriptorScan.nearest`.

    Raises:
        ValueError: as `DescriptorScan` and its `nearest`.
    """
    return DescriptorScan(descriptors).nearest(queries, k)


def squared_distances(rows: Float32Array, query: Float32Array) -> Float64Array:
    """[n] squared distances of rows [n, d] from a query [d], in float64; of a row, the same among any others."""
    found = np.empty(len(rows))
    for first in range(0, len(rows), ROWS):
        apart = rows[first : first + ROWS].astype(np.float64) - query
        found[first : first + ROWS] = np.square(apart, out=apart).sum(axis=1)
    return found


def nearest_of(
    rows: Float32Array, candidates: Int64Array, query: Float32Array, k: int
) -> tuple[Int64Array, Float64Array]:
    """The k candidates [c] among `rows` nearest to a query, and their distances; ties by index."""
    squares = squared_distances(rows[candidates], query)
    order = np.lexsort((candidates, squares))[:k]
    return candidates[order], np.sqrt(squares[order])


def checked_rows(descriptors: ArrayLike) -> Float32Array:
    """[n, d] float32. Raises `ValueError` for another shape, or values that are not finite."""
    rows = np.ascontiguousarray(descriptors, dtype=np.float32)
    if rows.ndim != 2:
        raise ValueError(f"descriptors are rows [n, d], not an array of shape {rows.shape}")
    return _finite(rows)


def checked_queries(queries: ArrayLike, d: int, k: int) -> Float32Array:
    """[m, d] float32 of m queries or one. Raises `ValueError` for k < 1, another width, values that are not finite."""
    if k < 1:
        raise ValueError(f"k = {k}: ask for at least 1 nearest descriptor")
    checked = np.atleast_2d(np.ascontiguousarray(queries, dtype=np.float32))
    if checked.ndim != 2 or checked.shape[1] != d:
        raise ValueError(f"queries of shape {checked.shape} do not compare with descriptors of {d} values")
    return _finite(checked)


def _finite(values: Float32Array) -> Float32Array:
    sound = (np.abs(values) <= LARGEST).all(axis=1)
    if not sound.all():
        raise ValueError(f"row {int(np.argmin(sound))} holds NaN, or a value beyond {LARGEST:g}")
    return values


@contextmanager
def _full_precision() -> Iterator[None]:
    """Products in float32, whatever a training in this process has asked for."""
    before = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision("highest")
    try:
        yield
    finally:
        torch.set_float32_matmul_precision(before)
