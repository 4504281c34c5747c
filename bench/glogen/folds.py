"""Every clip of a CMU set left out once, and generators that learn from the other clips."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.evaluation.synthesis.motions import WORST
from motionlake.glogen.config import SynthesisConfig
from motionlake.glogen.generator import TrainedGenerator, load_generator
from motionlake.glogen.generator_training import fit_generator
from motionlake.lake.parts import replacing

from bench.glogen.material import Material, material
from bench.units import Found

SETS: Final = ("indian", "martial", "walk")
# Of so many clips or fewer one is left out at a time. Of more (the walks), every eighth in the order of their names.
FOLDS: Final = 8
# What is measured of every motion or piece of a fold.
Measures = dict[str, list[float]]
# What is not a mean over these.
EXTREMES: Final[Mapping[str, Callable[[Iterable[float]], float]]] = dict.fromkeys(WORST, max)


@dataclass(frozen=True)
class Unit:
    """One fold of a set with one seed."""

    set_name: str
    seed: int
    fold: int
    epochs: int = 0
    generators: Path | None = field(default=None, repr=False)

    def __str__(self) -> str:
        return f"{self.set_name}, seed {self.seed}, fold {self.fold}"


def folds(whole: Material) -> list[list[int]]:
    """The clips that are left out together, each clip once: one at a time, or every `FOLDS`th of many."""
    count = len(whole.clips)
    return [list(range(first, count, FOLDS)) for first in range(min(count, FOLDS))]


def folds_of(set_name: str) -> range:
    """Numbers of the folds of a set."""
    return range(len(folds(material(set_name))))


def parted(set_name: str, fold: int) -> tuple[Material, Material]:
    """The clips that are left, and those that are left out."""
    whole = material(set_name)
    held = folds(whole)[fold]
    return whole.of([i for i in range(len(whole.clips)) if i not in held]), whole.of(held)


def generator_of(unit: Unit) -> TrainedGenerator:
    """The default generator of a unit."""
    config = SynthesisConfig(seed=unit.seed, epochs=unit.epochs)
    return generator_without(unit.set_name, unit.fold, config, unit.generators)


def generator_without(set_name: str, fold: int, config: SynthesisConfig, kept: Path | None = None) -> TrainedGenerator:
    """A generator that was trained without the clips of a fold.

    A folder keeps it for whoever asks for the same; it is for one state of the code and of the recordings.
    """
    name = hashlib.sha256(repr((set_name, fold, config)).encode()).hexdigest()[:24]
    path = kept and kept / f"{name}.safetensors"
    if path is not None and path.exists():
        return load_generator(path)
    train, _ = parted(set_name, fold)
    generator = fit_generator(train.motions, train.labels, config)
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as written:
            generator.save(written)
    return generator


def means(folds: Sequence[Measures]) -> Found:
    """Measures over all motions of all folds: means, and of `EXTREMES` these."""
    found: Found = {}
    for key in folds[0]:
        each = [value for fold in folds for value in fold[key]]
        if not each:  # every motion is too short for it
            continue
        found[key] = float(EXTREMES.get(key, np.mean)(each))
        found["n"] = max(found.get("n", 0), len(each))
    return found
