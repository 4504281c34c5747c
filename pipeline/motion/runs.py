"""Ranges of frames in which something holds."""

from __future__ import annotations

import numpy as np
from motionlake.arrays import BoolArray


def runs(mask: BoolArray, gap: int = 0, least: int = 1) -> list[tuple[int, int]]:
    """Half-open ranges where a mask [F] is true; those at most `gap` apart are one, shorter than `least` none."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    joined: list[tuple[int, int]] = []
    for start, stop in edges.reshape(-1, 2).tolist():
        if joined and start - joined[-1][1] <= gap:
            joined[-1] = (joined[-1][0], stop)
        else:
            joined.append((start, stop))
    return [(start, stop) for start, stop in joined if stop - start >= least]
