"""Strided temporal alignment beside librosa.

librosa.sequence.dtw with the window of section 6 as its steps, each weighted by its number of steps, computes the same
matrix; it is given the symbol distances of query and string precomputed, which our times include.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Final

import librosa
import numpy as np
from motionlake.pesta.config import AlignmentConfig
from motionlake.pesta.matches import best_matches
from motionlake.pesta.nearest import symmetric_costs
from motionlake.pesta.scan import best_per_clip, end_costs
from motionlake.pesta.strings import Repository, SymbolDistances
from numpy.typing import NDArray

from bench.record import interleave, record
from bench.strings import LONG, dictionary, random_symbols, say

ONE_STRING_CELLS: Final = 3_200_000
CLIPS: Final = 3_000
BARS: Final = {"one_string X=8": 8.0, "one_string X=64": 15.0, "clips": 40.0}


def main() -> None:
    rng = np.random.default_rng(0)
    distances = dictionary(rng)
    figures: dict[str, Any] = {"bars": BARS}
    figures["one_string"] = {
        f"X={rows} w={stride}": one_string(rng, distances, rows, stride) for rows in (8, 64) for stride in (2, 3)
    }
    figures["clips"] = {
        f"X={rows} w={stride}": many_clips(rng, distances, rows, stride) for rows in (8, 64) for stride in (2, 3)
    }
    figures["million"] = {f"X=8 w={stride}": million(rng, distances, stride) for stride in (2, 3)}
    figures["symmetric_seconds"] = symmetric(rng, distances)
    for name in ("one_string", "clips"):
        for case, row in figures[name].items():
            bar = BARS.get(name) or BARS[f"{name} {case.split()[0]}"]
            say(f"{name:10} {case:9} {row['ratio']:6.1f} times librosa", row["ratio"] >= bar, bar)
            print(
                f"{'':21}{row['cells_per_second'] / 1e6:6.0f} M cells/s; "
                f"two threads {row['ratio_two_threads']:.1f} times"
            )
    for case, row in figures["million"].items():
        print(
            f"Y = 1e6 {case}: end costs {row['end_costs'] * 1e3:.1f} ms, ten best matches {row['matches'] * 1e3:.1f} ms"
        )
    print(f"287 strings with one another: {figures['symmetric_seconds'] * 1e3:.1f} ms")
    print(record("align", figures, packages=("librosa",)))


def librosa_ends(costs: NDArray[np.float64], stride: int) -> NDArray[np.float64]:
    """[Y] last row of the weight matrix of section 6; costs [X, Y]."""
    steps = np.array([(m, n) for m in range(stride + 1) for n in range(stride + 1) if m or n])
    matrix = librosa.sequence.dtw(
        C=costs,
        step_sizes_sigma=steps,
        weights_add=np.zeros(len(steps)),
        weights_mul=steps.max(axis=1).astype(np.float64),
        subseq=True,
        backtrack=False,
    )
    return np.asarray(matrix[-1])


def one_string(rng: np.random.Generator, distances: SymbolDistances, rows: int, stride: int) -> dict[str, float]:
    """End costs of one query against one string, of 3.2 million cells."""
    query, string = random_symbols(rng, rows), random_symbols(rng, ONE_STRING_CELLS // rows)
    costs = distances.matrix[np.ix_(query, string)].astype(np.float64)
    repository, config = Repository.of([string]), AlignmentConfig(stride=stride)
    assert np.allclose(end_costs(query, repository, distances, config), librosa_ends(costs, stride), rtol=1e-5)
    return compared(
        lambda threads: end_costs(query, repository, distances, config, threads=threads),
        lambda: librosa_ends(costs, stride),
        costs.size,
    )


def many_clips(rng: np.random.Generator, distances: SymbolDistances, rows: int, stride: int) -> dict[str, float]:
    """Least end cost of one query in each of 3,000 clips of 5 to 60 symbols; librosa clip by clip."""
    query = random_symbols(rng, rows)
    strings = [random_symbols(rng, n) for n in rng.integers(5, 61, CLIPS)]
    costs = [distances.matrix[np.ix_(query, string)].astype(np.float64) for string in strings]
    repository, config = Repository.of(strings), AlignmentConfig(stride=stride)
    theirs = [librosa_ends(cost, stride).min() for cost in costs]
    assert np.allclose(best_per_clip(query, repository, distances, config), theirs, rtol=1e-5)
    return compared(
        lambda threads: best_per_clip(query, repository, distances, config, threads=threads),
        lambda: [librosa_ends(cost, stride).min() for cost in costs],
        sum(cost.size for cost in costs),
    )


def compared(ours: Callable[[int], object], theirs: Callable[[], object], cells: int) -> dict[str, float]:
    seconds = interleave({"ours": lambda: ours(1), "two": lambda: ours(2), "librosa": theirs}, rounds=5)
    return {
        "cells": cells,
        "cells_per_second": cells / seconds["ours"],
        "librosa_cells_per_second": cells / seconds["librosa"],
        "ratio": seconds["librosa"] / seconds["ours"],
        "ratio_two_threads": seconds["librosa"] / seconds["two"],
    }


def million(rng: np.random.Generator, distances: SymbolDistances, stride: int) -> dict[str, float]:
    """Seconds for 8 symbols against one string of a million."""
    query, repository = random_symbols(rng, 8), Repository.of([random_symbols(rng, LONG)])
    config = AlignmentConfig(stride=stride)
    return interleave(
        {
            "end_costs": lambda: end_costs(query, repository, distances, config),
            "matches": lambda: best_matches(query, repository, distances, 10, config),
        },
        rounds=9,
    )


def symmetric(rng: np.random.Generator, distances: SymbolDistances) -> float:
    """Seconds to align 287 strings of 12 symbols on average with one another, as many as hdm05 has."""
    strings = [random_symbols(rng, n) for n in rng.integers(3, 22, 287)]
    config = AlignmentConfig(stride=3)
    return interleave({"all": lambda: symmetric_costs(strings, distances, config)})["all"]


if __name__ == "__main__":
    started = time.perf_counter()
    main()
    print(f"{time.perf_counter() - started:.0f} s")
