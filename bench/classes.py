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
    return labelled("utd_mhad", name)


def labelled(folder: str, name: str) -> LabelledSet:
    return LabelledSet(folder, "label", lambda row: row["label"] == name)


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

# Of sets by which no weight of motion matching was chosen: classes with ten clips and more, of which half last 1.2 s.
_HDM05: Final = (
    "depositFloorR", "elbowToKnee1RepsLelbowStart", "grabHighR", "jogLeftCircle4StepsRstart", "kickLFront1Reps",
    "lieDownFloor", "sneak2StepsLStart", "squat1Reps", "throwBasketball",
)  # fmt: skip
_BANDAI1: Final = (
    "bow", "bye", "byebye", "dash", "guide", "run", "walk", "walk-back", "walk-left", "walk-right",
)  # fmt: skip
OTHERS: Final = {
    **{f"hdm05 {name}": labelled("hdm05", name) for name in _HDM05},
    **{f"bandai1 {name}": labelled("bandai1", name) for name in _BANDAI1},
}
