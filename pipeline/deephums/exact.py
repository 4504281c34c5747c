"""Exact k nearest descriptors by Euclidean distance where they are few; what larger searches end with.

Distances are computed in float64 from the differences: they depend neither on threads nor on the order of summation.
This module imports neither torch nor numba.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from numpy.typing import ArrayLike

ROWS: Final = 4096  # rows whose exact distances are computed at a time
LARGEST: Final = 1e15  # squares of larger values leave the range of float32
FEW: Final = 5_000  # rows up to which a search has its answer before torch is imported


class Neighbours(NamedTuple):
    """The nearest rows of m queries, nearest first, ties by index: `indices` [m, k] and `distances` [m, k]."""

    indices: Int64Array
    distances: Float64Array


class ExactScan:
    """n descriptors, searched by computing every distance.

    Args:
        descriptors: [n, d], finite.

    Raises:
        ValueError: another shape, or a value that is not finite.
    """

    def __init__(self, descriptors: ArrayLike) -> None:
        self._rows = checked_rows(descriptors)

    def nearest(self, queries: ArrayLike, k: int) -> Neighbours:
        """The k descriptors nearest to each of m queries [m, d], or one [d]; all n where there are fewer.

        Raises:
            ValueError: k < 1, queries of another width, or values that are not finite.
        """
        checked = checked_queries(queries, self._rows.shape[1], k)
        every = np.arange(len(self._rows))
        found = [nearest_of(self._rows, every, query, min(k, len(every))) for query in checked]
        shape = len(checked), min(k, len(every))
        indices = np.array([rows for rows, _ in found], dtype=np.int64).reshape(shape)
        return Neighbours(indices, np.array([distances for _, distances in found]).reshape(shape))


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
    found, squares = best_of(candidates, squared_distances(rows[candidates], query), k)
    return found, np.sqrt(squares)


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


def best_of(rows: Int64Array, squares: Float64Array, k: int) -> tuple[Int64Array, Float64Array]:
    order = np.lexsort((rows, squares))[:k]
    return rows[order], squares[order]
