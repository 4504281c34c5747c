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
BLOCK: Final = 16  # runs that are compared with those before them at a time
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
    held = words[runs.T]  # [m, v, d]: the first words of all runs, then their second ones
    lengths = np.einsum("mvd,mvd->mv", held, held)
    found = np.zeros((len(runs), len(runs)))

    def compare(first: int) -> None:
        last = min(first + BLOCK, len(runs))
        own = held[:, first:last].reshape(-1, held.shape[2])
        products = np.empty((len(held), len(own), last), dtype=np.float32)
        for word, others in enumerate(held[:, :last]):
            np.matmul(own, others.T, out=products[word])
        _some_with_those_before(products, lengths[:, first:last], lengths[:, :last], first, found)

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


@njit(cache=True, nogil=True, fastmath={"contract", "nsz"})
def _some_with_those_before(
    products: Float32Array, own: Float32Array, others: Float32Array, first: int, out: Float64Array
) -> None:
    """Kernel: `out` [v, v] gets how far each of b runs, from the `first` on, is from those before it.

    Loops over those before lie innermost, side by side in memory, so that they are compiled to wide instructions.

    Args:
        products: [m, m * b, v] of the words of all runs, first ones first, with those of the b runs in the same order.
        own, others: [m, b] and [m, v] squared lengths of these words.
    """
    length, size = own.shape
    two, rounding, zero, inf = np.float32(2), np.float32(_ROUNDING), np.float32(0), np.float32(np.inf)
    to_own, to_other = np.empty((length, others.shape[1]), np.float32), np.empty(others.shape[1], np.float32)
    for run in range(size):
        one = first + run
        total = np.zeros(one)
        to_own[:] = inf
        for j in range(length):
            to_other[:] = inf
            for i in range(length):
                row, nearest, size_of_own = products[j, i * size + run], to_own[i], own[i, run]
                for other in range(one):
                    lengths = size_of_own + others[j, other]
                    square = lengths - two * row[other]
                    square = square if square > rounding * lengths else zero
                    to_other[other] = square if square < to_other[other] else to_other[other]
                    nearest[other] = square if square < nearest[other] else nearest[other]
            for other in range(one):
                total[other] += np.sqrt(to_other[other])
        for i in range(length):
            for other in range(one):
                total[other] += np.sqrt(to_own[i, other])
        for other in range(one):
            out[one, other] = out[other, one] = total[other] / (2 * length)
