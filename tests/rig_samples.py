"""Which recordings the tests of rigs and of the canonical skeleton use."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Set:
    """One set of recordings: where its clips are, how many to skip between samples, what their rig is."""

    pattern: str
    step: int
    rig: str


SETS = {
    "hdm05": Set("hdm05/clips/*/*.amc", 29, "cmu_asf"),
    "cmu_dance": Set("cmu_dance/clips/*/**/*.bvh", 7, "poser"),
    "cmu_bvh": Set("cmu_bvh/clips/*.bvh", 12, "cmu_bvh"),
    "cmu_exercises": Set("cmu_exercises/clips/*.amc", 2, "cmu_asf"),
    "cmu_86": Set("cmu_86/clips/*.amc", 1, "cmu_asf"),
    "utd_mhad": Set("utd_mhad/clips/*.npz", 31, "kinect_v1"),
    "bandai1": Set("bandai1/clips/*.bvh", 10, "bandai"),
}


def sample(recordings: Path, name: str) -> list[Path]:
    """The sampled clips of a set, in the order of their names."""
    paths = sorted(recordings.glob(SETS[name].pattern))[:: SETS[name].step]
    assert paths, f"no clips of {name}"
    return paths
