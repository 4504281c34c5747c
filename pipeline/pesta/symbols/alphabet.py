"""Symbols as the numbers 0 to n - 1, and runs of one symbol as that symbol."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from motionlake.arrays import Int32Array, Int64Array
from numpy.typing import NDArray

LARGEST_TABLE: Final = 1 << 16


def ranks(symbols: NDArray[Any]) -> tuple[Int32Array, int]:
    """A string over small symbols: int32 [n] from 0 on, in the order of the old symbols, and how many there may be.

    Symbols that are already small and not negative are left as they are.
    """
    if len(symbols) == 0:
        return np.empty(0, np.int32), 0
    low, high = int(symbols.min()), int(symbols.max())
    if low >= 0 and high < 256:
        return np.ascontiguousarray(symbols, dtype=np.int32), high + 1
    if high - low < max(LARGEST_TABLE, 2 * len(symbols)):
        if low >= 0 and len(symbols) < 1024:
            return np.ascontiguousarray(symbols, dtype=np.int32), high + 1
        shifted = np.asarray(symbols - low)
        present = np.zeros(high - low + 1, dtype=np.bool_)
        present[shifted] = True
        names = np.cumsum(present, dtype=np.int32) - np.int32(1)
        return np.asarray(names[shifted], dtype=np.int32), int(names[-1]) + 1
    values, inverse = np.unique(symbols, return_inverse=True)
    return inverse.astype(np.int32), len(values)


def reduce_runs(symbols: NDArray[Any]) -> Int64Array:
    """int64 [k] places of the first symbols of all runs of `symbols` (int [n]), ascending."""
    if len(symbols) == 0:
        return np.empty(0, np.int64)
    return np.concatenate(([0], np.flatnonzero(symbols[1:] != symbols[:-1]) + 1))
