"""Whether a fault in joints that were measured one by one is one of the recording: bones do not change their length.

Of a fault the bones that end or begin at its joint are looked at, which the checks for these kinds do not know of: for
jitter how much their length trembles from frame to frame, else how far it leaves its median. What that finds in clips
in which nothing of the kind is told is the control.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.quality import Fault, Quality, Recording
from motionlake.motion.quality_config import QualityConfig
from motionlake.motion.skeleton import INDEX, PARENTS

LONGER: Final = 0.2  # of its length by which a bone is wrong
FRAMES: Final = {"jitter": 15, "spike": 3, "penetration": 8}  # of a place that is drawn for the control
FOURTH: Final = 0.6745 * 70**0.5  # the median of fourth differences of white noise of standard deviation 1


def confirmed(
    kind: str, recordings: Sequence[Recording], found: Sequence[Quality], config: QualityConfig
) -> dict[str, Any]:
    """Of clips in which a kind is told, how many have a bone there that is wrong; and of others, at a place by seed."""
    random = np.random.default_rng(0)
    counts = {"told": 0, "confirmed": 0, "control": 0, "control_wrong": 0}
    for recording, quality in zip(recordings, found, strict=True):
        faults = [fault for fault in quality.faults if fault.kind == kind]
        if faults:
            counts["told"] += 1
            counts["confirmed"] += any(_wrong(recording, fault, config) for fault in faults)
            continue
        joint = str(random.choice(list(INDEX)[1:]))
        start = int(random.integers(0, max(1, len(recording) - FRAMES[kind])))
        drawn = Fault(kind=kind, joint=joint, start=start, stop=start + FRAMES[kind], severity=0.0)
        counts["control"] += 1
        counts["control_wrong"] += _wrong(recording, drawn, config)
    return counts


def _wrong(recording: Recording, fault: Fault, config: QualityConfig) -> bool:
    lengths = _bones(recording, INDEX[fault.joint])
    if fault.kind == "jitter":
        within = lengths[fault.start : fault.stop]
        noise = np.median(np.abs(np.diff(within, 4, axis=0)), axis=0) / FOURTH
        return bool(noise.max(initial=0.0) > config.jitter)
    apart = np.abs(lengths / np.median(lengths, axis=0) - 1)
    return bool(apart[fault.start : fault.stop].max(initial=0.0) > LONGER)


def _bones(recording: Recording, joint: int) -> Float64Array:
    """[F, bones] metres of those that end or begin at a joint."""
    ends = [each for each in range(1, len(PARENTS)) if joint in (each, PARENTS[each])]
    apart = recording.positions[:, ends] - recording.positions[:, [PARENTS[each] for each in ends]]
    lengths: Float64Array = np.linalg.norm(apart, axis=2)
    return lengths
