"""Dynamic time warping of one query with many clips without a kernel: for a process that aligns few (`kernels.few`)."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Int64Array

_DIAGONAL: Final = 2000  # cells that are worked out in the time that a diagonal takes beside its own


def plain_work(rows: int, columns: int, lanes: int) -> int:
    """What `few` is asked for before `path_costs`."""
    return rows * columns * lanes + _DIAGONAL * (rows + columns)


def path_costs(squared: Float32Array, lengths: Int64Array) -> Float32Array:
    """[L] summed costs of the cheapest paths of ordinary steps through the roots of `squared` [n, w, L].

    A path goes from the first frames to row n - 1 and column `lengths` [L] - 1. The sums of the kernels, to the last
    bit: cells of one diagonal are worked out together, of all L at once.
    """
    rows, columns, lanes = squared.shape
    roots = np.sqrt(np.maximum(squared, np.float32(0)))
    found = np.zeros(lanes, dtype=np.float32)
    # The cell in row i of a diagonal stands at place i + 1.
    before, last = np.full((2, rows + 1, lanes), np.inf, dtype=np.float32)
    before[0] = 0
    for diagonal in range(rows + columns - 1):
        first, stop = max(0, diagonal - columns + 1), min(rows, diagonal + 1)
        row = np.arange(first, stop)
        steps = np.minimum(last[first:stop], last[first + 1 : stop + 1])
        np.minimum(steps, before[first:stop], out=steps)
        now = np.full_like(last, np.inf)
        np.add(roots[row, diagonal - row], steps, out=now[first + 1 : stop + 1])
        if stop == rows:
            ends = lengths == diagonal - rows + 2
            found[ends] = now[rows, ends]
        before, last = last, now
    return found
