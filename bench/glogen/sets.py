"""Sets that synthesis is measured on, canonical, held in memory once read."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Final

from motionlake.motion.calibration import recorded_range

from bench.canonical_sets import LabelledClip, LabelledSet, read
from bench.classes import GOING

SETS: Final = {"utd_mhad": LabelledSet("utd_mhad", "label"), **GOING}
"""utd_mhad has 27 classes and the split of its labels file; the others are one class each, without a split, the same
clips as motion matching is measured by (`bench.classes`)."""


@cache
def clips_of(name: str) -> list[LabelledClip]:
    """The clips of a set, in the order of its labels file: positions [F, 21, 3] metres at the clip's own rate.

    Calibration poses at their ends are left out.

    Walks are labelled "walk", runs "run", in whatever words they are described.
    """
    clips = [_recorded(clip) for clip in read(SETS[name])]
    return [replace(clip, label=name) for clip in clips] if SETS[name].label == "description" else clips


def _recorded(clip: LabelledClip) -> LabelledClip:
    rows = slice(*recorded_range(clip.positions, clip.fps))
    return replace(clip, positions=clip.positions[rows], rotations=clip.rotations[rows])


def split_of(name: str, split: str) -> list[LabelledClip]:
    """The clips of a set in one of its splits."""
    return [clip for clip in clips_of(name) if clip.split == split]
