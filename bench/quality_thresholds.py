"""Thresholds of `[quality]` and the usual evidence of frame rates, chosen on some sets of recordings for another one.

Of every threshold a few multiples of that of the program are tried. The one is taken whose harmonic mean of precision
and recall is best in the mean over the sets that it is chosen on; the program's where others are as good.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import fmean
from typing import Any, Final

import numpy as np
from motionlake.motion.quality import Fault, Recording
from motionlake.motion.quality.bones import check_bones
from motionlake.motion.quality.clock import USUAL, Usual
from motionlake.motion.quality.ends import check_ends
from motionlake.motion.quality.faults import Found
from motionlake.motion.quality.feet import check_feet
from motionlake.motion.quality.noise import check_noise
from motionlake.motion.quality_config import QualityConfig

from bench.plants import PLANTS, Planted, Subject

Check = Callable[[Recording, QualityConfig], Found]
MULTIPLES: Final = (1.0, 0.6, 0.8, 1.25, 1.6)  # of the program's threshold, which wins where others are as good
TRIED: Final = 40  # clips of a set on which thresholds are tried
SHORT: Final = 0.02  # by which another one must be better
FEW: Final = 10  # clips with a fault in a set say too little of it
BOUND: Final = 1.0  # octaves that one clip counts at most in a spread


@dataclass(frozen=True)
class Threshold:
    """Of a fault: its kind, and the check that reads the threshold."""

    kind: str
    check: Check


# `unit` and `up` need no choice: no person is as large, no body as slanted.
THRESHOLDS: Final = {
    "slide": Threshold("slide", check_feet), "slide_seconds": Threshold("slide", check_feet),
    "slide_way": Threshold("slide", check_feet),
    "penetration": Threshold("penetration", check_feet), "floating": Threshold("floating", check_feet),
    "jitter": Threshold("jitter", check_noise), "jitter_seconds": Threshold("jitter", check_noise),
    "spike": Threshold("spike", check_noise), "flip": Threshold("flip", check_noise),
    "frozen_seconds": Threshold("frozen", check_bones), "limb_drift": Threshold("limb_drift", check_bones),
    "tpose_degrees": Threshold("tpose_start", check_ends),
    "seam": Threshold("seam", check_ends),
}  # fmt: skip

Scores = Mapping[str, Sequence[float]]  # of each field of `QualityConfig`, by `MULTIPLES`


def planted(kind: str, subject: Subject, number: int) -> Planted | None:
    """The fault in a clip; a place where it cannot be is drawn again."""
    drawn = np.random.default_rng([list(PLANTS).index(kind), number])
    return next((made for made in (PLANTS[kind](subject, drawn) for _ in range(5)) if made is not None), None)


def is_found(kind: str, made: Planted, faults: Sequence[Fault]) -> bool:
    slack = 2
    return any(f.kind == kind and f.start < made.stop + slack and f.stop > made.start - slack for f in faults)


def harmonic(found: int, planted: int, alarms: int, clean: int) -> float:
    """The harmonic mean of recall and precision, of as many clips with the fault as without."""
    false = alarms * planted / clean
    return 2 * found / (found + planted + false)


def scores(subjects: Sequence[Subject], config: QualityConfig) -> Scores:
    """How good each threshold is on a set; nothing of faults that can be planted in few of its clips."""
    chosen = subjects[:: max(1, len(subjects) // TRIED)]
    found = {}
    for field, threshold in THRESHOLDS.items():
        made = [m for m in (planted(threshold.kind, s, n) for n, s in enumerate(chosen)) if m is not None]
        if len(made) >= FEW:
            found[field] = [_score(field, threshold, chosen, made, config, multiple) for multiple in MULTIPLES]
    return found


def _score(
    field: str,
    threshold: Threshold,
    subjects: Sequence[Subject],
    made: Sequence[Planted],
    config: QualityConfig,
    multiple: float,
) -> float:
    tried: Any = {field: getattr(config, field) * multiple}
    other = replace(config, **tried)
    told = sum(is_found(threshold.kind, m, threshold.check(m.recording, other)[1]) for m in made)
    alarms = sum(any(f.kind == threshold.kind for f in threshold.check(s.recording, other)[1]) for s in subjects)
    return harmonic(told, len(made), alarms, len(subjects))


def chosen_config(others: Sequence[Scores], config: QualityConfig) -> QualityConfig:
    """The thresholds that are best on some sets."""
    fields: dict[str, Any] = {}
    for field in THRESHOLDS:
        known = [each[field] for each in others if field in each]
        if not known:
            continue
        means = [fmean(each[at] for each in known) for at in range(len(MULTIPLES))]
        best = int(np.argmax(means))
        multiple = MULTIPLES[best] if means[best] > means[0] + SHORT else 1.0
        fields[field] = getattr(config, field) * multiple
    return replace(config, **fields)


def chosen_spreads(others: Sequence[Scores], spreads: Sequence[float]) -> float:
    """How far above what is usual in a dataset a fault stands out, which is best on some sets; the first of `spreads`
    where others are as good, or where nothing is usual in them."""
    known = [row for each in others for row in each.values()]
    if not known:
        return spreads[0]
    means = [fmean(row[at] for row in known) for at in range(len(spreads))]
    best = int(np.argmax(means))
    return spreads[best] if means[best] > means[0] + SHORT else spreads[0]


def usual(sets: Sequence[Sequence[Mapping[str, float]]]) -> dict[str, Usual]:
    """What evidence of frame rates is usual in some sets of recordings; `tempo` has each set count the same.

    Of a kind that no clip has it is what the program takes.
    """
    found = {}
    for kind in USUAL:
        of_sets = [np.array([each[kind] for each in one if kind in each]) for one in sets]
        of_sets = [values for values in of_sets if len(values)]
        if not of_sets:
            found[kind] = USUAL[kind]
            continue
        middle = fmean(float(np.median(values)) for values in of_sets)
        if kind != "tempo":
            middle = float(np.median(np.concatenate(of_sets)))
        apart = np.concatenate(of_sets) - middle
        found[kind] = Usual(middle, float(np.sqrt(np.minimum(apart**2, BOUND).mean())))
    return found
