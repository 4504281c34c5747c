"""Recordings with bones that keep their length, beside the recordings themselves: what any made motion can reach.

A depth sensor's bones change their length from frame to frame, and part of the speed of its joints is that. Every
bone here keeps its direction and gets the length that it has in the body, as in made motion; the hips stay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from motionlake.evaluation.synthesis.motions import Stretch
from motionlake.motion.skeleton import PARENTS

from bench.made.splits import SPLITS, clips_of, real
from bench.made.table import RATIOS, measures, since
from bench.units import Found


def rigid(motion: Stretch) -> Stretch:
    """The motion by bones of its body's lengths."""
    positions = motion.positions.copy()
    lengths = np.linalg.norm(motion.rest_offsets, axis=1)
    for joint, parent in enumerate(PARENTS):
        if parent >= 0:
            bones = motion.positions[:, joint] - motion.positions[:, parent]
            directions = bones / np.maximum(np.linalg.norm(bones, axis=1, keepdims=True), 1e-9)
            positions[:, joint] = positions[:, parent] + lengths[joint] * directions
    return replace(motion, positions=positions)


def measure(splits: Sequence[str]) -> dict[str, Found]:
    """{class: measures of its recordings, of the rigid ones, and the ratios of these to those}."""
    found: dict[str, Found] = {}
    for label in dict.fromkeys(label for name in splits for label in SPLITS[name].classes):
        recorded = [real(clip, since(clip)) for clip in clips_of(label)]
        plain, kept = measures(recorded), measures([rigid(motion) for motion in recorded])
        ratios = {name: kept[name] / plain[name] for name in RATIOS if plain[name]}
        found[label] = {"recorded": plain, "rigid": kept, "ratio": ratios}
    return found
