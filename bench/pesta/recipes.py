"""Every recipe of a dictionary beside the others, at three sizes, on four sets: which one is the default?

Autoencoders have seed 0 alone.

- `occupied`, `perplexity`: symbols in use, of the set's own postures; `scatter`: the share of the variance of these
  that lies within symbols.
- `sta`: mean average precision of whole clips by strided alignment (w = 3, both ways); `bags`: of the shares of
  the symbols in a clip, compared by the overlap of their square roots (Hellinger).
- `seconds`: of a processor, that training took, on one thread; `steps` of an autoencoder, and of each validation
  the step, the loss and the symbols in use (`curve`).

The paper's recipe ("adversarial") is trained for `PAPER_STEPS` steps in the place of 5,000 epochs. It is cut short for
want of time, not for what it finds: its symbols fall together from the first steps on.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from motionlake.pesta.autoencoder import AutoencoderRecipe
from motionlake.pesta.config import CLUSTERED
from motionlake.pesta.occupancy import scatter, use_of
from scipy.spatial.distance import cdist

from bench.pesta.dictionaries import OWN, Spec, codes_of, fitted, strings_of
from bench.pesta.elasticity import sized
from bench.pesta.measuring import MAIN, STA3, score_distances, whole_scores
from bench.pesta.sets import labels_of, postures_of
from bench.units import Found

SETS: Final = ("hdm05", "salsa", "bandai1", "utd_mhad")
SIZES: Final = (400, 100, 25)
PAPER_STEPS: Final = 200
MEASURES: Final = ("sta", "bags")
SCORES: Final = (*MEASURES, "occupied", "perplexity", "scatter", "seconds", "symbols")


@dataclass(frozen=True)
class Unit:
    """One recipe at one size on one set."""

    set_name: str
    recipe: str
    spec: Spec
    seed: int

    def __str__(self) -> str:
        return f"{self.set_name}, {self.recipe}, m = {self.spec.config.m}, seed {self.seed}"


def recipes(shrunk: AutoencoderRecipe | None) -> dict[str, Spec]:
    """By name; `shrunk` in the place of the autoencoders' recipes, to try the bench itself."""
    paper = replace(AutoencoderRecipe.pesta(), epochs=0, steps=PAPER_STEPS, every=20)
    if shrunk:
        paper = replace(paper, hidden=shrunk.hidden, steps=shrunk.steps)
    centroids = replace(OWN, dictionary="kmeans")
    return {
        MAIN: Spec(OWN),
        "neural gas, softness 2": Spec(replace(OWN, softness=2.0)),
        "k-means": Spec(centroids),
        "k-means, hard": Spec(replace(centroids, softness=0.0)),
        "k-means of features": Spec(replace(centroids, whitened=False, softness=0.0)),
        "self-organising map": Spec(replace(OWN, dictionary="som")),
        "information": Spec(replace(OWN, dictionary="information"), shrunk),
        "adversarial": Spec(replace(OWN, dictionary="adversarial"), paper),
    }


def units(seeds: Sequence[int], shrunk: AutoencoderRecipe | None) -> list[Unit]:
    return [
        Unit(s, name, sized(spec, m).seeded(seed), seed)
        for m in SIZES
        for name, spec in recipes(shrunk).items()
        for s in SETS
        for seed in (seeds if spec.config.dictionary in CLUSTERED else seeds[:1])
    ]


def measure(unit: Unit) -> dict[str, Found]:
    """The row of one dictionary."""
    postures = np.concatenate(postures_of(unit.set_name, unit.spec.config.frames))
    start = time.process_time()
    made = fitted(unit.set_name, unit.spec)
    seconds = time.process_time() - start
    codes, labels, m = codes_of(unit.set_name, unit.spec), labels_of(unit.set_name), made.m
    symbols, strings = np.concatenate(codes), strings_of(unit.set_name, unit.spec)
    use = use_of(symbols, m)
    found = {
        "sta": whole_scores(strings, made.distances, labels, STA3)["map"],
        "bags": score_distances(bag_distances(codes, m), labels)["map"],
        "occupied": use["occupied"],
        "perplexity": use["perplexity"],
        "scatter": scatter(postures, symbols, m),
        "seconds": seconds,
        "symbols": sum(map(len, strings)),
    }
    found |= {key: made.metrics[key] for key in ("steps", "curve", "validation_error") if key in made.metrics}
    return {f"{unit.recipe}, m = {m}": found}


def bag_distances(codes: Sequence[np.ndarray], m: int) -> np.ndarray:
    """[n, n] Hellinger distances of the shares of m symbols in clips [T]."""
    shares = np.stack([np.bincount(own, minlength=m) / len(own) for own in codes])
    return np.asarray(cdist(np.sqrt(shares), np.sqrt(shares)))


def chosen(rows: Mapping[str, Mapping[str, Mapping[str, Found]]]) -> dict[str, dict[str, dict[str, Any]]]:
    """{measure: {set: what the other sets choose by the mean of it, and what that has on the set itself}}.

    "both" is the mean of alignment and bags.

    Args:
        rows: {set: {row: {mean: scores}}}, of the same rows in every set.
    """
    found: dict[str, dict[str, dict[str, Any]]] = {}
    for measure in (*MEASURES, "both"):
        counted = MEASURES if measure == "both" else (measure,)
        of = {
            name: {row: float(np.mean([each["mean"][one] for one in counted])) for row, each in own.items()}
            for name, own in rows.items()
        }
        for name in of:
            others = [other for other in of if other != name] or [name]
            means = {row: float(np.mean([of[other][row] for other in others])) for row in of[name]}
            best = max(means, key=lambda row: means[row])
            found.setdefault(measure, {})[name] = {
                "chosen": best, "of_others": means[best], "here": of[name][best],
                "best_here": max(of[name], key=lambda row: of[name][row]),
            }  # fmt: skip
    return found


def verdict(found: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> str:
    """What is chosen with each set left out, a line each."""
    return "\n".join(
        f"  {measure}, {name} left out: {row['chosen']} ({row['of_others']:.3f} on the others) has {row['here']:.3f}, "
        f"the best there is {row['best_here']}"
        for measure, by_set in found.items()
        for name, row in by_set.items()
    )
