"""Sets that synthesis is measured on, canonical, held in memory once read."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Final

from motionlake.motion.calibration import recorded_range

from bench.canonical_sets import LabelledClip, LabelledSet, read

WALK: Final = "walk"


def _is_walk(row: dict[str, str]) -> bool:
    return WALK in row["description"].lower()


SETS: Final = {
    "utd_mhad": LabelledSet("utd_mhad", "label"),
    "indian": LabelledSet("cmu_dance", "label", lambda row: row["label"] == "indian"),
    "martial": LabelledSet("cmu_dance", "label", lambda row: row["label"] == "martial"),
    "walk": LabelledSet("cmu_bvh", "description", _is_walk),
    "run": LabelledSet("cmu_bvh", "description", lambda row: row["description"] == "run/jog"),
}
"""utd_mhad has 27 classes and the split of its labels file; the others are one class each, without a split: "indian"
and "martial" dances of cmu_dance, and the clips of cmu_bvh whose description holds the word walk (68 of 126, of 14
subjects: slow, brisk and exaggerated ones too)."""


@cache
def clips_of(name: str) -> list[LabelledClip]:
    """The clips of a set, in the order of its labels file: positions [F, 21, 3] metres at the clip's own rate.

    Calibration poses at their ends are left out.

    The walks are labelled "walk", whatever their description says beside it, the runs "run".
    """
    clips = [_recorded(clip) for clip in read(SETS[name])]
    return [replace(clip, label=name) for clip in clips] if SETS[name].label == "description" else clips


def _recorded(clip: LabelledClip) -> LabelledClip:
    rows = slice(*recorded_range(clip.positions, clip.fps))
    return replace(clip, positions=clip.positions[rows], rotations=clip.rotations[rows])


def split_of(name: str, split: str) -> list[LabelledClip]:
    """The clips of a set in one of its splits."""
    return [clip for clip in clips_of(name) if clip.split == split]
