"""The recordings that motion is made from and measured by: in three folds, dealt by clip or by who moves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Final, Literal

import numpy as np
from motionlake.evaluation.synthesis.motions import Stretch
from motionlake.matching.recordings import longest_range
from motionlake.motion.generation import FPS, GeneratedMotion
from motionlake.motion.ground import Ground, ground_of
from motionlake.motion.limbs import LIMBS, even_limbs, nearest
from motionlake.motion.resampling import resample
from motionlake.motion.skeleton import PARENTS

from bench.canonical_sets import LabelledClip, read
from bench.classes import ACTIONS, CLASSES, GOING, OTHERS
from bench.matching_clips import offsets_of

FOLDS: Final = 3


@dataclass(frozen=True)
class Split:
    """Classes that one generator makes, and what is never in two folds: a clip (partners of a dance), or a subject."""

    classes: tuple[str, ...]
    by: Literal["name", "subject"] = "name"


# Those by whose clips constants were chosen, or at least looked at.
TUNED: Final = {
    **{name: Split((name,)) for name in GOING},
    "walk, other subjects": Split(("walk",), "subject"),
    "actions, other subjects": Split(ACTIONS, "subject"),
}
SPLITS: Final = {
    **TUNED,
    "hdm05, other subjects": Split(tuple(name for name in OTHERS if name.startswith("hdm05")), "subject"),
    "bandai1": Split(tuple(name for name in OTHERS if name.startswith("bandai1"))),
}


@cache
def clips_of(label: str) -> list[LabelledClip]:
    """The clips of a class, without calibration poses and beyond no jump: each the longest stretch that is left."""
    return [_recorded(replace(clip, label=label)) for clip in read((CLASSES | OTHERS)[label])]


def _recorded(clip: LabelledClip) -> LabelledClip:
    start, stop = longest_range(clip.positions, clip.rotations, clip.fps)
    return replace(clip, positions=clip.positions[start:stop], rotations=clip.rotations[start:stop])


def parted(split: str, fold: int) -> tuple[list[LabelledClip], list[LabelledClip]]:
    """The clips of the other folds, and of this one."""
    chosen = SPLITS[split]
    clips = [clip for label in chosen.classes for clip in clips_of(label)]
    own = set(sorted({_key(clip, chosen) for clip in clips})[fold::FOLDS])
    return [c for c in clips if _key(c, chosen) not in own], [c for c in clips if _key(c, chosen) in own]


def _key(clip: LabelledClip, split: Split) -> str:
    return clip.subject if split.by == "subject" else clip.name


def folds(
    split: str, chosen: Sequence[int] = range(FOLDS)
) -> Iterator[tuple[int, list[LabelledClip], list[LabelledClip]]]:
    """Of folds their numbers, the clips that are known, and those that are left out."""
    for fold in chosen:
        yield fold, *parted(split, fold)


_GROUNDS: Final[dict[tuple[str, str, str], Ground]] = {}


def ground(clip: LabelledClip) -> Ground:
    """That of a whole clip."""
    key = (clip.label, clip.name, clip.subject)
    if key not in _GROUNDS:
        _GROUNDS[key] = ground_of(clip.positions)
    return _GROUNDS[key]


def real(clip: LabelledClip, start: int = 0) -> Stretch:
    """A clip from a frame on, 30 frames a second."""
    return Stretch(
        frozenset({clip.name}), clip.label, resample(clip.positions[start:].astype(float), clip.fps, FPS), FPS,
        offsets_of(clip), ground(clip), clip.rotations[start:],
    )  # fmt: skip


def rigid(motion: Stretch) -> Stretch:
    """The motion by a body whose bones keep their length, as near as it can be: what any made motion can reach.

    A depth sensor's bones change theirs. The trunk's get the lengths that they have in the body, in their directions;
    arms and legs are the nearest to the recorded joints, as in `matching.recordings.rooted`. The hips stay.
    """
    recorded, positions = motion.positions, motion.positions.astype(float)
    lengths = np.linalg.norm(even_limbs(recorded, motion.rest_offsets), axis=1)
    for joint, parent in enumerate(PARENTS):
        if parent >= 0:
            bones = recorded[:, joint] - recorded[:, parent]
            directions = bones / np.maximum(np.linalg.norm(bones, axis=1, keepdims=True), 1e-9)
            positions[:, joint] = positions[:, parent] + lengths[joint] * directions
    for root, *joints in LIMBS:
        end, before = joints[-1], positions[:, joints[-1]].copy()
        wanted = [recorded[:, joint] for joint in joints]
        fitted = nearest(positions[:, root], *(positions[:, joint] for joint in joints), *wanted)
        positions[:, joints] = np.stack(fitted, axis=1)
        for joint in np.flatnonzero(np.array(PARENTS) == end).tolist():
            positions[:, joint] += positions[:, end] - before
    return replace(motion, positions=positions)


def made_from(made: GeneratedMotion, clip: LabelledClip) -> Stretch:
    """A motion that goes on from a clip, on a level ground as high as where the given frames end."""
    under = ground(clip).level_at(clip.positions[made.seed_stop - 1, 0])
    return Stretch(
        frozenset({clip.name}), clip.label, made.positions, made.fps, made.rest_offsets, under, made.rotations
    )
