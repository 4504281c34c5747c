"""Recorded clips as motion matching takes them: as frames of its database, and as what a motion goes on from."""

from __future__ import annotations

from collections.abc import Iterable

from motionlake.arrays import Float64Array
from motionlake.matching.building import build_database
from motionlake.matching.database import MotionDatabase
from motionlake.matching.recordings import MatchingClip
from motionlake.motion.generation import SeedClip

from bench.canonical_sets import LabelledClip


def offsets_of(clip: LabelledClip) -> Float64Array:
    assert clip.rest_offsets is not None
    return clip.rest_offsets


def seed_of(clip: LabelledClip) -> SeedClip:
    return SeedClip(clip.name, clip.positions.astype(float), clip.fps, offsets_of(clip), clip.rotations.astype(float))


def matching_clip(clip: LabelledClip, label: str = "") -> MatchingClip:
    """Named class/clip; of its own class, or of another."""
    label = label or clip.label
    return MatchingClip(f"{label}/{clip.name}", 0, label, clip.positions, clip.rotations, offsets_of(clip), clip.fps)


def database_of(clips: Iterable[LabelledClip], label: str = "") -> MotionDatabase:
    """Of clips of their own classes, or of one."""
    return build_database([matching_clip(clip, label) for clip in clips])
