"""Lower bounds of the Earth Mover's Distance, far cheaper than solving it.

All work on what two signatures of mass 1 do not share: the surplus of one and the deficit of the other, at
motifs where the other has none (`emd` solves the same reduced problem). Every bound is a relaxation of it:

- projection: the distance from each motif is a 1-Lipschitz function, so the difference of its means under
  both signatures is a bound (Kantorovich and Rubinstein). One matrix product for a whole collection.
- transfer: every unit of mass goes to the nearest motifs of the other side, each of which takes no more from one
  motif than its own mass (iterative constrained transfers); the larger of both directions. It is never below
  the relaxed word mover's distance, which ignores that mass, and takes the same walk.

The kernels add in another order than the solver: `SLACK` and `SLACK_DIAMETER` take that off.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from numba import njit

# Some 1e5 times the rounding of a sum over a few hundred motifs, and far below what tells clips apart.
SLACK: Final = 1e-9
SLACK_DIAMETER: Final = 1e-12
FLOAT32_SLACK: Final = 1e-6


def projection_bounds(
    query: Float64Array, projected: Float32Array, candidates: Int64Array, diameter: float
) -> Float64Array:
    """[c] projection bounds of a query from the signatures `candidates` [c].

    Args:
        query: [A] means of the query's distance from A motifs.
        projected: [n, A] those of the signatures.
        candidates: [c] indices of signatures.
        diameter: the largest ground distance.
    """
    largest = _largest_differences(query.astype(np.float32), projected, candidates)
    return np.asarray(np.maximum(largest - FLOAT32_SLACK * diameter, 0), dtype=np.float64)


@njit(cache=True)
def _largest_differences(query, projected, candidates):  # type: ignore[no-untyped-def]
    found = np.empty(len(candidates))
    for c in range(len(candidates)):
        row = projected[candidates[c]]
        largest = np.float32(0)
        for a in range(len(row)):
            largest = max(largest, abs(query[a] - row[a]))
        found[c] = largest
    return found


@njit(cache=True)
def transfer_bounds(query, offsets, motifs, masses, ground, neighbours, candidates, enough):  # type: ignore[no-untyped-def]
    """[c] capacity-limited bounds of a query from the signatures `candidates` [c].

    Args:
        query: [K] mass 1.
        offsets: [n + 1] of the sparse signatures.
        motifs: their motifs.
        masses: their mass at these.
        ground: [K, K].
        neighbours: [K, K] motifs by distance from each.
        candidates: [c] indices of signatures.
        enough: once a bound exceeds it, it is not raised any further.
    """
    k = len(query)
    support = np.flatnonzero(query)
    # The query's motifs by distance from each motif.
    near = np.empty((k, len(support)), dtype=np.int32)
    far = np.empty((k, len(support)))
    for j in range(k):
        found = 0
        for i in neighbours[j]:
            if query[i] > 0:
                near[j, found] = i
                far[j, found] = ground[j, i]
                found += 1
    surplus = query.copy()
    deficit = np.zeros(k)
    bounds = np.empty(len(candidates))
    rounding = SLACK_DIAMETER * ground.max()
    limit = (enough + rounding) / (1 - SLACK)
    for c in range(len(candidates)):
        start, stop = offsets[candidates[c]], offsets[candidates[c] + 1]
        for t in range(start, stop):
            j = motifs[t]
            shared = min(query[j], masses[t])
            surplus[j] = query[j] - shared
            deficit[j] = masses[t] - shared
        inward = 0.0
        for t in range(start, stop):
            j = motifs[t]
            left = deficit[j]
            if left > 0:
                for s in range(len(support)):
                    i = near[j, s]
                    if surplus[i] > 0:
                        moved = min(left, surplus[i])
                        inward += moved * far[j, s]
                        left -= moved
                        if left <= 0:
                            break
                if inward > limit:
                    break
        bound = inward
        if inward <= limit:
            outward = 0.0
            for i in support:
                left = surplus[i]
                if left > 0:
                    for j in neighbours[i]:
                        if deficit[j] > 0:
                            moved = min(left, deficit[j])
                            outward += moved * ground[i, j]
                            left -= moved
                            if left <= 0:
                                break
                    if outward > limit:
                        break
            bound = max(inward, outward)
        bounds[c] = max(bound * (1 - SLACK) - rounding, 0.0)
        for t in range(start, stop):
            j = motifs[t]
            surplus[j] = query[j]
            deficit[j] = 0.0
    return bounds
