"""Left and right that were exchanged: knees and toes point where the back is."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.quality.faults import Fault, Found, Recording
from motionlake.motion.quality_config import QualityConfig
from motionlake.motion.runs import runs

WINDOW: Final = 0.25  # seconds over which the vote of knees and toes is taken
UNSURE: Final = 0.02  # of a leg, as which knees and toes lie ahead
SHORTEST: Final = 0.3  # seconds
KNEES: Final = 0.25  # how much they count beside toes: in some recordings those of straight legs bend backwards


def check_sides(recording: Recording, config: QualityConfig) -> Found:
    """Measure `swapped_sides`: the share of frames in which the body's front is at its back."""
    from scipy.ndimage import uniform_filter1d

    ahead = uniform_filter1d(_ahead(recording), recording.frames(WINDOW), mode="nearest") / max(recording.leg, 1e-6)
    swapped = ahead < -UNSURE
    found = [
        Fault(kind="swapped_sides", start=start, stop=stop, severity=(stop - start) / recording.fps)
        for start, stop in runs(swapped, recording.frames(WINDOW), recording.frames(SHORTEST))
    ]
    return Found({"swapped_sides": sum(f.stop - f.start for f in found) / len(recording)}, found)


def _ahead(recording: Recording) -> Float64Array:
    """[F] metres by which knees bend and toes point the way that people's do, seen from the left of the hips.

    Knees and ankles are hinges: thigh, shin and foot turn about the hips' axis in one sense, however the body stands.
    """
    left = recording.joint("left_hip") - recording.joint("right_hip")
    left /= np.maximum(np.linalg.norm(left, axis=1, keepdims=True), 1e-9)
    total = np.zeros(len(recording))
    for side in ("left", "right"):
        thigh = recording.joint(f"{side}_knee") - recording.joint(f"{side}_hip")
        shin = recording.joint(f"{side}_ankle") - recording.joint(f"{side}_knee")
        foot = recording.joint(f"{side}_toe") - recording.joint(f"{side}_ankle")
        turned = KNEES * np.cross(thigh, shin) - np.cross(shin, foot)
        total += (turned * left).sum(axis=1) / max(recording.leg / 2, 1e-6)
    return total
