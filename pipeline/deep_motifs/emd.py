"""Earth Mover's Distance between signatures (Deep Motifs, section 4.3, equations 4 to 6), and cheap lower bounds.

The mass at a motif is its tf-idf weight; signatures are scaled to mass 1, so all mass is moved and the
total flow of equation 6 is 1. The ground distance d_ij is the L2 distance of the motifs' centroids in the
embedding space. POT's network simplex solves the transport exactly. `emd_deep_motifs` is the paper's variant.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, FloatArray, Int64Array
from motionlake.deep_motifs.transport import cheapest_flow
from numba import njit

Signature = FloatArray | Sequence[float]


def ground_distances(centroids: FloatArray) -> Float64Array:
    """[K, K] L2 distances of motif `centroids` [K, d]: the ground distance, a metric."""
    from scipy.spatial.distance import cdist

    points = centroids.astype(np.float64)
    return np.ascontiguousarray(cdist(points, points))


def emd(p: Signature, q: Signature, ground: Float64Array) -> float:
    """Earth Mover's Distance of two signatures.

    Args:
        p: [K] non-negative weights with a positive sum; scaled to mass 1.
        q: [K] likewise.
        ground: [K, K] distances of the motifs, a metric (`ground_distances`).

    Returns:
        A distance in the unit of `ground`; exactly 0 for equal signatures; symmetric.

    Raises:
        ValueError: a signature of another length, with negative weights or without mass.
    """
    return transport(unit_mass(p, ground), unit_mass(q, ground), ground)


def emd_many(query: Signature, signatures: FloatArray, ground: Float64Array) -> Float64Array:
    """[n] distances of `query` [K] from each of `signatures` [n, K]; see `emd`."""
    p = unit_mass(query, ground)
    return np.array([transport(p, q, ground) for q in unit_masses(signatures, ground)], dtype=np.float64)


def emd_matrix(signatures: FloatArray, ground: Float64Array) -> Float64Array:
    """[n, n] distances between all of `signatures` [n, K]; see `emd`."""
    masses = unit_masses(signatures, ground)
    matrix = np.zeros((len(masses), len(masses)))
    for i, p in enumerate(masses):
        for j in range(i):
            matrix[i, j] = matrix[j, i] = transport(p, masses[j], ground)
    return matrix


def unit_mass(weights: Signature, ground: Float64Array) -> Float64Array:
    """[K] a signature scaled to mass 1. Raises `ValueError` as `check_signatures` does."""
    mass = check_signature(weights, len(ground))
    return np.asarray(mass / mass.sum(), dtype=np.float64)


def unit_masses(weights: FloatArray, ground: Float64Array) -> Float64Array:
    """[n, K] signatures scaled to mass 1. Raises `ValueError` as `check_signatures` does."""
    mass = check_signatures(weights, len(ground))
    return np.asarray(mass / mass.sum(axis=1, keepdims=True), dtype=np.float64)


def check_signature(weights: Signature, k: int) -> Float64Array:
    """[K] float64 weights. Raises `ValueError` as `check_signatures` does."""
    return np.asarray(check_signatures(np.asarray(weights, dtype=np.float64)[None], k)[0], dtype=np.float64)


def check_signatures(weights: FloatArray, k: int) -> Float64Array:
    """[n, K] float64 weights. Raises `ValueError` where a row is no signature over `k` motifs."""
    mass = np.ascontiguousarray(weights, dtype=np.float64)
    if mass.shape[1:] != (k,):
        raise ValueError(
            f"a signature of shape {mass.shape[1:]} does not fit {k} motifs; was it made with other motifs?"
        )
    totals = mass.sum(axis=1)
    if not (np.isfinite(totals).all() and (totals > 0).all() and (mass >= 0).all()):
        raise ValueError("a signature needs finite, non-negative weights with a positive sum")
    return mass


def check_model(model: str | None, served: str | None) -> None:
    """Raises `ValueError` where both are known and differ: signatures of two sets of motifs do not compare."""
    if model is not None and served is not None and model != served:
        raise ValueError(f"a signature over {model} does not compare with signatures over {served}; make it again")


def transport(p: Float64Array, q: Float64Array, ground: Float64Array) -> float:
    """`emd` of checked signatures of mass 1."""
    # The ground distance is a metric: some optimal flow leaves the mass that both share where it is.
    shared = np.minimum(p, q)
    surplus, deficit = p - shared, q - shared
    sources, sinks = np.flatnonzero(surplus), np.flatnonzero(deficit)
    if not (len(sources) and len(sinks)):
        return 0.0
    if tuple(sources) > tuple(sinks):  # one order for both directions: the same rounding
        surplus, deficit, sources, sinks = deficit, surplus, sinks, sources
    return cheapest_flow(surplus[sources], deficit[sinks], np.ascontiguousarray(ground[np.ix_(sources, sinks)]))


def emd_deep_motifs(p: Signature, q: Signature, strength: FloatArray, ground: Float64Array) -> float:
    """Earth Mover's Distance of two signatures over dense weights, with partial flow.

    Args:
        p: [K] non-negative weights with a positive sum, of quantity after tf-idf; not scaled.
        q: [K] likewise.
        strength: [K] densities of the motifs, in any unit.
        ground: [K, K] distances of the motifs, a metric.

    Returns:
        A distance in the unit of `ground`; exactly 0 for equal signatures; symmetric.

    Raises:
        ValueError: signatures or densities that do not fit the motifs.
    """
    density = check_signature(strength, len(ground))
    return emd_partial(check_signature(p, len(ground)) * density, check_signature(q, len(ground)) * density, ground)


def emd_partial(p: Signature, q: Signature, ground: Float64Array) -> float:
    """Work of the cheapest flow of min(sum p, sum q), divided by that flow (equation 6).

    Args:
        p: [K] non-negative mass with a positive sum; not scaled.
        q: [K] likewise.
        ground: [K, K] distances of the motifs, a metric.

    Raises:
        ValueError: mass of another length, negative or none.
    """
    left, right = check_signature(p, len(ground)), check_signature(q, len(ground))
    flow = min(left.sum(), right.sum())
    left, right = left / flow, right / flow
    # As in `emd`, some optimal flow leaves the mass that both share where it is, by the triangle inequality.
    shared = np.minimum(left, right)
    surplus, deficit = left - shared, right - shared
    sources, sinks = np.flatnonzero(surplus), np.flatnonzero(deficit)
    if not (len(sources) and len(sinks)):
        return 0.0
    if tuple(sources) > tuple(sinks):  # one order for both directions: the same rounding
        surplus, deficit, sources, sinks = deficit, surplus, sinks, sources
    given, taken, costs = surplus[sources], deficit[sinks], ground[np.ix_(sources, sinks)]
    unmoved = given.sum() - taken.sum()
    if unmoved > 0:  # the heavier side sends what it keeps to a place that costs nothing
        taken, costs = np.append(taken, unmoved), np.pad(costs, ((0, 0), (0, 1)))
    elif unmoved < 0:
        given, costs = np.append(given, -unmoved), np.pad(costs, ((0, 1), (0, 0)))
    return cheapest_flow(given, taken, np.ascontiguousarray(costs))


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
