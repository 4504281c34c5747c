"""How far chance moves Table 4, and what might raise it: the default dictionary of many seeds, and variants of it.

"default" is measured with `DRAWS` times as many seeds as the variants, since training begins anew with each: two
dictionaries of one kind differ by as much as two kinds. A variant has one thing other than the default. Whole clips of
other sets are beside cmu_exercises (MAP of strided alignment, w of the variant, greater of both ways), for what is
chosen is chosen on those.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from motionlake.evaluation.pesta.measuring import Take
from motionlake.evaluation.pesta.sub_queries import fresh_search, long_questions, score_sub_queries
from motionlake.pesta.config import AlignmentConfig, PosturesConfig

from bench.pesta.dictionaries import OWN, Spec, fitted, strings_of
from bench.pesta.measuring import GAPS2, STA2, STA3, whole_scores
from bench.pesta.sets import labels_of, segments_of
from bench.units import Found

TAKES: Final = "cmu_exercises"
OTHERS: Final = ("hdm05", "salsa", "bandai1")
SETS: Final = (TAKES, *OTHERS)
DEFAULT: Final = "default"
DRAWS: Final = 4
SCORES: Final = ("p_at_2", "p_at_5", "p_at_10", "all_p_at_2", "all_p_at_5", "all_p_at_10")


@dataclass(frozen=True)
class Variant:
    """What one row has in the place of the default; distances of symbols are taken to a power."""

    postures: PosturesConfig = OWN
    alignment: AlignmentConfig = STA2
    power: float = 1.0


VARIANTS: Final[Mapping[str, Variant]] = {
    DEFAULT: Variant(),
    "m = 300": Variant(replace(OWN, m=300)),
    "m = 600": Variant(replace(OWN, m=600)),
    "hard heads": Variant(replace(OWN, softness=0.0)),
    "softness 1": Variant(replace(OWN, softness=1.0)),
    "softness 2": Variant(replace(OWN, softness=2.0)),
    "of features": Variant(replace(OWN, whitened=False)),
    "w = 1": Variant(alignment=AlignmentConfig("sta", 1)),
    "w = 3": Variant(alignment=STA3),
    "gaps": Variant(alignment=GAPS2),
    "roots of distances": Variant(power=0.5),
    "squares of distances": Variant(power=2.0),
}


@dataclass(frozen=True)
class Unit:
    """One row on one set."""

    set_name: str
    variant: str
    seed: int

    def __str__(self) -> str:
        return f"{self.set_name}, {self.variant}, seed {self.seed}"


def units(seeds: Sequence[int]) -> list[Unit]:
    more = range(len(seeds), DRAWS * len(seeds))
    made = [Unit(s, name, seed) for s in SETS for name in VARIANTS for seed in seeds]
    return made + [Unit(TAKES, DEFAULT, seed) for seed in more]


def measure(unit: Unit) -> dict[str, Found]:
    """Scores of one dictionary; of takes those of their sub-queries."""
    variant = VARIANTS[unit.variant]
    spec = Spec(variant.postures).seeded(unit.seed)
    strings, distances = strings_of(unit.set_name, spec), fitted(unit.set_name, spec).distances ** variant.power
    if unit.set_name != TAKES:
        return {unit.variant: whole_scores(strings, distances, labels_of(unit.set_name), variant.alignment)}
    takes = [Take(s, segments) for s, segments in zip(strings, segments_of(TAKES), strict=True)]
    found = score_sub_queries(long_questions(takes), distances, variant.alignment, fresh_search)
    return {unit.variant: found | {"symbols": sum(len(take.string) for take in takes)}}


def spread(row: Found) -> dict[str, Found]:
    """By score: how many draws, their mean, standard deviation, least and greatest."""
    found = {}
    for score in SCORES:
        values = [run[score] for run in row["seeds"].values()]
        found[score] = {
            "draws": len(values),
            "mean": float(np.mean(values)),
            "deviation": float(np.std(values, ddof=1)) if len(values) > 1 else 0.0,
            "least": min(values),
            "greatest": max(values),
        }
    return found
