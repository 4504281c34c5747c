"""All checks of one recording, and whether it is ok, doubtful or bad."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from motionlake.motion.quality.bones import check_bones
from motionlake.motion.quality.ends import check_ends
from motionlake.motion.quality.faults import KINDS, Fault, Recording
from motionlake.motion.quality.feet import check_feet
from motionlake.motion.quality.noise import check_noise
from motionlake.motion.quality.scale import check_scale
from motionlake.motion.quality.sides import check_sides
from motionlake.motion.quality_config import QualityConfig

CHECKS: Final = (check_feet, check_noise, check_bones, check_scale, check_sides)  # of what lies between T-poses
MEASURES: Final = (
    "slide", "penetration", "floating", "jitter", "spikes", "flips", "frozen", "missing", "limb_drift", "tpose_start",
    "tpose_end", "fps_doubt", "fps_known", "unit_doubt", "up_doubt", "swapped_sides", "loop_seam",
)  # fmt: skip
VERDICTS: Final = ("ok", "doubtful", "bad")  # the best first
# Of these one anywhere makes the whole clip bad, for all of its numbers are wrong by it.
WHOLE: Final = ("fps", "unit", "up", "swapped_sides")


@dataclass(frozen=True)
class Quality:
    """What the checks found in a clip.

    Attributes:
        verdict: of `VERDICTS`.
        measures: by `MEASURES`.
        faults: by kind in the order of `KINDS`, then by frame.
        share: of the clip's frames that a fault touches.
        frames, fps: of the clip.
    """

    verdict: str
    measures: Mapping[str, float]
    faults: Sequence[Fault]
    share: float
    frames: int
    fps: float


def check(recording: Recording, config: QualityConfig) -> Quality:
    """Look for every fault. A clip of fewer than two frames has none that could be seen."""
    measures = dict.fromkeys(MEASURES, 0.0)
    found: list[Fault] = []
    if len(recording) > 1:
        measured, found = check_ends(recording, config)
        measures |= measured
        first = max((f.stop for f in found if f.kind == "tpose_start"), default=0)
        last = min((f.start for f in found if f.kind == "tpose_end"), default=len(recording))
        moving = recording.part(first, last)
        for one in CHECKS if len(moving) > 1 else ():
            measured, faults = one(moving, config)
            measures |= measured
            found += [replace(fault, start=fault.start + first, stop=fault.stop + first) for fault in faults]
    missing = recording.repaired / len(recording) if len(recording) else 0.0
    measures["missing"] = missing
    if missing > config.missing:
        found.append(Fault(kind="missing", start=0, stop=len(recording), severity=missing))
    found.sort(key=lambda f: (KINDS.index(f.kind), f.start, f.stop, f.joint))
    touched = np.zeros(len(recording), dtype=np.bool_)
    for fault in (fault for fault in found if fault.kind != "missing"):  # whose frames are not known
        touched[fault.start : fault.stop] = True
    share = max(float(touched.mean()), missing) if len(recording) else 0.0
    verdict = "ok"
    if found:
        whole = any(fault.kind in WHOLE for fault in found)
        verdict = "bad" if whole or share > config.bad_share else "doubtful"
    return Quality(verdict, measures, found, share, len(recording), recording.fps)
