"""Sizes of the dictionary (section 8.5.1, Table 6) on hdm05: precision, time a query, length of the repository.

K-means for every m; the autoencoder for some, seed 0 alone. Time is that of the 20 nearest clips of a whole clip, both
ways, on one thread: the mean over all clips of the set, of which the median of some rounds.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from motionlake.pesta.scan import nearest_strings
from motionlake.pesta.strings import Repository, SymbolDistances

from bench.pesta.dictionaries import OWN, Spec, Unit, fitted, strings_of
from bench.pesta.measuring import STA3, whole_scores
from bench.pesta.sets import labels_of
from bench.units import Found

SET: Final = "hdm05"
SIZES: Final = (50, 100, 200, 300, 400, 500, 600, 700, 800)
SIZES_OF_AAE: Final = (50, 200, 400, 800)
ROUNDS: Final = 5
SCORES: Final = ("map", "p_at_5", "milliseconds", "symbols", "occupied")


def units(seeds: Sequence[int], aae: Spec) -> list[Unit]:
    kmeans = Spec(replace(OWN, dictionary="kmeans"))
    made = [Unit("k-means", sized(kmeans, m).seeded(seed), seed) for m in SIZES for seed in seeds]
    return made + [Unit("AAE", sized(aae, m).seeded(0), 0) for m in SIZES_OF_AAE]


def sized(spec: Spec, m: int) -> Spec:
    return replace(spec, config=replace(spec.config, m=m))


def measure(unit: Unit) -> dict[str, Found]:
    """Scores, time and length of one dictionary."""
    made, strings = fitted(SET, unit.spec), strings_of(SET, unit.spec)
    found = whole_scores(strings, made.distances, labels_of(SET), STA3)
    repository, ground = Repository.of([s.symbols for s in strings]), SymbolDistances.of(made.distances)
    seconds = []
    for _ in range(1 + ROUNDS):
        start = time.perf_counter()
        for clip in range(len(repository)):
            nearest_strings(repository.string(clip), repository, ground, 20, STA3, without=clip)
        seconds.append(time.perf_counter() - start)
    found |= {
        "milliseconds": 1e3 * statistics.median(seconds[1:]) / len(repository),
        "symbols": len(repository.symbols),
        "occupied": made.metrics["occupied"],
    }
    return {f"{unit.dictionary} m = {unit.spec.config.m}": found}
