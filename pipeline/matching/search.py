"""How far a frame that is wanted is from the frames of a database: every one is looked at."""

from __future__ import annotations

import math

import numpy as np
from motionlake.kernels import njit


@njit(cache=True, fastmath=True)
def distances(features, rows, query, weights, out):  # type: ignore[no-untyped-def]
    """Kernel: Euclidean distance, weighted, of a query [D] from rows [n] of features [N, D], into `out` [n]."""
    width = features.shape[1]
    for i in range(len(rows)):
        row = features[rows[i]]
        total = np.float32(0.0)
        for d in range(width):
            apart = (row[d] - query[d]) * weights[d]
            total += apart * apart
        out[i] = math.sqrt(total)
