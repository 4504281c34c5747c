"""What each choice does: hdm05 and bandai1, seed 0, whole clips by STA (w = 3, both ways) but where a row says else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from motionlake.pesta.autoencoder import AutoencoderRecipe
from motionlake.pesta.config import AlignmentConfig, SymbolsConfig
from motionlake.pesta.nearest import Both

from bench.pesta.dictionaries import OWN, Spec, fitted, strings_of
from bench.pesta.measuring import STA3, whole_scores
from bench.pesta.sets import labels_of
from bench.units import Found

SETS: Final = ("hdm05", "bandai1")
DEFAULT: Final = "default"
INFORMATION: Final = "information"
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


def variants(recipe: AutoencoderRecipe | None) -> dict[str, Spec]:
    """Dictionaries that differ from the default, or from the autoencoder, in one thing, by name."""
    main, base = Spec(OWN), recipe or AutoencoderRecipe()

    def coding(**changes: object) -> Spec:
        return replace(main, config=replace(OWN, **changes))  # type: ignore[arg-type]

    def trained(**changes: object) -> Spec:
        return Spec(replace(OWN, dictionary="information"), replace(base, **changes))  # type: ignore[arg-type]

    made = {DEFAULT: main}
    made |= {f"m {m}": coding(m=m) for m in (50, 200, 800)}
    made |= {f"softness {value:g}": coding(softness=value) for value in (0.0, 0.5, 1.5, 2.0)}
    made |= {"of features": coding(whitened=False)}
    made |= {
        f"root {root:g}, velocities {joints:g}": coding(root_weight=root, velocity_weight=joints)
        for root, joints in ((0.0, 0.0), (5.0, 4.0), (10.0, 0.0), (0.0, 8.0), (20.0, 16.0))
    }
    made |= {f"smoothing {value:g}": coding(smoothing=value) for value in (0.0, 2.0)}
    still = {"root_weight": 0.0, "velocity_weight": 0.0, "smoothing": 0.0}
    made["rotations (the paper's)"] = coding(representation="rotations", **still)
    made[INFORMATION] = trained()
    made |= {f"{INFORMATION}, weight {weight:g}": trained(class_weight=weight) for weight in (0.1, 1.0)}
    made |= {f"{INFORMATION}, sharpness {share:g}": trained(sharpness=share) for share in (0.1, 1.0)}
    made |= {f"{INFORMATION}, style weight {weight:g}": trained(style_weight=weight) for weight in (0.0, 1.0)}
    made |= {f"{INFORMATION}, n = {size}": trained(style=size) for size in (8, 64)}
    made[f"{INFORMATION}, not from heads"] = trained(from_head=0.0)
    return made


def units(sets: Sequence[str], recipe: AutoencoderRecipe | None) -> list[Unit]:
    """Autoencoders, which take longest, on the first set alone."""
    made = variants(recipe).items()
    return [Unit(s, name, spec) for name, spec in made for s in (sets[:1] if INFORMATION in name else sets)]


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
