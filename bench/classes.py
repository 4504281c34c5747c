"""The classes that made motion is measured by: one list for every bench of synthesis."""

from __future__ import annotations

from typing import Final

from bench.canonical_sets import LabelledSet, Row


def described_as(*names: str) -> LabelledSet:
    """The clips of cmu_bvh that are described in exactly these words."""

    def chosen(row: Row) -> bool:
        return row["description"].strip().lower() in names

    return LabelledSet("cmu_bvh", "description", chosen)


def dance(name: str) -> LabelledSet:
    return LabelledSet("cmu_dance", "label", lambda row: row["label"] == name)


def action(name: str) -> LabelledSet:
    return LabelledSet("utd_mhad", "label", lambda row: row["label"] == name)


# Six of the 27 classes of utd_mhad: those that numpy's default_rng(0) chooses from their sorted names.
ACTIONS: Final = ("arm_curl", "catch", "draw_circle_ccw", "jog", "lunge", "squat")
# Motion that goes on and on, as long as it is asked for; actions come to an end.
GOING: Final = {
    "walk": described_as("walk"),
    "run": described_as("run", "run/jog"),
    "salsa": dance("salsa"),
    "indian": dance("indian"),
    "martial": dance("martial"),
}
CLASSES: Final = {**GOING, **{name: action(name) for name in ACTIONS}}
