"""Ten seconds of motion from clips that were left out: does it freeze or run away, slide, travel as real clips do."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from motionlake.arrays import Float64Array
from motionlake.evaluation.synthesis_metrics import (
    bone_length_drift,
    energy,
    foot_sliding,
    travel_speed,
    within_range,
)
from motionlake.glogen.trajectories import FPS, resampled
from motionlake.motion.generation import MotionRequest, SeedClip

from bench.glogen.folds import Measures, Unit, folds, generator_of, parted
from bench.glogen.material import Material, material

SECONDS: Final = 10.0
ROWS: Final = ("made", "clips")


def measure(unit: Unit) -> dict[str, Measures]:
    """{"made", "clips"}: of every motion that starts from a clip left out, and of these clips."""
    whole = material(unit.set_name)
    _, test = parted(unit.set_name, unit.fold)
    generator = generator_of(unit)
    made = generator.generate([_wish(test, i, unit.seed * 1000 + n) for i, n in enumerate(folds(whole)[unit.fold])])
    found = _described([m.positions for m in made])
    real = [energy(positions, FPS) for positions in _recorded(whole)]
    found["inside"] = [float(one) for one in within_range([energy(m.positions, FPS) for m in made], real)]
    found["bones"] = [bone_length_drift(m.positions, m.rest_offsets) for m in made]
    return {"made": found, "clips": _described(_recorded(test))}


def _wish(test: Material, i: int, seed: int) -> MotionRequest:
    clip = test.clips[i]
    assert clip.rest_offsets is not None
    return MotionRequest((clip.label,), SECONDS, seed, SeedClip(clip.name, clip.positions, clip.fps, clip.rest_offsets))


def _recorded(chosen: Material) -> list[Float64Array]:
    flat = [resampled(c.positions.reshape(len(c.positions), -1), c.fps, FPS) for c in chosen.clips]
    return [rows.reshape(len(rows), -1, 3) for rows in flat]


def _described(motions: Sequence[Float64Array]) -> Measures:
    energies, feet = [energy(m, FPS) for m in motions], [foot_sliding(m, FPS) for m in motions]
    return {
        "energy": [e.mean for e in energies], "least": [e.low for e in energies], "most": [e.high for e in energies],
        "sliding": [f.speed for f in feet], "standing": [f.standing_speed for f in feet],
        "travel": [travel_speed(m, FPS) for m in motions],
    }  # fmt: skip
