"""Training descriptor networks (DeepHuMS, section 3.2)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from motionlake.arrays import Float32Array, Int64Array, Progress
from motionlake.deephums.batches import at_speeds, padded, resampled, windows
from motionlake.deephums.config import DescriptorsConfig
from motionlake.deephums.neighbourhood import MOST_EXAMPLES, neighbourhoods
from motionlake.deephums.network import DescriptorNetwork, TrainedDescriptor
from motionlake.deephums.recipes import DescriptorRecipe, recipe_of
from motionlake.deephums.sequence import one_cycle, similar_by_motion
from motionlake.training import Checkpoint, Training, on_threads
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import cross_entropy, normalize

CHECKPOINT_EVERY: Final = 5
VALIDATE_EVERY: Final = 10
TOLD: Final = 100  # clips whose neighbours are found, from one call of `progress` to the next


@dataclass(frozen=True)
class TrainingClip:
    """A clip to train on: `clip_sequence`, and its class where it is known."""

    sequence: Float32Array
    label: str | None = None


def train_descriptor(
    clips: Sequence[TrainingClip],
    config: DescriptorsConfig,
    *,
    recipe: DescriptorRecipe | None = None,
    validation: Sequence[TrainingClip] = (),
    checkpoint: Path | None = None,
    device: str | None = None,
    progress: Progress | None = None,
) -> TrainedDescriptor:
    """Train a network on clips.

    Args:
        clips: at least two. Where labels supervise, clips without a label are left out.
        config: recipe, supervision, seed.
        recipe: how to train; that of the configuration if not given.
        validation: labelled clips that are not trained on, to follow training by.
        checkpoint: a file to save training to and to go on from; deleted at the end.
        device: of the computation; CUDA where there is one, else the CPU.
        progress: called with (epochs done, epochs, mean loss) after each epoch; where neighbours are looked for, with
            (clips done, clips, not a number).

    Returns:
        The network; the same for the same input, configuration and seed, interrupted or not (on CUDA: up to
        rounding). Its metrics: `clips`, `classes` (None without labels), `supervision` used, `loss` of each epoch,
        `validation`: (epoch, top-1 of the validation clips among those trained on) every so often.

    Raises:
        ValueError: too few clips, or labels that are required (for "contrast" too) and are not there.
    """
    device = device or ("cuda" if torch.cuda.is_available() else "cpu")
    classes = _classes(clips, config.supervision)
    recipe = recipe or recipe_of(config, labels=bool(classes))
    used = [clip for clip in clips if clip.label in classes] if classes else list(clips)
    if len(used) < 2:
        raise ValueError(f"{len(used)} clips are too few to train on")
    if recipe.objective == "contrast" and recipe.epochs and not classes:
        raise ValueError("clips of a class are to be near, but no class has two clips")
    offered = len(used)
    used = [TrainingClip(part, clip.label) for clip in used for part in windows(clip.sequence)]
    rng = np.random.default_rng(config.seed)
    if "neighbourhood" in recipe.encoders and len(used) > MOST_EXAMPLES:
        used = [used[i] for i in sorted(rng.permutation(len(used))[:MOST_EXAMPLES].tolist())]
    with on_threads(1), torch.random.fork_rng(devices=[]):
        material = _Material.of(used, classes, recipe)
        torch.manual_seed(config.seed)
        network = DescriptorNetwork(recipe, len(classes))
        _learn(network, used, material, recipe, progress)
        if not recipe.epochs:
            return TrainedDescriptor(config, recipe, network.eval(), classes, _metrics(offered, classes))
        network.to(device)
        data = np.concatenate([clip.sequence.ravel() for clip in used])
        kept = Checkpoint(checkpoint, data, config, recipe) if checkpoint else None
        optimiser = torch.optim.AdamW(
            network.parameters(), lr=recipe.learning_rate, weight_decay=recipe.weight_decay, eps=1e-7
        )
        followed: list[tuple[int, float]] = []

        def rate(share: float) -> float:
            return recipe.learning_rate * (one_cycle(share) if recipe.warm_up else 1)

        def batches() -> list[Int64Array]:
            """Of an epoch: all clips in random order, no batch smaller than half of the recipe's."""
            count = len(material.clips)
            return np.array_split(rng.permutation(count), max(1, round(count / recipe.batch)))

        def after(done: int) -> None:
            if validation and (done % VALIDATE_EVERY == 0 or done == recipe.epochs):
                followed.append((done, _top1(network, recipe, used, validation)))

        losses = Training(
            network, optimiser, recipe.epochs, rate, batches,
            lambda rows: _loss(network, material, rows, recipe, rng, device), config.seed, rng, kept,
            CHECKPOINT_EVERY, progress, after,
        ).run()  # fmt: skip
    metrics = {**_metrics(offered, classes), "loss": [round(loss, 5) for loss in losses]}
    if followed:
        metrics["validation"] = followed
    return TrainedDescriptor(config, recipe, network.cpu().eval(), classes, metrics)


