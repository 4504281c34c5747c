"""What the thesis leaves open and what we change, by cross-validation: each training subject is left out in turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.deephums.config import DescriptorsConfig
from motionlake.deephums.recipes import PRETRAINED, DescriptorRecipe, recipe_of
from motionlake.deephums.training import train_descriptor
from motionlake.evaluation.ranking import Questions, score_split

from bench.deephums.retrieval import euclidean, training_clips
from bench.deephums.sets import Split, split_of
from bench.units import Found, in_processes, table, with_seeds

SET: Final = "utd_mhad"
DEFAULT: Final = recipe_of(DescriptorsConfig())
WITHOUT: Final = recipe_of(DescriptorsConfig(), labels=False)
THESIS: Final = recipe_of(DescriptorsConfig(recipe="deephums"))
_AUGMENTATION: Final = DEFAULT.augmentation
OURS: Final[dict[str, tuple[str, DescriptorRecipe]]] = {
    "default, labels": ("labels", DEFAULT),
    "  without contrast": ("labels", replace(DEFAULT, contrast=0.0)),
    "  without limbs of other clips": ("labels", replace(DEFAULT, augmentation=replace(_AUGMENTATION, limbs=0.0))),
    "  without missing joints": ("labels", replace(DEFAULT, augmentation=replace(_AUGMENTATION, missing=0.0))),
    "  without speeds": ("labels", replace(DEFAULT, augmentation=replace(_AUGMENTATION, warp=0.0, crop=0.0))),
    "  mirrored half of the time": ("labels", replace(DEFAULT, augmentation=replace(_AUGMENTATION, mirror=0.5))),
    "  hidden 96": ("labels", replace(DEFAULT, hidden=96)),
    "default, no labels": ("none", WITHOUT),
    "  joined to 4": ("none", replace(WITHOUT, neighbours=4)),
    "  joined to 10": ("none", replace(WITHOUT, neighbours=10)),
    "  even in time": ("none", replace(WITHOUT, paced=0.0)),
    "  sketch alone": ("none", PRETRAINED),
    "  neighbourhood alone": ("none", replace(WITHOUT, encoders=WITHOUT.encoders[1:])),
}
OF_THE_THESIS: Final[dict[str, tuple[str, DescriptorRecipe]]] = {
    "thesis, no labels": ("none", THESIS),
    "  5 % of pairs pass a test": ("none", replace(THESIS, similar=0.05)),
    "  40 % of pairs pass a test": ("none", replace(THESIS, similar=0.4)),
    "  margin 0.5": ("none", replace(THESIS, margin=0.5)),
    "  margin 2": ("none", replace(THESIS, margin=2.0)),
    "  hidden 128": ("none", replace(THESIS, hidden=128)),
    "thesis, labels": ("labels", THESIS),
}
CHOICES: Final = OURS | OF_THE_THESIS


@dataclass(frozen=True)
class Unit:
    """One choice with one subject left out."""

    choice: str
    subject: str
    epochs: int

    def __str__(self) -> str:
        return f"{self.choice.strip()}, without subject {self.subject}"


def measure_unit(unit: Unit) -> dict[str, Found]:
    supervision, recipe = CHOICES[unit.choice]
    recipe = replace(recipe, epochs=min(unit.epochs, recipe.epochs)) if unit.epochs else recipe
    asked, known = left_out(split_of(SET, "train"), unit.subject)
    model = train_descriptor(training_clips(known), DescriptorsConfig(supervision=supervision), recipe=recipe)
    apart = euclidean(model.embed(asked.sequences), model.embed(known.sequences))
    return {unit.choice: asdict(score_split(apart, Questions.of(asked.labels, known.labels)))}


def left_out(split: Split, subject: str) -> tuple[Split, Split]:
    """The clips of one subject, and all others."""

    def of(rows: np.ndarray) -> Split:
        return Split([split.clips[i] for i in rows], [split.sequences[i] for i in rows])

    his = np.array([name == subject for name in split.subjects])
    return of(np.flatnonzero(his)), of(np.flatnonzero(~his))


def named(rows: Sequence[str], choices: Sequence[str]) -> list[str]:
    """The choices about our recipe ("motionlake") and the thesis's ("thesis"), all of them or those that are named."""
    every = [choice for choice in CHOICES if ("thesis" if choice in OF_THE_THESIS else "motionlake") in rows]
    return [choice for choice in every if not choices or choice.strip() in choices]


def measure(epochs: int, processes: int, keep: Path | None, chosen: Sequence[str]) -> dict[str, Any]:
    """Mean over the subjects of each choice; "seeds" of the record are subjects; a folder keeps what is done."""
    subjects = sorted(set(split_of(SET, "train").subjects))
    units = [Unit(choice, subject, epochs) for choice in chosen for subject in subjects]
    runs: dict[str, dict[int, Found]] = {}
    for unit, found in in_processes(measure_unit, units, processes, str, keep):
        runs.setdefault(unit.choice, {})[int(unit.subject)] = found[unit.choice]
    found_of = with_seeds({choice: runs[choice] for choice in chosen}, lambda name: False)
    print(f"\n{table(SET, found_of, ('top1', 'top10', 'map', 'pr_area', 'n'))}")
    return found_of
