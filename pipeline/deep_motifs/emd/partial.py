"""The paper's variant of the Earth Mover's Distance, "deep_motifs" (section 4.3, equations 4 to 6, as printed).

There, signatures are P = {(p_i, w_pi)}: the quantity p_i of motif i after tf-idf, and the dense weight w_pi of
its cluster. Flows are limited by the weights: what leaves i is at most w_pi, what reaches j at most w_qj, the
total is the smaller of both sums, and equation 6 divides the work by it. So the heavier signature keeps mass
that is never moved, and quantity enters only as far as it enters the weight. Were w the density of the cluster
alone, clips with the same motifs would be at distance 0 however often they hold each; hence here w_pi is
quantity times density (section 4.1: the importance of a motif is the density of its cluster). Not a metric:
a signature whose weights lie below another's everywhere is at distance 0 from it.
"""

from __future__ import annotations

import numpy as np
from motionlake.deep_motifs.emd.exact import Float64Array, Signature, cheapest_flow, check_signature
from numpy.typing import NDArray


def emd_deep_motifs(p: Signature, q: Signature, strength: NDArray[np.floating], ground: Float64Array) -> float:
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
