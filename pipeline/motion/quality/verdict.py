"""All checks of one recording, and whether it is ok, doubtful or bad."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from motionlake.motion.quality.bones import check_bones
from motionlake.motion.quality.ends import check_ends
from motionlake.motion.quality.faults import KINDS, RUNGS, Fault, Level, Recording
from motionlake.motion.quality.feet import check_feet
from motionlake.motion.quality.noise import check_noise
from motionlake.motion.quality.scale import check_scale
from motionlake.motion.quality.sides import check_sides
from motionlake.motion.quality_config import QualityConfig

CHECKS: Final = (check_feet, check_noise, check_bones, check_scale, check_sides)  # of what lies between T-poses
MEASURES: Final = (
    "slide", "in_place", "penetration", "floating", "jitter", "spikes", "flips", "frozen", "missing", "limb_drift",
    "tpose_start", "tpose_end", "fps_doubt", "fps_known", "unit_doubt", "up_doubt", "swapped_sides", "loop_seam",
)  # fmt: skip
VERDICTS: Final = ("ok", "doubtful", "bad")  # the best first
# Of these one anywhere makes the whole clip bad, for all of its numbers are wrong by it.
WHOLE: Final = ("fps", "unit", "up", "swapped_sides")

Highest = Mapping[str, Mapping[str, float]]  # by fault and joint


@dataclass(frozen=True)
class Quality:
    """What the checks found in a clip.

    Attributes:
        verdict: of `VERDICTS`.
        measures: by `MEASURES`.
        faults: by kind in the order of `KINDS`, then by frame.
        levels: how far above its threshold each goes that has a size, by joint.
        share: of the clip's frames that a fault touches.
        frames, fps: of the clip.
    """

    verdict: str
    measures: Mapping[str, float]
    faults: Sequence[Fault]
    levels: Sequence[Level]
    share: float
    frames: int
    fps: float


def check(recording: Recording, config: QualityConfig) -> Quality:
    """Look for every fault. A clip of fewer than two frames has none that could be seen."""
    measures = dict.fromkeys(MEASURES, 0.0)
    found: list[Fault] = []
    levels: list[Level] = []
    if len(recording) > 1:
        ends = check_ends(recording, config)
        measures |= ends.measures
        found = ends.faults
        first = max((f.stop for f in found if f.kind == "tpose_start"), default=0)
        last = min((f.start for f in found if f.kind == "tpose_end"), default=len(recording))
        moving = recording.part(first, last)
        for one in CHECKS if len(moving) > 1 else ():
            told = one(moving, config)
            measures |= told.measures
            found += [replace(fault, start=fault.start + first, stop=fault.stop + first) for fault in told.faults]
            levels += [replace(level, start=level.start + first, stop=level.stop + first) for level in told.levels]
    missing = recording.repaired / len(recording) if len(recording) else 0.0
    measures["missing"] = missing
    if missing > config.missing:
        found.append(Fault(kind="missing", start=0, stop=len(recording), severity=missing))
    return _judged(Quality("", measures, found, levels, missing, len(recording), recording.fps), config)


def in_dataset(quality: Quality, usual: Highest, config: QualityConfig) -> Quality:
    """The same without the faults that are usual in the clip's dataset and do not stand out there.

    Args:
        usual: of each fault that is usual, the multiple of the threshold above which it stands out, by joint (column
            `highest` of the view `quality_usual`).
    """
    if not usual:
        return quality
    left = [fault for fault in quality.faults if fault.kind not in usual]
    for one in quality.levels:
        highest = usual.get(one.kind, {}).get(one.joint, np.inf)
        if one.level > highest and one.rung == math.floor(RUNGS * math.log2(highest)):
            left.append(Fault(kind=one.kind, joint=one.joint, start=one.start, stop=one.stop, severity=one.severity))
    return _judged(replace(quality, faults=left), config)


def _judged(quality: Quality, config: QualityConfig) -> Quality:
    """With its faults in order, and the verdict that they give."""
    found = sorted(quality.faults, key=lambda f: (KINDS.index(f.kind), f.start, f.stop, f.joint))
    touched = np.zeros(quality.frames, dtype=np.bool_)
    for fault in (fault for fault in found if fault.kind != "missing"):  # whose frames are not known
        touched[fault.start : fault.stop] = True
    share = max(float(touched.mean()), quality.measures["missing"]) if quality.frames else 0.0
    verdict = "ok"
    if found:
        whole = any(fault.kind in WHOLE for fault in found)
        verdict = "bad" if whole or share > config.bad_share else "doubtful"
    return replace(quality, verdict=verdict, faults=found, share=share)
