"""Sets of motions as generators read them, held in memory once read."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array
from motionlake.glogen.sparse import HEIGHT, JOINT_COLUMNS, TrainingPiece, pieces
from motionlake.glogen.trajectories import BodyMotion, body_motion
from motionlake.motion.skeleton import PARENTS
from numpy.typing import NDArray

from bench.canonical_sets import LabelledClip
from bench.glogen.motions import Bones, Motions
from bench.glogen.sets import clips_of

# Pairs of joints, the hips left out, between which a bone keeps its length.
BONES: Final[Bones] = tuple((joint - 1, parent - 1) for joint, parent in enumerate(PARENTS) if parent > 0)


@dataclass(frozen=True)
class Material:
    """Clips of a set, or of a part of it, as motions.

    Attributes:
        clips: as recorded.
        motions: of each, as generators read it.
        classes: names in order.
    """

    clips: list[LabelledClip]
    motions: list[BodyMotion]
    classes: list[str]

    @property
    def labels(self) -> list[str]:
        return [clip.label for clip in self.clips]

    @property
    def targets(self) -> list[int]:
        return [self.classes.index(label) for label in self.labels]

    def of(self, rows: list[int]) -> Material:
        return Material([self.clips[i] for i in rows], [self.motions[i] for i in rows], self.classes)

    def pieces(self, count: int, stride: int) -> list[TrainingPiece]:
        return pieces(self.motions, self.targets, count=count, stride=stride)


@cache
def material(name: str) -> Material:
    """All clips of a set."""
    clips = clips_of(name)
    motions = [body_motion(clip.positions, clip.fps) for clip in clips]
    return Material(clips, motions, sorted({clip.label for clip in clips}))


def split_material(name: str, split: str) -> Material:
    """The clips of one split."""
    whole = material(name)
    return whole.of([i for i, clip in enumerate(whole.clips) if clip.split == split])


def sparse_motions(chosen: Material, made: list[TrainingPiece]) -> tuple[Motions, NDArray[np.float32]]:
    """What baselines read of pieces (joints alone), and all columns [n, 20, 65] of their sparse poses."""
    rows = np.stack([piece.sparse.rows for piece in made]).astype(np.float32)
    targets = np.array([piece.target for piece in made])
    return Motions(rows[..., JOINT_COLUMNS], targets, len(chosen.classes), (), BONES), rows


def frames_of(motion: BodyMotion) -> Float32Array:
    """[T, 60] joints of every frame."""
    return motion.joints.reshape(len(motion), HEIGHT).astype(np.float32)
