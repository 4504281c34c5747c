"""Test clips query training clips, by every method: the tables of section 3.3 with baselines on the same data."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Final

import numpy as np
import torch
from motionlake.arrays import Float32Array, FloatArray
from motionlake.deephums.batches import Augmentation, resampled
from motionlake.deephums.config import DescriptorsConfig
from motionlake.deephums.network import TrainedDescriptor
from motionlake.deephums.recipes import PRETRAINED, recipe_of
from motionlake.deephums.sequence import alignment_distances, motion_distance, motion_field
from motionlake.deephums.sketch import sketches
from motionlake.deephums.training import TrainingClip, train_descriptor
from motionlake.evaluation.dtw import baseline_features, joint_error
from motionlake.evaluation.ranking import Questions, first_hits, score_split
from motionlake.motion.dtw import dtw_cross
from motionlake.motion.features import body_length
from numpy.typing import NDArray
from torch import Tensor, nn

from bench.deephums.autoencoder import DeepAutoencoder
from bench.deephums.fit import Clips, embed, fit
from bench.deephums.hcn import HierarchicalCooccurrence
from bench.deephums.indrnn import IndependentlyRecurrent
from bench.deephums.robustness import robustness
from bench.deephums.sets import Split, split_of
from bench.fitting import Budget
from bench.units import Found

FRAMES: Final = 64
SCORES: Final = ("top1", "top10", "map", "pr_area", "error_mm", "recognition", "n")


@dataclass(frozen=True)
class Unit:
    """One method on one set with one seed."""

    set_name: str
    method: str
    seed: int
    epochs: int = 0

    def __str__(self) -> str:
        return f"{self.set_name} {self.method}, seed {self.seed}"


def scores(distances: FloatArray, asked: Split, known: Split) -> Found:
    """Retrieval scores of distances [q, r], and the error of a joint after DTW between query and first hit."""
    questions = Questions.of(asked.labels, known.labels)
    a, b = (_frames(split) for split in (asked, known))
    hits = first_hits(distances, questions)
    error = np.mean([joint_error(a[query], b[hit]) for query, hit in hits.items()])
    body = np.mean([body_length(clip.positions) for clip in (*asked.clips, *known.clips)])
    return {**asdict(score_split(distances, questions)), "error_mm": 1000 * float(error * body)}


def _frames(split: Split) -> list[Float32Array]:
    return [baseline_features(clip.positions, clip.fps) for clip in split.clips]


def euclidean(asked: Float32Array, known: Float32Array) -> NDArray[np.float64]:
    """[q, r] distances of rows."""
    return torch.cdist(torch.from_numpy(asked).double(), torch.from_numpy(known).double()).numpy()


# Methods without training


def by_dtw(asked: Split, known: Split) -> FloatArray:
    return dtw_cross(_frames(asked), _frames(known))


def by_moves(asked: Split, known: Split) -> FloatArray:
    """The distances that self-supervised training looks at, as a method of its own."""
    both = alignment_distances([*asked.sequences, *known.sequences])
    return both[: len(asked.clips), len(asked.clips) :]


def by_joints(asked: Split, known: Split) -> FloatArray:
    """Joints at 32 instants: the shallow floor of a descriptor."""
    return euclidean(*(np.stack([resampled(s, 32).ravel() for s in split.sequences]) for split in (asked, known)))


def by_sketch(asked: Split, known: Split) -> FloatArray:
    """Sketches themselves: the shallow floor of a network that learns without labels."""

    def rows(split: Split) -> Float32Array:
        clips = np.stack([resampled(s, PRETRAINED.frames, PRETRAINED.paced) for s in split.sequences])
        return np.asarray(sketches(torch.from_numpy(clips)).numpy())

    return euclidean(rows(asked), rows(known))


def by_motion(asked: Split, known: Split) -> FloatArray:
    """Motion fields and distances (equations 3.3 and 3.4) themselves."""

    def rows(split: Split) -> Float32Array:
        made = [np.concatenate([motion_field(s).ravel(), motion_distance(s)]) for s in split.sequences]
        return np.stack(made).astype(np.float32)

    return euclidean(rows(asked), rows(known))


UNTRAINED: Final[Mapping[str, Callable[[Split, Split], FloatArray]]] = {
    "whole-clip DTW": by_dtw,
    "DTW of normalised moves": by_moves,
    "joints at 32 instants": by_joints,
    "sketch": by_sketch,
    "motion field and distance": by_motion,
}

# Baselines that are trained

BASELINES: Final[Mapping[str, Callable[[int], nn.Module]]] = {
    "autoencoder (Wang and Neff)": lambda classes: DeepAutoencoder(),
    "HCN-like": HierarchicalCooccurrence,
    "IndRNN-like": IndependentlyRecurrent,
}


def baseline(unit: Unit, asked: Split, known: Split) -> Found:
    """A baseline, trained with the augmentation, the epochs and the batches that the default recipe has."""
    classes = {label: i for i, label in enumerate(sorted(set(known.labels)))}
    targets = np.array([classes[label] for label in known.labels])
    recipe = recipe_of(DescriptorsConfig(epochs=unit.epochs))
    clips, tests = (np.stack([resampled(s, FRAMES) for s in split.sequences]) for split in (known, asked))
    fitted = fit(
        partial(BASELINES[unit.method], len(classes)), Clips(clips, targets, tuple(known.subjects)),
        Budget(recipe.epochs), seed=unit.seed, augment=augmented(recipe.augmentation, clips, targets, unit.seed),
    )  # fmt: skip
    repository, _ = embed(fitted.network, clips)
    queries, logits = embed(fitted.network, tests)
    found = scores(euclidean(_unit(queries), _unit(repository)), asked, known)
    if logits is not None:
        truth = np.array([classes[label] for label in asked.labels])
        found["recognition"] = float(np.mean(logits.argmax(axis=1) == truth))
    return found | {"train_seconds": fitted.epochs[-1].seconds}


def augmented(
    augmentation: Augmentation, clips: Float32Array, targets: NDArray[np.int64], seed: int
) -> Callable[[Tensor, Tensor], Tensor]:
    """The augmentation that descriptors train with, for `fit`: limbs come from clips of the same class."""
    rng = np.random.default_rng(seed)
    of_class = [np.flatnonzero(targets == target) for target in range(targets.max() + 1)]

    def augment(x: Tensor, labels: Tensor) -> Tensor:
        partners = np.array([rng.choice(of_class[label]) for label in labels.tolist()])
        return augmentation(x, rng, torch.from_numpy(clips[partners]))

    return augment


def _unit(rows: Float32Array) -> Float32Array:
    return np.asarray(rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-12), dtype=np.float32)


# Descriptors

DESCRIPTORS: Final = {
    "thesis, self-supervised": ("deephums", "none"),
    "thesis, supervised": ("deephums", "labels"),
    "motionlake, self-supervised": ("default", "none"),
    "motionlake, supervised": ("default", "labels"),
}


def training_clips(split: Split) -> list[TrainingClip]:
    return [TrainingClip(s, label) for s, label in zip(split.sequences, split.labels, strict=True)]


def descriptor(unit: Unit, asked: Split, known: Split) -> dict[str, Found]:
    """A descriptor network, and its rows of robustness where it is the default recipe with labels."""
    recipe, supervision = DESCRIPTORS[unit.method]
    started = time.perf_counter()
    config = DescriptorsConfig(recipe=recipe, supervision=supervision, seed=unit.seed, epochs=unit.epochs)
    model = train_descriptor(training_clips(known), config)
    seconds = time.perf_counter() - started
    found = scores(_apart(model, asked, known), asked, known) | {"train_seconds": seconds}
    if supervision == "labels":
        found["recognition"] = _recognised(model, asked)
    rows = {unit.method: found}
    if unit.method == "motionlake, supervised":
        rows |= {f"  {name}": row for name, row in robustness(model, asked, known, unit.seed).items()}
    return rows


def _apart(model: TrainedDescriptor, asked: Split, known: Split) -> FloatArray:
    return euclidean(model.embed(asked.sequences), model.embed(known.sequences))


def _recognised(model: TrainedDescriptor, asked: Split) -> float:
    """Share of clips whose class the classifiers on the descriptors name together."""
    network = model.network
    clips = [resampled(s, model.recipe.frames) if model.recipe.frames else s for s in asked.sequences]
    with torch.inference_mode():
        parts = [network.logits(network.parts(torch.from_numpy(clip)[None])) for clip in clips]
        named = [torch.stack(logits).log_softmax(dim=2).sum(dim=0).argmax().item() for logits in parts]
    return float(np.mean([model.classes[int(n)] == label for n, label in zip(named, asked.labels, strict=True)]))


def measure(unit: Unit) -> dict[str, Found]:
    """{row: scores} of one unit."""
    asked, known = split_of(unit.set_name, "test"), split_of(unit.set_name, "train")
    if unit.method in UNTRAINED:
        return {unit.method: scores(UNTRAINED[unit.method](asked, known), asked, known)}
    if unit.method in BASELINES:
        return {unit.method: baseline(unit, asked, known)}
    return descriptor(unit, asked, known)


def units(sets: Sequence[str], methods: Sequence[str], seeds: Sequence[int], epochs: int) -> list[Unit]:
    """What is measured: every method on every set, those that are trained with every seed."""
    return [
        Unit(name, method, seed, epochs)
        for name in sets
        for method in methods
        for seed in (seeds[:1] if method in UNTRAINED else seeds)
    ]


METHODS: Final = (*UNTRAINED, *BASELINES, *DESCRIPTORS)
