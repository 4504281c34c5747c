"""Ten seconds of motion from clips that were left out: does it freeze or run away, slide, travel as real clips do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from bench.glogen.folds import folds, generator_without, parted
from bench.glogen.material import Material, material
from bench.units import Found
from pipeline.clip import FloatArray
from pipeline.evaluation.synthesis_movement import bone_length_drift, energy, foot_sliding, travel_speed, within_range
from pipeline.synthesis.config import SynthesisConfig
from pipeline.synthesis.wishes import Seed, Wish
from pipeline.trajectories.motion import FPS, resampled

SECONDS: Final = 10.0
ROWS: Final = ("made", "clips")
# What is not a mean over motions.
EXTREMES: Final = {"least": min, "most": max, "bones": max}
Measures = dict[str, list[float]]


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


def measure(unit: Unit) -> dict[str, Measures]:
    """{"made", "clips"}: of every motion that starts from a clip left out, and of these clips."""
    whole = material(unit.set_name)
    _, test = parted(unit.set_name, unit.fold)
    config = SynthesisConfig(seed=unit.seed, epochs=unit.epochs)
    generator = generator_without(unit.set_name, unit.fold, config, unit.generators)
    made = generator.generate([_wish(test, i, unit.seed * 1000 + n) for i, n in enumerate(folds(whole)[unit.fold])])
    found = _described([m.positions for m in made])
    real = [energy(positions, FPS) for positions in _recorded(whole)]
    found["inside"] = [float(one) for one in within_range([energy(m.positions, FPS) for m in made], real)]
    found["bones"] = [bone_length_drift(m.positions, m.rest_offsets) for m in made]
    return {"made": found, "clips": _described(_recorded(test))}


def means(folds: Sequence[Any]) -> Found:
    """Measures over the motions of all folds: means, and of `EXTREMES` these."""
    found: Found = {}
    for key in folds[0]:
        each = [value for fold in folds for value in fold[key]]
        found[key] = float(EXTREMES.get(key, np.mean)(each))
        found["n"] = len(each)
    return found


def _wish(test: Material, i: int, seed: int) -> Wish:
    clip = test.clips[i]
    assert clip.rest_offsets is not None
    return Wish((clip.label,), SECONDS, seed, Seed(clip.name, clip.positions, clip.fps, clip.rest_offsets))


def _recorded(chosen: Material) -> list[FloatArray]:
    flat = [resampled(c.positions.reshape(len(c.positions), -1), c.fps, FPS) for c in chosen.clips]
    return [rows.reshape(len(rows), -1, 3) for rows in flat]


def _described(motions: Sequence[FloatArray]) -> Measures:
    energies, feet = [energy(m, FPS) for m in motions], [foot_sliding(m, FPS) for m in motions]
    return {
        "energy": [e.mean for e in energies], "least": [e.low for e in energies], "most": [e.high for e in energies],
        "sliding": [f.speed for f in feet], "standing": [f.standing_speed for f in feet],
        "travel": [travel_speed(m, FPS) for m in motions],
    }  # fmt: skip
