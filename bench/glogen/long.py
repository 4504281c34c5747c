"""Ten seconds of motion from clips that were left out: does it freeze or run away, slide, travel as real clips do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from bench.glogen.material import Material, material
from bench.units import Found
from pipeline.clip import FloatArray
from pipeline.evaluation.synthesis_movement import bone_length_drift, energy, foot_sliding, travel_speed, within_range
from pipeline.synthesis.config import SynthesisConfig
from pipeline.synthesis.training import fit_generator
from pipeline.synthesis.wishes import Seed, Synthesized, Wish
from pipeline.trajectories.motion import FPS, resampled

SETS: Final = ("indian", "martial", "walk")
EVERY: Final = 4  # of the clips, in the order of their names, one is left out: the first, the fifth and so on
SECONDS: Final = 10.0


@dataclass(frozen=True)
class Unit:
    """One set with one seed."""

    set_name: str
    seed: int
    epochs: int = 0

    def __str__(self) -> str:
        return f"{self.set_name}, seed {self.seed}"


def measure(unit: Unit) -> dict[str, Found]:
    """{"made", "test", "train"}: of motions that start from the clips left out, of these, and of those trained on."""
    whole = material(unit.set_name)
    held = list(range(0, len(whole.clips), EVERY))
    train, test = whole.of([i for i in range(len(whole.clips)) if i not in held]), whole.of(held)
    generator = fit_generator(train.motions, train.labels, SynthesisConfig(seed=unit.seed, epochs=unit.epochs))
    made = generator.generate([_wish(test, i, unit.seed) for i in range(len(held))])
    known, asked = _recorded(train), _recorded(test)
    inside = within_range([energy(m.positions, FPS) for m in made], [energy(p, FPS) for p in (*known, *asked)])
    found = _described([m.positions for m in made])
    found |= {"inside": float(np.mean(inside)), "bones": max(_drift(m) for m in made)}
    return {"made": found, "test": _described(asked), "train": _described(known)}


def _wish(test: Material, i: int, seed: int) -> Wish:
    clip = test.clips[i]
    assert clip.rest_offsets is not None
    return Wish((clip.label,), SECONDS, seed * 1000 + i, Seed(clip.name, clip.positions, clip.fps, clip.rest_offsets))


def _recorded(chosen: Material) -> list[FloatArray]:
    flat = [resampled(c.positions.reshape(len(c.positions), -1), c.fps, FPS) for c in chosen.clips]
    return [rows.reshape(len(rows), -1, 3) for rows in flat]


def _described(motions: Sequence[FloatArray]) -> Found:
    energies, feet = [energy(m, FPS) for m in motions], [foot_sliding(m, FPS) for m in motions]
    return {
        "energy": float(np.mean([e.mean for e in energies])), "least": min(e.low for e in energies),
        "most": max(e.high for e in energies), "sliding": float(np.mean([f.speed for f in feet])),
        "standing": float(np.mean([f.standing_speed for f in feet])),
        "travel": float(np.mean([travel_speed(m, FPS) for m in motions])), "n": len(motions),
    }  # fmt: skip


def _drift(made: Synthesized) -> float:
    return bone_length_drift(made.positions, made.rest_offsets)
