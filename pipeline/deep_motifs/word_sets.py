"""How far runs of embedded words are from one another, whatever their order: a Hausdorff distance of means.

Each word of either run is compared with the nearest word of the other; the distance of the runs is the mean of both
means. Motifs tell words apart as far as their clusters do, and runs of the same motifs are equal by them; here no two
runs are that do not hold the same words.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.kernels import njit
from motionlake.threads import in_threads

MOST: Final = 12  # words of a run that are compared; of a longer one as many, evenly spread
BLOCK: Final = 64  # runs that are compared with those before them at a time
THREADS: Final = 2
_ROUNDING: Final = 1e-5


def spread(count: int) -> Int64Array:
    """Which words of a run of so many are compared."""
    return np.unique(np.linspace(0, count - 1, min(count, MOST)).round().astype(np.int64))


def set_distances(query: Float32Array, words: Float32Array, runs: Int64Array) -> Float64Array:
    """[v] distance of a run of words [n, d] from others.

    Args:
        query: its words.
        words: [W, d], of all the others.
        runs: [v, m] rows of `words`.
    """
    found, between = np.empty(len(runs)), np.empty((len(query), len(words)), dtype=np.float32)

    def measure(some: slice) -> None:
        between[:, some] = _between(query, words[some])

    def compare(some: slice) -> None:
        _one_with_many(between, runs[some], found[some])

    in_threads(measure, _shares(len(words)), THREADS)
    in_threads(compare, _shares(len(runs)), THREADS)
    return found


def set_matrix(words: Float32Array, runs: Int64Array) -> Float64Array:
    """[v, v] distances of runs [v, m] of words [W, d] from one another.

    Threads compare some runs at a time with those before them, and hold no more distances of words than these have.
    """
    used, places = np.unique(runs, return_inverse=True)
    places, known = places.reshape(runs.shape), words[used]
    found = np.zeros((len(runs), len(runs)))

    def compare(first: int) -> None:
        some = places[first : first + BLOCK]
        own, rows = np.unique(some, return_inverse=True)
        columns = places[: first + len(some)].max() + 1
        between = _between(known[own], known[:columns])
        _some_with_those_before(between, rows.reshape(some.shape), places, first, found)

    in_threads(compare, range(0, len(runs), BLOCK)[::-1], THREADS)  # those that have most before them first
    return found


def _shares(count: int) -> list[slice]:
    """Which of so many rows each thread works on."""
    bounds = np.linspace(0, count, THREADS + 1).astype(np.int64).tolist()
    return [slice(first, stop) for first, stop in pairwise(bounds)]


def _between(one: Float32Array, other: Float32Array) -> Float32Array:
    """[n, m] Euclidean distances; exactly 0 of equal words."""
    products = one @ other.T
    _roots(products, np.einsum("nd,nd->n", one, one), np.einsum("nd,nd->n", other, other))
    return products


@njit(cache=True, nogil=True)
def _roots(products: Float32Array, first: Float32Array, second: Float32Array) -> None:
    """Kernel: products [n, m] of vectors become their distances; `first` [n], `second` [m] their squared lengths."""
    for i in range(len(first)):
        for j in range(len(second)):
            lengths = first[i] + second[j]
            square = lengths - 2 * products[i, j]
            products[i, j] = np.sqrt(square) if square > _ROUNDING * lengths else 0


@njit(cache=True, nogil=True)
def _one_with_many(between: Float32Array, runs: Int64Array, out: Float64Array) -> None:
    """Kernel: `between` [n, W] distances of the query's words from all."""
    nearest = np.empty(len(between))
    for run in range(len(runs)):
        nearest[:] = np.inf
        total = 0.0
        for word in runs[run]:
            least = np.inf
            for i in range(len(between)):
                apart = between[i, word]
                least = min(least, apart)
                nearest[i] = min(nearest[i], apart)
            total += least
        out[run] = (total / runs.shape[1] + nearest.mean()) / 2


@njit(cache=True, nogil=True)
def _some_with_those_before(
    between: Float32Array, some: Int64Array, runs: Int64Array, first: int, out: Float64Array
) -> None:
    """Kernel: `out` [v, v] gets how far each of `some` runs [b, m], from the `first` on, is from those before it.

    `between` [w, W] are distances of their words from those of all runs [v, m].
    """
    length = runs.shape[1]
    nearest = np.empty(length)
    for row in range(len(some)):
        one = first + row
        for other in range(one):
            nearest[:] = np.inf
            total = 0.0
            for j in range(length):
                least = np.inf
                for i in range(length):
                    apart = between[some[row, i], runs[other, j]]
                    least = min(least, apart)
                    nearest[i] = min(nearest[i], apart)
                total += least
            out[one, other] = out[other, one] = (total + nearest.sum()) / (2 * length)
