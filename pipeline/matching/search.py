"""How far a frame that is wanted is from the frames of a database, each of which is looked at; one of the nearest."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, Int64Array
from motionlake.kernels import njit

NEAR: Final = 32  # nearest rows that chance chooses from
SPREAD: Final = 1.0  # tolerances above the least cost, within which it does where nothing else is wanted


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


def drawn(costs: Float64Array, width: float, rng: np.random.Generator, recordings: Int64Array | None = None) -> int:
    """Place of one of the least costs [n], at most `width` above the least: the less, the likelier.

    Where it is said which recordings [n] the places are of, the best of each: else one that holds a pose for long is
    drawn as many times likelier as there are frames of it.
    """
    if width <= 0:
        return int(costs.argmin())
    near = np.flatnonzero(costs <= costs.min() + width)
    near = near[np.argsort(costs[near], kind="stable")]
    if recordings is not None:
        _, first = np.unique(recordings[near], return_index=True)
        near = near[np.sort(first)]
    near = near[:NEAR]
    chances = np.exp(-(costs[near] - costs[near[0]]) / (width / 2))
    return int(rng.choice(near, p=chances / chances.sum()))
