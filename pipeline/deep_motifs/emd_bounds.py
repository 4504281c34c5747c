"""Kernels of the lower bounds of `motionlake.deep_motifs.emd_search`: apart from it, for they take long to load."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.kernels import njit

# Some 1e5 times the rounding of a sum over a few hundred motifs, and far below what tells clips apart.
SLACK: Final = 1e-9
SLACK_DIAMETER: Final = 1e-12


@njit(cache=True)
def largest_differences(query, projected, candidates):  # type: ignore[no-untyped-def]
    found = np.empty(len(candidates))
    for c in range(len(candidates)):
        row = projected[candidates[c]]
        largest = np.float32(0)
        for a in range(len(row)):
            largest = max(largest, abs(query[a] - row[a]))
        found[c] = largest
    return found


@njit(cache=True)
def exchanged(query, motifs, masses, ground):  # type: ignore[no-untyped-def]
    """What `transport` solves for a query [K] of mass 1 and a sparse signature: masses to move, and costs [s, t]."""
    surplus, deficit = query.copy(), np.zeros(len(query))
    for t in range(len(motifs)):
        j = motifs[t]
        shared = min(query[j], masses[t])
        surplus[j] = query[j] - shared
        deficit[j] = masses[t] - shared
    sources, sinks = np.flatnonzero(surplus), np.flatnonzero(deficit)
    swapped = len(sources) > len(sinks)  # as tuples compare
    for t in range(min(len(sources), len(sinks))):
        if sources[t] != sinks[t]:
            swapped = sources[t] > sinks[t]
            break
    if swapped:
        surplus, deficit, sources, sinks = deficit, surplus, sinks, sources
    costs = np.empty((len(sources), len(sinks)))
    for a in range(len(sources)):
        for b in range(len(sinks)):
            costs[a, b] = ground[sources[a], sinks[b]]
    return surplus[sources], deficit[sinks], costs


@njit(cache=True)
def transfer_bounds(query, offsets, motifs, masses, ground, neighbours, candidates, enough):  # type: ignore[no-untyped-def]
    """[c] bounds of a query [K] of mass 1; the sparse signatures and `neighbours` as in `SignatureIndex`."""
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