def _learn(
    network: DescriptorNetwork,
    used: Sequence[TrainingClip],
    material: _Material,
    recipe: DescriptorRecipe,
    progress: Progress | None,
) -> None:
    """What is learned without gradients."""
    near = None
    if "neighbourhood" in recipe.encoders:

        def found(done: int, count: int) -> None:
            if progress and (done % TOLD == 0 or done == count):
                progress(done, count, float("nan"))

        near = torch.from_numpy(neighbourhoods([clip.sequence for clip in used], recipe.neighbours, found))
    frames = torch.from_numpy(np.concatenate([clip.sequence for clip in used]))
    network.learn(frames, torch.from_numpy(np.stack(material.clips)) if recipe.frames else None, near)


def _metrics(clips: int, classes: Sequence[str]) -> dict[str, Any]:
    return {"clips": clips, "classes": len(classes) or None, "supervision": "labels" if classes else "none"}


@dataclass(frozen=True)
class _Material:
    """n clips to train on.

    Attributes:
        clips: [n] of any length, or all of one.
        targets: [n] class of each clip, or None.
        near: [n, n] whether pairs are similar (section 3.2), where the objective is "pairs".
        source: [n] rows of `near` that clips stand for: copies at other speeds share one.
    """

    clips: list[Float32Array]
    targets: Int64Array | None
    near: NDArray[np.bool_] | None
    source: Int64Array

    @classmethod
    def of(cls, used: Sequence[TrainingClip], classes: list[str], recipe: DescriptorRecipe) -> _Material:
        sequences = [clip.sequence for clip in used]
        near = similar_by_motion(sequences, recipe.similar) if recipe.objective == "pairs" else None
        copies = [at_speeds(clip) if recipe.speeds else [clip] for clip in sequences]
        source = np.repeat(np.arange(len(used)), [len(c) for c in copies])
        clips = [clip for several in copies for clip in several]
        if recipe.frames:
            clips = [resampled(clip, recipe.frames, recipe.paced) for clip in clips]
        index = {label: i for i, label in enumerate(classes)}
        labels = np.array([index[clip.label or ""] for clip in used], dtype=np.int64) if classes else None
        return cls(clips, labels[source] if labels is not None else None, near, source)

    def partners(self, rows: Int64Array, rng: np.random.Generator) -> Tensor | None:
        """A clip of the same class for each, itself at worst; None without classes."""
        if self.targets is None:
            return None
        chosen = [rng.choice(np.flatnonzero(self.targets == self.targets[i])) for i in rows]
        return padded([self.clips[i] for i in chosen])[0]


