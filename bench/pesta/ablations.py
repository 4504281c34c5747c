"""What each choice does: hdm05 and bandai1, seed 0, whole clips by STA (w = 3, both ways) but where a row says else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from motionlake.pesta.config import AlignmentConfig, SymbolsConfig
from motionlake.pesta.dictionary import AutoencoderRecipe
from motionlake.pesta.scan import Both

from bench.pesta.dictionaries import Spec, fitted, strings_of
from bench.pesta.measuring import STA3, whole_scores
from bench.pesta.sets import labels_of
from bench.units import Found

SETS: Final = ("hdm05", "bandai1")
DEFAULT: Final = "default"
REDUCTIONS: Final = {
    "repeats kept": SymbolsConfig(repeats=False),
    "runs kept": SymbolsConfig(runs=False),
    "runs and repeats kept": SymbolsConfig(runs=False, repeats=False),
}


@dataclass(frozen=True)
class Unit:
    """One dictionary of one set; the default one has rows for the ways to align as well."""

    set_name: str
    variant: str
    spec: Spec

    def __str__(self) -> str:
        return f"{self.set_name}, {self.variant}"


def variants(aae: Spec) -> dict[str, Spec]:
    """Dictionaries that differ from the default in one thing, by name."""
    recipe = aae.recipe or AutoencoderRecipe()
    aae = replace(aae, recipe=recipe)

    def trained(**changes: object) -> Spec:
        return replace(aae, recipe=replace(recipe, **changes))  # type: ignore[arg-type]

    def coding(**changes: object) -> Spec:
        return replace(aae, config=replace(aae.config, **changes))  # type: ignore[arg-type]

    made = {DEFAULT: aae}
    made |= {f"style {size}": trained(style=size) for size in (12, 24, 40)}
    made |= {"linear heads": trained(heads="linear")}
    made |= {f"adversarial {weight:g}": trained(adversarial=weight) for weight in (0.0, 0.1, 1.0)}
    made |= {f"from head {weight:g}": trained(from_head=weight) for weight in (0.0, 1.0)}
    made |= {f"softness {value:g}": trained(softness=value) for value in (0.1, 0.5, 1.0, 2.0)}
    made |= {f"hidden {units}": trained(hidden=units) for units in (256, 1000)}
    made |= {f"steps {steps}": trained(steps=steps) for steps in (150, 400, 1000)}
    made["steps 0"] = trained(steps=0, epochs=0)
    made |= {f"whitening {value:g}": trained(whitening=value) for value in (0.0, 0.25)}
    made |= {f"neighbours {count}": trained(neighbours=count) for count in (0, 5)}
    made |= {
        f"root {root:g}, velocities {joints:g}": coding(root_weight=root, velocity_weight=joints)
        for root, joints in ((0.0, 0.0), (5.0, 4.0), (10.0, 0.0), (0.0, 8.0), (10.0, 8.0), (20.0, 16.0))
    }
    made |= {f"smoothing {value:g}": coding(smoothing=value) for value in (0.0, 1.0, 2.0)}
    still = {"root_weight": 0.0, "velocity_weight": 0.0, "smoothing": 0.0}
    made["rotations (the paper's)"] = coding(representation="rotations", **still)
    made["rotations, linear heads"] = replace(trained(heads="linear"), config=made["rotations (the paper's)"].config)
    return {name: spec for name, spec in made.items() if name == DEFAULT or spec != aae}


def units(sets: Sequence[str], aae: Spec) -> list[Unit]:
    return [Unit(s, name, spec.seeded(0)) for name, spec in variants(aae).items() for s in sets]


def measure(unit: Unit) -> dict[str, Found]:
    """The rows of one dictionary."""
    made, labels = fitted(unit.set_name, unit.spec), labels_of(unit.set_name)

    def row(config: AlignmentConfig, both: Both, reduced: SymbolsConfig | None) -> Found:
        strings = strings_of(unit.set_name, unit.spec, reduced)
        return whole_scores(strings, made.distances, labels, config, both) | {
            "symbols": sum(map(len, strings)),
            "occupied": made.metrics["occupied"],
        }

    rows = {unit.variant: row(STA3, "max", None)}
    if unit.variant == DEFAULT:
        rows |= {f"w = {w}": row(AlignmentConfig("sta", w), "max", None) for w in (1, 2, 3, 4)}
        rows |= {f"both = {both}": row(STA3, both, None) for both in ("max", "mean", "query")}
        rows |= {name: row(STA3, "max", reduced) for name, reduced in REDUCTIONS.items()}
    return rows
