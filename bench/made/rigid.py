"""Recordings with bones that keep their length, beside the recordings themselves: what any made motion can reach.

A depth sensor's bones change their length from frame to frame, and part of the speed of its joints is that. Every
bone here keeps its direction and gets the length that it has in the body, as in made motion; the hips stay.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from bench.canonical_sets import LabelledClip
from bench.made.splits import SPLITS, clips_of, folds, real, rigid
from bench.made.table import RATIOS, measures, shares, since, spaces
from bench.units import Found


def measure(split: str, chosen: Sequence[int]) -> dict[str, Found]:
    """{class: measures of its recordings, of the rigid ones, the ratios of these to those, and how rigid known
    recordings cover unseen ones, as a share of what the known ones reach as they are}."""
    found: dict[str, Found] = {}
    dealt = [(known, test) for _, known, test in folds(split, chosen)]
    for label in SPLITS[split].classes:
        recorded = [real(clip, since(clip)) for clip in clips_of(label)]
        plain, kept = measures(recorded), measures([rigid(motion) for motion in recorded])
        found[label] = {
            "recorded": plain, "rigid": kept,
            "ratio": {name: kept[name] / plain[name] for name in RATIOS if plain[name]},
            "likeness": shares([_likeness(label, *both) for both in dealt]),
        }  # fmt: skip
    return found


def _likeness(label: str, known: Sequence[LabelledClip], test: Sequence[LabelledClip]) -> dict[str, Any]:
    learned, unseen = ([real(c, since(c)) for c in some if c.label == label] for some in (known, test))
    return spaces(unseen, learned, [rigid(motion) for motion in learned])
