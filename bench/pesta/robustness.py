"""Clips with pieces of other motions in them (section 8.4, Fig. 8) on hdm05: MAP by the share of replaced pieces.

Pieces are replaced as `motionlake.evaluation.pesta.robustness` says. The dictionary is trained on the set as it was
recorded, and frozen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from motionlake.evaluation.pesta.framed import Framed
from motionlake.evaluation.pesta.robustness import RATES, singular_clips
from motionlake.pesta.autoencoder import AutoencoderRecipe
from motionlake.pesta.config import AlignmentConfig
from motionlake.pesta.nearest import Both
from motionlake.pesta.symbols import SymbolString

from bench.canonical_sets import features
from bench.pesta.dictionaries import Spec, Unit, fitted, string
from bench.pesta.measuring import GAPS2, GAPS3, MAIN, STA2, STA3, whole_scores
from bench.pesta.sets import clips_of, labels_of
from bench.pesta.whole import DTW, SW, specs
from bench.units import Found

SET: Final = "hdm05"
DICTIONARIES: Final = (MAIN, "k-means", "SOM")
ALIGNMENTS: Final[dict[str, tuple[AlignmentConfig, Both]]] = {
    "STA w = 3": (STA3, "max"),
    "STA w = 2": (STA2, "max"),
    "STA w = 4": (AlignmentConfig("sta", 4), "max"),
    "STA w = 3, gaps": (GAPS3, "max"),
    "STA w = 2, gaps": (GAPS2, "max"),
    "DTW": (DTW, "max"),
    "SW": (SW, "max"),
    "SW, gap as dear as a match": (AlignmentConfig("sw", gap=SW.threshold), "max"),
    "STA w = 3, one way": (STA3, "query"),
    "STA w = 2, one way": (STA2, "query"),
    "STA w = 3, gaps, one way": (GAPS3, "query"),
    "DTW, one way": (DTW, "query"),
    "SW, one way": (SW, "query"),
}


def units(seeds: Sequence[int], recipe: AutoencoderRecipe | None) -> list[Unit]:
    chosen = {name: spec for name, spec in specs(recipe).items() if name in DICTIONARIES}
    return [Unit(name, spec.seeded(seed), seed) for name, spec in chosen.items() for seed in seeds]


def measure(unit: Unit) -> dict[str, Found]:
    """Every alignment at every rate; the seed draws pieces too."""
    made = fitted(SET, unit.spec)
    rows: dict[str, Found] = {}
    for rate in RATES:
        strings = replaced_strings(SET, unit.spec, rate, unit.seed)
        for name, (alignment, both) in ALIGNMENTS.items():
            found = whole_scores(strings, made.distances, labels_of(SET), alignment, both)
            rows[f"{unit.dictionary} + {name}, rate {rate:g}"] = found | {"symbols": sum(map(len, strings))}
    return rows


def replaced_strings(name: str, spec: Spec, rate: float, seed: int) -> list[SymbolString]:
    """Strings of the clips of a set with a share of their pieces replaced, by the dictionary of the set as it is."""
    made, config = fitted(name, spec), spec.config
    framed = [Framed(clip.positions, clip.rotations, clip.fps) for clip in clips_of(name)]
    replaced = singular_clips(framed, labels_of(name), rate, seed)
    clips = [
        replace(clip, positions=own.positions, rotations=own.rotations)
        for clip, own in zip(clips_of(name), replaced, strict=True)
    ]
    rows = features(clips, config.frames)
    return [string(made.encode(each), clip, config.fps) for each, clip in zip(rows, clips, strict=True)]


def fall(rows: dict[str, Found]) -> dict[str, dict[str, list[float]]]:
    """{method: {map: by rate, kept: MAP as a share of that at rate 0}}, for curves."""
    found: dict[str, dict[str, list[float]]] = {}
    for name, row in rows.items():
        method, _, rate = name.rpartition(", rate ")
        curve = found.setdefault(method, {"rate": [], "map": [], "kept": []})
        curve["rate"].append(float(rate))
        curve["map"].append(row["mean"]["map"])
        curve["kept"].append(row["mean"]["map"] / curve["map"][0])
    return found


def verdict(curves: dict[str, dict[str, list[float]]], dictionary: str = MAIN) -> str:
    """Which alignment keeps most of its MAP, at each rate above 0."""
    own = {name: curve for name, curve in curves.items() if name.startswith(f"{dictionary} + ")}
    rates = next(iter(own.values()))["rate"]
    lines = []
    for i, rate in list(enumerate(rates))[1:]:
        order = sorted(own, key=lambda name: -own[name]["kept"][i])
        shown = ", ".join(f"{name.partition(' + ')[2]} {own[name]['kept'][i]:.3f}" for name in order[:4])
        lines.append(f"  rate {rate:g} keeps most of its MAP: {shown}")
    return "\n".join(lines)
