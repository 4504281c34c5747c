"""Whole-sequence retrieval (section 8.3.1, Table 5): dictionaries by alignments, DTW on frames and signatures beside.

Dictionaries are trained on the set itself without labels; "neural gas" is the default. "of features" rows have their
clusters in the space of the features, with hard heads. "information" is the autoencoder whose classes mutual
information shapes. "pretrained" is the dictionary that comes with the package, trained on CMU sets alone.
Costs are the greater of both ways, each for every symbol of its query; "one way" is the paper's own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from motionlake.pesta.autoencoder import AutoencoderRecipe
from motionlake.pesta.config import AlignmentConfig, SymbolsConfig
from motionlake.pesta.nearest import Both

from bench.canonical_sets import features
from bench.pesta.dictionaries import OWN, Spec, fitted, pretrained, strings_of
from bench.pesta.measuring import GAPS2, GAPS3, MAIN, STA2, STA3, score_distances, whole_scores
from bench.pesta.sets import clips_of, labels_of
from bench.units import Found

SETS: Final = ("hdm05", "bandai1")
MORE_SETS: Final = ("hdm05", "bandai1", "salsa", "utd_mhad")
REFERENCES: Final = "references"
READY: Final = "pretrained"
SCORES: Final = ("map", "p_at_2", "p_at_5", "p_at_10", "p_at_15", "p_at_20", "nn")
FULL, RUNS = SymbolsConfig(), SymbolsConfig(repeats=False)
DTW, SW = AlignmentConfig("dtw"), AlignmentConfig("sw")
ALIGNMENTS: Final[dict[str, tuple[AlignmentConfig, Both, SymbolsConfig]]] = {
    "STA w = 3": (STA3, "max", FULL),
    "STA w = 2": (STA2, "max", FULL),
    "STA w = 3, gaps": (GAPS3, "max", FULL),
    "STA w = 2, gaps": (GAPS2, "max", FULL),
    "DTW": (DTW, "max", FULL),
    "SW": (SW, "max", FULL),
    "STA w = 3, one way": (STA3, "query", FULL),
    "STA w = 2, one way": (STA2, "query", FULL),
    "STA w = 3, gaps, one way": (GAPS3, "query", FULL),
    "DTW, one way": (DTW, "query", FULL),
    "SW, one way": (SW, "query", FULL),
    "STA w = 3, repeats kept": (STA3, "max", RUNS),
    "STA w = 2, repeats kept": (STA2, "max", RUNS),
    "DTW, repeats kept": (DTW, "max", RUNS),
}


@dataclass(frozen=True)
class Unit:
    """One dictionary of one set; `REFERENCES` for methods without one."""

    set_name: str
    dictionary: str
    spec: Spec
    seed: int

    def __str__(self) -> str:
        return f"{self.set_name}, {self.dictionary}, seed {self.seed}"


def specs(recipe: AutoencoderRecipe | None) -> dict[str, Spec]:
    """The dictionaries that are compared, by name; the recipe is that of the autoencoder, if not its own."""
    som = replace(OWN, dictionary="som")
    return {
        MAIN: Spec(OWN),
        "k-means": Spec(replace(OWN, dictionary="kmeans")),
        "k-means of features": Spec(replace(OWN, dictionary="kmeans", whitened=False, softness=0.0)),
        "SOM": Spec(som),
        "SOM of features": Spec(replace(som, whitened=False)),
        "information": Spec(replace(OWN, dictionary="information"), recipe),
    }


def units(sets: Sequence[str], seeds: Sequence[int], recipe: AutoencoderRecipe | None) -> list[Unit]:
    chosen = specs(recipe)
    made = [Unit(s, name, spec.seeded(seed), seed) for s in sets for name, spec in chosen.items() for seed in seeds]
    if ready := pretrained():
        made += [Unit(s, READY, ready, 0) for s in sets]
    return made + [Unit(s, REFERENCES, Spec().seeded(seed), seed) for s in sets for seed in seeds]


def measure(unit: Unit) -> dict[str, Found]:
    """Every alignment of one dictionary."""
    if unit.dictionary == REFERENCES:
        return references(unit.set_name, unit.seed)
    made, labels = fitted(unit.set_name, unit.spec), labels_of(unit.set_name)
    rows = {}
    for name, (config, both, reduced) in ALIGNMENTS.items():
        strings = strings_of(unit.set_name, unit.spec, reduced)
        rows[f"{unit.dictionary} + {name}"] = whole_scores(strings, made.distances, labels, config, both) | {
            "symbols": sum(map(len, strings)),
            "occupied": made.metrics["occupied"],
        }
    return rows


def references(set_name: str, seed: int) -> dict[str, Found]:
    """Signatures of learned words, and whole-clip DTW on frames (seed 0 alone: it has none)."""
    from motionlake.deep_motifs.emd import emd_matrix
    from motionlake.deep_motifs.signatures import signatures
    from motionlake.evaluation.dtw import BASELINE
    from motionlake.motion.dtw import dtw_matrix
    from motionlake.motion.features import WordConfig

    from bench.representation import K, by_l2, learned

    clips, labels = clips_of(set_name), labels_of(set_name)
    grouped = by_l2(learned)(features(clips, WordConfig()), WordConfig(), K, seed)
    made, _ = signatures(grouped.clips, len(grouped.ground))
    rows = {"signatures": score_distances(emd_matrix(made, grouped.ground), labels)}
    if seed == 0:
        rows["whole-clip DTW on frames"] = score_distances(dtw_matrix(features(clips, BASELINE)), labels)
    return rows
