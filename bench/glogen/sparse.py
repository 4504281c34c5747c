"""Tables 4.1 and 4.4: the 15 sparse poses that follow five, on utd_mhad, by every method."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Final

import numpy as np
import torch
from motionlake.arrays import Float32Array
from motionlake.deephums.config import DescriptorsConfig
from motionlake.deephums.network import TrainedDescriptor
from motionlake.deephums.training import TrainingClip, train_descriptor
from motionlake.evaluation.synthesis.likeness import frechet_distance
from motionlake.glogen.config import SEEDS, GloGenRecipe, glogen_recipe
from motionlake.glogen.config import SPARSE as POSES
from motionlake.glogen.rollout import predict
from motionlake.glogen.sparse import JOINT_COLUMNS, PIECE
from motionlake.glogen.training import train_glogen, unseen
from motionlake.motion.skeleton import COMMON, INDEX
from numpy.typing import NDArray

from bench.glogen.baseline import Settings
from bench.glogen.material import Material, sparse_motions, split_material
from bench.glogen.methods import CHOSEN, DEFAULTS, SPARSE, fitted
from bench.glogen.motions import Motions, joint_error, pose_error
from bench.units import Found

SET: Final = "utd_mhad"
THESIS: Final = glogen_recipe("glogen")
DEFAULT: Final = glogen_recipe("default")
OURS: Final[Mapping[str, GloGenRecipe]] = {"motionlake": DEFAULT, "thesis": THESIS}
# Table 4.4, of the thesis's network.
ABLATIONS: Final[Mapping[str, GloGenRecipe]] = {
    "thesis, plain descent": replace(THESIS, optimiser="sgd"),
    "one direction": replace(THESIS, bidirectional=False),
    "two layers": replace(THESIS, layers=2),
    "GRU": replace(THESIS, cell="GRU"),
    "16 sparse poses": replace(THESIS, sparse=16),
    "24 sparse poses": replace(THESIS, sparse=24),
}
# Of the default network.
OWN_ABLATIONS: Final[Mapping[str, GloGenRecipe]] = {
    "motionlake, nothing latent": replace(DEFAULT, latent=1, divergence=10.0),
    "motionlake, differences not weighed": replace(DEFAULT, smooth=0.0),
}
# Trained and asked with a fifth of the joints of the given poses missing.
MISSING: Final[Mapping[str, GloGenRecipe]] = {
    f"{name}, joints missing": replace(recipe, missing=0.2) for name, recipe in OURS.items()
}
GLOGEN: Final[Mapping[str, GloGenRecipe]] = {**OURS, **MISSING, **ABLATIONS, **OWN_ABLATIONS}
SCORES: Final = ("fid", "joint_error", "pose_error", "variety")


@dataclass(frozen=True)
class Unit:
    """One method with one seed."""

    method: str
    seed: int
    epochs: int = 0

    def __str__(self) -> str:
        return f"{self.method}, seed {self.seed}"


@dataclass(frozen=True)
class Task:
    """Train and test split at a number of sparse poses: rows [n, count, 65] and classes."""

    train: Material
    test: Material
    count: int

    @property
    def rows(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        return self._of(self.train), self._of(self.test)

    def _of(self, chosen: Material) -> NDArray[np.float32]:
        return sparse_motions(chosen, chosen.pieces(self.count, PIECE))[1]


@cache
def task(count: int = POSES) -> Task:
    return Task(split_material(SET, "train"), split_material(SET, "test"), count)


def measure(unit: Unit) -> dict[str, Found]:
    """{method: scores}: errors of the best guess, likeness of samples where a method has chance in it.

    "variety" is the mean distance of joints between the two: 0 where nothing is left to chance.
    """
    count = GLOGEN[unit.method].sparse if unit.method in GLOGEN else POSES
    train, test = task(count).rows
    targets, wanted = np.array(task(count).train.targets), np.array(task(count).test.targets)
    started = time.perf_counter()
    guessed, sampled = (
        _glogen(unit, train, targets, test, wanted) if unit.method in GLOGEN else _baseline(unit, test, wanted)
    )
    seconds = time.perf_counter() - started
    true = test[:, SEEDS:, JOINT_COLUMNS]
    judge = judge_of(count)
    real, made = (_described(judge, rows) for rows in (test[..., JOINT_COLUMNS], _whole(test, sampled)))
    return {
        unit.method: {
            "fid": frechet_distance(real, made), "joint_error": joint_error(guessed, true),
            "pose_error": pose_error(guessed, true), "variety": joint_error(sampled, guessed), "n": len(test),
            "seconds": seconds,
        }
    }  # fmt: skip


def _baseline(unit: Unit, test: Float32Array, wanted: NDArray[np.int64]) -> tuple[Float32Array, Float32Array]:
    settings = settings_of(unit.epochs, CHOSEN[SET].get(unit.method, Settings()))
    method = fitted(SPARSE[unit.method](settings), training_motions(), unit.seed)
    given = test[:, :SEEDS, JOINT_COLUMNS]
    return method.predict(given, wanted), method.predict(given, wanted, np.random.default_rng(unit.seed))


def settings_of(epochs: int, settings: Settings = DEFAULTS) -> Settings:
    """Settings with as many epochs, no more, where `epochs` is not 0."""
    return replace(settings, budget=replace(settings.budget, epochs=epochs, steps=0)) if epochs else settings


def training_motions() -> Motions:
    """The training split as baselines read it, in groups by subject."""
    train = task().train
    data, _ = sparse_motions(train, train.pieces(POSES, PIECE))
    return replace(data, groups=tuple(clip.subject for clip in train.clips))


def _glogen(
    unit: Unit, train: Float32Array, targets: NDArray[np.int64], test: Float32Array, wanted: NDArray[np.int64]
) -> tuple[Float32Array, Float32Array]:
    recipe = GLOGEN[unit.method]
    recipe = replace(recipe, epochs=unit.epochs, steps=0, going_steps=0) if unit.epochs else recipe
    network, _ = train_glogen(list(train), targets, len(task().train.classes), recipe, unit.seed)
    rng = np.random.default_rng(unit.seed)
    chance = rng.standard_normal((len(test), max(1, recipe.latent)))
    given = network.scale.back(unseen(network.scale(torch.from_numpy(test)), recipe.missing, rng)).numpy()
    guessed, sampled = (
        predict(network, given[:, :SEEDS], wanted, share * chance)[..., JOINT_COLUMNS].astype(np.float32)
        for share in (0.0, 1.0)
    )
    return guessed, sampled


def _whole(test: Float32Array, made: Float32Array) -> Float32Array:
    """[m, n, 60] the given poses and those made after them."""
    return np.concatenate([test[:, :SEEDS, JOINT_COLUMNS], made], axis=1)


@cache
def judge_of(count: int) -> TrainedDescriptor:
    """A descriptor network of sparse poses, trained on those of the training split by class, for no generator."""
    train, _ = task(count).rows
    clips = [
        TrainingClip(s, label) for s, label in zip(as_described(list(train)), task(count).train.labels, strict=True)
    ]
    return train_descriptor(clips, DescriptorsConfig(supervision="labels", epochs=40))


def _described(judge: TrainedDescriptor, rows: Float32Array) -> Float32Array:
    return judge.embed(as_described(list(rows)))


def as_described(motions: Sequence[Float32Array]) -> list[Float32Array]:
    """Poses [n, 60] or wider as descriptors read clips: 15 joints, the first in the place of the root's path (none)."""
    chosen = [INDEX[name] - 1 for name in COMMON[1:]]
    found = []
    for rows in motions:
        joints = rows[:, JOINT_COLUMNS].reshape(len(rows), -1, 3)[:, chosen]
        found.append(np.concatenate([np.zeros((len(rows), 1, 3)), joints], axis=1).astype(np.float32))
    return found


METHODS: Final = (*SPARSE, *GLOGEN)
