"""A lower bound of what it costs to find a string in a query, by its symbols alone (section 6).

Every symbol of the string is reached or strided over by a step that costs at least the distance of the symbol where
the step ends from some symbol of the query, for each symbol that it passes. So each costs no less than the least such
distance of itself and of the few behind it in which a step that passes it may end.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Int32Array, Int64Array
from motionlake.kernels import njit
from motionlake.pesta.config import DEFAULT_ALIGNMENT, AlignmentConfig
from motionlake.pesta.strings import Distances, Repository, checked
from motionlake.pesta.thread_work import useful_threads
from motionlake.threads import in_threads
from numpy.typing import ArrayLike

SURE: Final = np.float32(1 - 1e-4)  # sums of single precision are rounded


def bounds_of_strings(
    query: ArrayLike,
    repository: Repository,
    distances: Distances,
    config: AlignmentConfig = DEFAULT_ALIGNMENT,
    *,
    threads: int = 1,
) -> Float32Array:
    """[n] no more than the cost of each string in the query, for each symbol of the string; infinite where it is empty.

    Arguments and errors as in `scan.end_costs`. Nothing is known of Smith-Waterman: there it is minus infinity.
    """
    symbols, ground = checked(query, repository, distances)
    if config.local:
        return np.full(len(repository), -np.inf, dtype=np.float32)
    near = ground.matrix[:, np.unique(symbols)].min(axis=1)
    if config.gaps:  # a symbol may be left out instead
        near = np.minimum(near, ground.scores(config)[0])
    found = np.empty(len(repository), dtype=np.float32)
    threads = useful_threads(threads, 4 * len(repository.symbols))
    goals = np.linspace(0, len(repository.symbols), threads + 1)[1:-1]
    edges = [0, *np.searchsorted(repository.offsets, goals).tolist(), len(found)]

    def work(part: tuple[int, int]) -> None:
        _bounds(near, repository.symbols, repository.offsets, config.reach, *part, found)

    in_threads(work, list(pairwise(edges)), threads)
    return found


@njit(cache=True, nogil=True)
def _bounds(
    near: Float32Array, symbols: Int32Array, offsets: Int64Array, reach: int, first: int, last: int, found: Float32Array
) -> None:
    """Kernel, for strings [first, last): means of the least of `near` [m] over each symbol and the next `reach` - 1."""
    for string in range(first, last):
        begin, end = offsets[string], offsets[string + 1]
        total = np.float32(0)
        if reach == 2 and end > begin:  # the default, in a quarter of the time
            now = near[symbols[begin]]
            for at in range(begin + 1, end):
                then = near[symbols[at]]
                total += min(now, then)
                now = then
            total += now
        elif reach != 2:
            for at in range(begin, end):
                least = near[symbols[at]]
                for other in range(at + 1, min(at + reach, end)):
                    least = min(least, near[symbols[other]])
                total += least
        found[string] = total / np.float32(end - begin) * SURE if end > begin else np.inf
