"""Earth Mover's Distance between signatures (Deep Motifs, section 4.3, equations 4 to 6).

The mass at a motif is its tf-idf weight; signatures are scaled to mass 1, so all mass is moved and the
total flow of equation 6 is 1. The ground distance d_ij is the L2 distance of the motifs' centroids in the
embedding space. POT's network simplex solves the transport exactly. `emd_deep_motifs` is the paper's variant.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from threading import Lock
from types import ModuleType
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray

Signature = FloatArray | Sequence[float]

BLOCK: Final = 64  # rows whose sums stay in the processor's cache
_ONE_AT_A_TIME: Final = Lock()  # threads that search may be the first to need it
MOST_STEPS: Final = 100_000  # of the simplex, as POT allows


def ground_distances(centroids: FloatArray) -> Float64Array:
    """[K, K] L2 distances of motif `centroids` [K, d]: the ground distance, a metric."""
    # The sums of scipy's cdist in its order, to the last bit; to import that takes longer than this for most lakes.
    points = centroids.astype(np.float64)
    squares = np.zeros((len(points), len(points)))
    for start in range(0, len(points), BLOCK):
        rows = slice(start, start + BLOCK)
        for column in points.T:
            squares[rows] += np.square(column[rows, None] - column)
    return np.sqrt(squares)


def emd(p: Signature, q: Signature, ground: Float64Array) -> float:
    """Earth Mover's Distance of two signatures [K], in the unit of `ground`; exactly 0 for equal ones; symmetric.

    Args:
        p, q: non-negative weights with a positive sum; scaled to mass 1.
        ground: [K, K] distances of the motifs, a metric (`ground_distances`).

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


def transport(p: Float64Array, q: Float64Array, ground: Float64Array, *, partial: bool = False) -> float:
    """Work of the cheapest flow between checked signatures of mass 1; `partial`: one of them may have more."""
    # The ground distance is a metric: some optimal flow leaves the mass that both share where it is.
    shared = np.minimum(p, q)
    surplus, deficit = p - shared, q - shared
    sources, sinks = np.flatnonzero(surplus), np.flatnonzero(deficit)
    if not (len(sources) and len(sinks)):
        return 0.0
    if tuple(sources) > tuple(sinks):  # one order for both directions: the same rounding
        surplus, deficit, sources, sinks = deficit, surplus, sinks, sources
    given, taken, costs = surplus[sources], deficit[sinks], ground[np.ix_(sources, sinks)]
    unmoved = given.sum() - taken.sum() if partial else 0.0
    if unmoved > 0:  # the heavier side sends what it keeps to a place that costs nothing
        taken, costs = np.append(taken, unmoved), np.pad(costs, ((0, 0), (0, 1)))
    elif unmoved < 0:
        given, costs = np.append(given, -unmoved), np.pad(costs, ((0, 1), (0, 0)))
    return work(given, taken, np.ascontiguousarray(costs))


def work(given: Float64Array, taken: Float64Array, costs: Float64Array) -> float:
    """Work of the cheapest flow from masses [s] to masses [t] of the same sum, at `costs` [s, t], C-contiguous."""
    found = _simplex()(given, taken * given.sum() / taken.sum(), costs, MOST_STEPS, 1)
    return float(found[1])


def emd_deep_motifs(p: Signature, q: Signature, strength: FloatArray, ground: Float64Array) -> float:
    """Earth Mover's Distance of two signatures [K] over dense weights, with partial flow; exact and symmetric as `emd`.

    Args:
        p, q: non-negative weights with a positive sum, of quantity after tf-idf; not scaled.
        strength: [K] densities of the motifs, in any unit.
        ground: [K, K] distances of the motifs, a metric.

    Raises `ValueError` where signatures or densities do not fit the motifs.
    """
    density = check_signature(strength, len(ground))
    return emd_partial(check_signature(p, len(ground)) * density, check_signature(q, len(ground)) * density, ground)


def emd_partial(p: Signature, q: Signature, ground: Float64Array) -> float:
    """Work of the cheapest flow of min(sum p, sum q), divided by that flow (equation 6).

    `p` and `q` [K] are not scaled. Raises `ValueError` as `check_signatures` does.
    """
    left, right = check_signature(p, len(ground)), check_signature(q, len(ground))
    flow = min(left.sum(), right.sum())
    return transport(left / flow, right / flow, ground, partial=True)


def _simplex() -> Callable[..., tuple[Any, ...]]:
    """`ot.lp.emd_wrap.emd_c`, POT's compiled network simplex: (plan, cost, ...)."""
    with _ONE_AT_A_TIME:
        return _imported()


@cache
def _imported() -> Callable[..., tuple[Any, ...]]:
    """The same, without the rest of POT, whose import takes longer than a search."""
    if "ot" not in sys.modules:
        spec = find_spec("ot")
        assert spec is not None
        assert spec.origin is not None
        root = Path(spec.origin).parent
        packages = {"ot": root, "ot.lp": root / "lp", "ot.utils": root}
        try:
            for name, folder in packages.items():  # empty ones: their __init__ imports scikit-learn and much more
                sys.modules[name] = _Empty(name)
                sys.modules[name].__path__ = [str(folder)]
            importlib.import_module("ot.lp.emd_wrap")
        finally:
            for name in packages:
                del sys.modules[name]
    else:
        importlib.import_module("ot.lp.emd_wrap")
    solver: Callable[..., tuple[Any, ...]] = sys.modules["ot.lp.emd_wrap"].emd_c
    return solver


class _Empty(ModuleType):
    """A package whose functions are imported when they are called."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        home = self.__name__
        return lambda *given, **named: getattr(importlib.import_module(home), name)(*given, **named)
