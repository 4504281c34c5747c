"""Sub-queries of a long query beside fresh scans, and the reduction of tandem repeats beside a suffix array."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Final

import numpy as np
import pydivsufsort
from motionlake.arrays import Int32Array
from motionlake.pesta.long_query import LongQuery
from motionlake.pesta.matches import best_matches
from motionlake.pesta.strings import Repository, SymbolDistances
from motionlake.pesta.tandem import reduce_repeats

from bench.record import record, rounds_of

DICTIONARY: Final = 400
LONG: Final = 1_000_000
BARS: Final = {"long_query": 0.52, "tandem": 2.0}
SIZES: Final = (1_000, 10_000, 50_000, 200_000, 1_000_000)  # of a repository of a long query
ALPHABETS: Final = (50, 100, 200, 400, 800)


def main() -> None:
    rng = np.random.default_rng(0)
    distances = dictionary(rng)
    figures: dict[str, Any] = {"bars": BARS}
    figures["long_query"] = {f"Y={n}": long_query(rng, distances, n) for n in SIZES}
    figures["tandem"] = tandem(rng)
    for case, ratio in figures["long_query"].items():
        bar = BARS["long_query"]
        say(f"sub-queries {case}: {ratio['ratio']:.2f} of the time of fresh queries", ratio["ratio"] <= bar, bar)
        print(
            f"{'':21}{ratio['fresh_us']:.0f} us each; one by one {ratio['one_by_one']:.2f}, "
            f"all on two threads {ratio['two_threads']:.2f} of fresh ones on one"
        )
    for case, ratio in figures["tandem"].items():
        say(f"tandem {case}: {ratio:.2f} of suffix array + LCP", ratio <= BARS["tandem"], BARS["tandem"])
    print(record("strings", figures, packages=("pydivsufsort",)))


def say(text: str, met: bool, bar: float) -> None:
    print(f"{text} (bar {bar:g}: {'met' if met else 'MISSED'})")


def dictionary(rng: np.random.Generator) -> SymbolDistances:
    """Of `DICTIONARY` points in a space of eight dimensions."""
    points = rng.normal(size=(DICTIONARY, 8))
    return SymbolDistances(np.linalg.norm(points[:, None] - points[None], axis=2).astype(np.float32))


def long_query(rng: np.random.Generator, distances: SymbolDistances, symbols: int) -> dict[str, float]:
    """Windows of 12 symbols sliding by 4 over a query of 200: one `LongQuery` made anew, and fresh queries.

    Ratios are medians of those of calls that follow one another; of one thread by processor time, of two by the clock.
    """
    query = random_symbols(rng, 200)
    repository = Repository(random_symbols(rng, symbols), np.linspace(0, symbols, 5).astype(np.int64))
    windows = [(start, start + 12) for start in range(0, len(query) - 11, 4)]

    def shared(threads: int | None) -> None:
        session = LongQuery(query, repository, distances)
        if threads:
            session.align(windows, 10, threads=threads)
        for start, stop in windows:
            session.best_matches(start, stop, 10)

    def fresh() -> None:
        for start, stop in windows:
            best_matches(query[start:stop], repository, distances, 10)

    calls = {"fresh": fresh, "shared": lambda: shared(1), "one_by_one": lambda: shared(None)}
    rounds = 15 if symbols < LONG else 7
    seconds = rounds_of(calls, rounds, time.process_time)
    clock = rounds_of({"fresh": fresh, "two_threads": lambda: shared(2)}, rounds)
    return {
        "ratio": ratio_of(seconds, "shared", "fresh"),
        "one_by_one": ratio_of(seconds, "one_by_one", "fresh"),
        "two_threads": ratio_of(clock, "two_threads", "fresh"),
        "fresh_us": float(np.median(seconds["fresh"])) / len(windows) * 1e6,
    }


def tandem(rng: np.random.Generator) -> dict[str, float]:
    """Time of the reduction of a million symbols, as a share of suffix array + LCP of the same string.

    Medians of the ratios of calls that follow one another, by processor time.
    """
    ratios = {}
    for m in ALPHABETS:
        for name, string in (("random", random_symbols(rng, LONG, m)), ("repeats", repetitive(rng, LONG, m))):

            def both(text: Int32Array = string) -> None:
                pydivsufsort.kasai(text, pydivsufsort.divsufsort(text))

            calls: dict[str, Callable[[], object]] = {"ours": partial(reduce_repeats, string), "both": both}
            ratios[f"m={m} {name}"] = ratio_of(rounds_of(calls, 5, time.process_time), "ours", "both")
    return ratios


def ratio_of(seconds: Mapping[str, Sequence[float]], one: str, other: str) -> float:
    """Median of the ratios of two functions' rounds."""
    return float(np.median(np.divide(seconds[one], seconds[other])))


def repetitive(rng: np.random.Generator, length: int, m: int) -> Int32Array:
    """Cycles of 2 to 20 symbols, each repeated 1 to 8 times."""
    pieces: list[Int32Array] = []
    total = 0
    while total < length:
        pieces.append(np.tile(random_symbols(rng, int(rng.integers(2, 21)), m), int(rng.integers(1, 9))))
        total += len(pieces[-1])
    return np.concatenate(pieces)[:length]


def random_symbols(rng: np.random.Generator, length: int, m: int = DICTIONARY) -> Int32Array:
    """[length] of m symbols, no two neighbours equal."""
    steps = rng.integers(1, m, length)
    return (np.cumsum(steps) % m).astype(np.int32)


if __name__ == "__main__":
    main()
