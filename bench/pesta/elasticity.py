"""Sizes of the dictionary (section 8.5.1, Table 6) on hdm05: precision, time a query, length of the repository.

The default dictionary, and k-means. Time is that of the 20 nearest clips of a whole clip, both
ways, on one thread: the mean over all clips of the set, of which the median of some rounds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from motionlake.evaluation.pesta.sizes import SIZES, query_milliseconds
from motionlake.pesta.autoencoder import AutoencoderRecipe
from motionlake.pesta.strings import Repository, SymbolDistances

from bench.pesta.dictionaries import Spec, Unit, fitted, strings_of
from bench.pesta.measuring import MAIN, STA3, whole_scores
from bench.pesta.sets import labels_of
from bench.pesta.whole import specs
from bench.units import Found

SET: Final = "hdm05"
ROUNDS: Final = 5
SCORES: Final = ("map", "p_at_5", "milliseconds", "symbols", "occupied")


def units(seeds: Sequence[int], recipe: AutoencoderRecipe | None) -> list[Unit]:
    chosen = {name: spec for name, spec in specs(recipe).items() if name in (MAIN, "k-means")}
    return [
        Unit(name, sized(spec, m).seeded(seed), seed) for name, spec in chosen.items() for m in SIZES for seed in seeds
    ]


def sized(spec: Spec, m: int) -> Spec:
    return replace(spec, config=replace(spec.config, m=m))


def measure(unit: Unit) -> dict[str, Found]:
    """Scores, time and length of one dictionary."""
    made, strings = fitted(SET, unit.spec), strings_of(SET, unit.spec)
    found = whole_scores(strings, made.distances, labels_of(SET), STA3)
    repository, ground = Repository.of([s.symbols for s in strings]), SymbolDistances.of(made.distances)
    found |= {
        "milliseconds": query_milliseconds(repository, ground, STA3, ROUNDS),
        "symbols": len(repository.symbols),
        "occupied": made.metrics["occupied"],
    }
    return {f"{unit.dictionary} m = {unit.spec.config.m}": found}
