"""Learning curves: loss, and top-1 of the clips of a training subject that is held out, over the epochs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.deephums.batches import resampled
from motionlake.deephums.config import DescriptorsConfig
from motionlake.deephums.recipes import recipe_of
from motionlake.deephums.training import train_descriptor

from bench.deephums.choices import left_out
from bench.deephums.fit import Clips, fit
from bench.deephums.retrieval import BASELINES, DESCRIPTORS, FRAMES, augmented, training_clips
from bench.deephums.sets import Split, split_of
from bench.fitting import Budget
from bench.units import Found, in_processes

EVERY: Final = 10  # epochs


@dataclass(frozen=True)
class Unit:
    """One method on one set, whose last training subject is held out; seed 0."""

    set_name: str
    method: str
    epochs: int

    def __str__(self) -> str:
        return f"{self.set_name} {self.method}"


def measure_unit(unit: Unit) -> dict[str, Found]:
    """{method: {loss [epochs], validation [(epoch, top-1)], top1 at the end}}."""
    split = split_of(unit.set_name, "train")
    held, known = left_out(split, max(split.subjects))
    found = (_baseline if unit.method in BASELINES else _descriptor)(unit, held, known)
    return {unit.method: found | {"top1": found["validation"][-1][1]}}


def _descriptor(unit: Unit, held: Split, known: Split) -> Found:
    figures = train_descriptor(
        training_clips(known), _config(unit.method, unit.epochs), validation=training_clips(held)
    ).metrics
    return {"loss": figures["loss"], "validation": figures["validation"]}


def _baseline(unit: Unit, held: Split, known: Split) -> Found:
    recipe = recipe_of(DescriptorsConfig(epochs=unit.epochs))
    clips, asked = _clips(known, known), _clips(held, known)
    fitted = fit(
        partial(BASELINES[unit.method], len(set(known.labels))), clips, Budget(recipe.epochs), seed=0, held_out=asked,
        augment=augmented(recipe.augmentation, clips.x, clips.labels, 0),
    )  # fmt: skip
    last = len(fitted.epochs)
    return {
        "loss": [round(epoch.loss, 5) for epoch in fitted.epochs],
        "validation": [
            (i, epoch.retrieval) for i, epoch in enumerate(fitted.epochs, 1) if i % EVERY == 0 or i == last
        ],
    }  # fmt: skip


def _config(method: str, epochs: int) -> DescriptorsConfig:
    recipe, supervision = DESCRIPTORS[method]
    return DescriptorsConfig(recipe=recipe, supervision=supervision, epochs=epochs)


def measure(set_name: str, epochs: int, processes: int = 1, keep: Path | None = None) -> dict[str, Any]:
    """The curve of every method that learns by gradients; a folder keeps what is done."""
    learned = [
        method
        for method, (_, supervision) in DESCRIPTORS.items()
        if recipe_of(_config(method, epochs), labels=supervision == "labels").epochs
    ]
    units = [Unit(set_name, method, epochs) for method in (*learned, *BASELINES)]
    done = {unit: found[unit.method] for unit, found in in_processes(measure_unit, units, processes, str, keep)}
    return {unit.method: done[unit] for unit in units}


def _clips(split: Split, known: Split) -> Clips:
    classes = {label: i for i, label in enumerate(sorted(set(known.labels)))}
    x = np.stack([resampled(sequence, FRAMES) for sequence in split.sequences])
    return Clips(x, np.array([classes[label] for label in split.labels]), tuple(split.subjects))
