"""Runs of one symbol to one symbol (PESTA, section 5.3)."""

from __future__ import annotations

from typing import Any

import numpy as np
from motionlake.pesta.symbols.alphabet import Int64Array
from numpy.typing import NDArray


def reduce_runs(symbols: NDArray[Any]) -> Int64Array:
    """int64 [k] places of the first symbols of all runs of `symbols` (int [n]), ascending."""
    if len(symbols) == 0:
        return np.empty(0, np.int64)
    return np.concatenate(([0], np.flatnonzero(symbols[1:] != symbols[:-1]) + 1))
