"""Earth Mover's Distance between signatures (Deep Motifs, section 4.3, equations 4 to 6).

The mass at a motif is its tf-idf weight; signatures are scaled to mass 1, so all mass is moved and the
total flow of equation 6 is 1. The ground distance d_ij is the L2 distance of the motifs' centroids in the
embedding space. POT's network simplex solves the transport exactly.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import ot
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

Float64Array = NDArray[np.float64]
Signature = NDArray[np.floating] | Sequence[float]


def ground_distances(centroids: NDArray[np.floating]) -> Float64Array:
    """[K, K] L2 distances of motif `centroids` [K, d]: the ground distance, a metric."""
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
    return _transport(_unit_mass(p, ground), _unit_mass(q, ground), ground)


def emd_many(query: Signature, signatures: NDArray[np.floating], ground: Float64Array) -> Float64Array:
    """[n] distances of `query` [K] from each of `signatures` [n, K]; see `emd`."""
    p = _unit_mass(query, ground)
    return np.array([_transport(p, _unit_mass(q, ground), ground) for q in signatures], dtype=np.float64)


def emd_matrix(signatures: NDArray[np.floating], ground: Float64Array) -> Float64Array:
    """[n, n] distances between all of `signatures` [n, K]; see `emd`."""
    masses = [_unit_mass(q, ground) for q in signatures]
    matrix = np.zeros((len(masses), len(masses)))
    for i, p in enumerate(masses):
        for j in range(i):
            matrix[i, j] = matrix[j, i] = _transport(p, masses[j], ground)
    return matrix


def _unit_mass(weights: Signature, ground: Float64Array) -> Float64Array:
    mass = np.asarray(weights, dtype=np.float64)
    total = mass.sum()
    if mass.shape != (len(ground),):
        raise ValueError(f"a signature of shape {mass.shape} does not fit {len(ground)} motifs")
    if not (total > 0 and np.isfinite(total) and mass.min() >= 0):
        raise ValueError("a signature needs finite, non-negative weights with a positive sum")
    return np.asarray(mass / total, dtype=np.float64)


def _transport(p: Float64Array, q: Float64Array, ground: Float64Array) -> float:
    # The ground distance is a metric: some optimal flow leaves the mass that both share where it is.
    shared = np.minimum(p, q)
    surplus, deficit = p - shared, q - shared
    sources, sinks = np.flatnonzero(surplus), np.flatnonzero(deficit)
    if not (len(sources) and len(sinks)):
        return 0.0
    if tuple(sources) > tuple(sinks):  # one order for both directions: the same rounding
        surplus, deficit, sources, sinks = deficit, surplus, sinks, sources
    costs = np.ascontiguousarray(ground[np.ix_(sources, sinks)])
    mass = surplus[sources]
    cost = ot.emd2(mass, deficit[sinks], costs, check_marginals=False, center_dual=False)
    return float(cost)