def _top1(
    network: DescriptorNetwork,
    recipe: DescriptorRecipe,
    used: Sequence[TrainingClip],
    validation: Sequence[TrainingClip],
) -> float:
    """Share of the validation clips whose nearest clip that is trained on has their label."""
    # Descriptors are computed on the CPU, wherever the network is trained.
    model = TrainedDescriptor(DescriptorsConfig(), recipe, deepcopy(network).cpu().eval(), [], {})
    known, queries = (model.embed([clip.sequence for clip in clips]) for clips in (used, validation))
    nearest = (queries @ known.T).argmax(axis=1)
    return float(np.mean([clip.label == used[hit].label for clip, hit in zip(validation, nearest, strict=True)]))


def _classes(clips: Sequence[TrainingClip], supervision: str) -> list[str]:
    """The labels to train with, those of two clips at least, in order; none where training goes without."""
    counts = Counter(clip.label for clip in clips if clip.label is not None)
    classes = sorted(label for label, count in counts.items() if count > 1)
    if supervision == "none" or (supervision == "auto" and len(classes) < 2):
        return []
    if len(classes) < 2:
        raise ValueError("labels are to supervise, but fewer than two classes have two clips each")
    return classes


def _loss(
    network: DescriptorNetwork,
    material: _Material,
    rows: Int64Array,
    recipe: DescriptorRecipe,
    rng: np.random.Generator,
    device: str,
) -> Tensor:
    clips, lengths = padded([material.clips[i] for i in rows])
    if recipe.objective == "contrast":
        clips = recipe.augmentation(clips, rng, material.partners(rows, rng))
    parts = network.learning_parts(clips.to(device), lengths.to(device))
    loss = torch.zeros((), device=device)
    if network.heads is not None and material.targets is not None:
        targets = torch.from_numpy(material.targets[rows]).to(device)
        for logits in network.logits(parts):
            loss = loss + cross_entropy(logits, targets, label_smoothing=recipe.smoothing)
        if recipe.objective == "contrast":
            contrasts = [class_contrast(part, targets, recipe.temperature) for part in parts]
            return loss + recipe.contrast * torch.stack(contrasts).sum()
    assert material.near is not None
    near = torch.from_numpy(material.near[np.ix_(material.source[rows], material.source[rows])]).to(device)
    return loss + torch.stack([contrastive_loss(part, near, recipe.margin) for part in parts]).sum()


def contrastive_loss(descriptors: Tensor, similar: Tensor, margin: float) -> Tensor:
    """Equation 3.1 over all pairs of a batch, similar and dissimilar pairs weighted alike.

    Args:
        descriptors: [B, d].
        similar: [B, B] whether two clips are similar.
        margin: m, how far apart dissimilar clips are pushed.
    """
    squares = (descriptors[:, None] - descriptors[None]).square().sum(dim=-1)
    # The root has no slope at zero.
    short = (margin - (squares + 1e-12).sqrt()).clamp(min=0)
    pairs = torch.triu(torch.ones_like(similar), diagonal=1)
    attracted, repelled = similar & pairs, ~similar & pairs
    return (_mean(squares, attracted) + _mean(short.square(), repelled)) / 2


def class_contrast(descriptors: Tensor, classes: Tensor, temperature: float) -> Tensor:
    """Supervised contrast: of all other clips of a batch, those of the same class should be the nearest.

    Khosla et al., Supervised Contrastive Learning, 2020, equation 2.

    Args:
        descriptors: [B, d].
        classes: [B].
        temperature: of the softmax over cosines.
    """
    itself = torch.eye(len(classes), dtype=torch.bool, device=descriptors.device)
    wanted = ((classes[:, None] == classes[None]) & ~itself).to(descriptors.dtype)
    wanted = wanted / wanted.sum(dim=1, keepdim=True).clamp(min=1)
    unit = normalize(descriptors, dim=1)
    cosines = (unit @ unit.T / temperature).masked_fill(itself, -1e9)
    logarithms = torch.log_softmax(cosines, dim=1).masked_fill(itself, 0)
    return -(wanted * logarithms).sum(dim=1).mean()


def _mean(values: Tensor, chosen: Tensor) -> Tensor:
    return (values * chosen).sum() / chosen.sum().clamp(min=1)
