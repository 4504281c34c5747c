"""Training descriptor networks (DeepHuMS, section 3.2)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from motionlake.arrays import Float32Array, Int64Array, Progress
from motionlake.deephums.batches import at_speeds, order, padded, resampled, windows
from motionlake.deephums.config import DescriptorsConfig
from motionlake.deephums.network import (
    DescriptorNetwork,
    DescriptorRecipe,
    MissingJoints,
    class_contrast,
    contrastive_loss,
    neighbour_contrast,
    recipe_of,
)
from motionlake.deephums.sequence import alignment_distances, neighbourhoods, one_cycle, similar_by_motion
from motionlake.deephums.trained import TrainedDescriptor
from motionlake.training import Checkpoint, Training, on_threads
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import cross_entropy

CHECKPOINT_EVERY: Final = 5
VALIDATE_EVERY: Final = 10


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
        progress: called with (epochs done, epochs, mean loss) after each epoch.

    Returns:
        The network; the same for the same input, configuration and seed, interrupted or not (on CUDA: up to
        rounding). Its metrics: `clips`, `classes` (None without labels), `supervision` used, `loss` of each epoch,
        `validation`: (epoch, top-1 of the validation clips among those trained on) every so often.

    Raises:
        ValueError: too few clips, or labels that were asked for and are not there.
    """
    recipe = recipe or recipe_of(config)
    device = device or ("cuda" if torch.cuda.is_available() else "cpu")
    classes = _classes(clips, config.supervision)
    used = [clip for clip in clips if clip.label in classes] if classes else list(clips)
    if len(used) < 2:
        raise ValueError(f"{len(used)} clips are too few to train on")
    offered = len(used)
    used = [TrainingClip(part, clip.label) for clip in used for part in windows(clip.sequence)]
    rng = np.random.default_rng(config.seed)
    with on_threads(1), torch.random.fork_rng(devices=[]):
        material = _Material.of(used, classes, recipe)
        torch.manual_seed(config.seed)
        network = DescriptorNetwork(recipe, len(classes))
        if isinstance(network.fill, MissingJoints):
            network.fill.learn(torch.from_numpy(np.concatenate([clip.sequence for clip in used])))
        network.to(device)
        data = np.concatenate([clip.sequence.ravel() for clip in used])
        kept = Checkpoint(checkpoint, data, config, recipe) if checkpoint else None
        followed = _Followed(used, validation, recipe) if validation else None
        losses = _fit(network, material, recipe, config.seed, rng, device, kept, progress, followed)
    metrics: dict[str, Any] = {
        "clips": offered,
        "classes": len(classes) or None,
        "supervision": "labels" if classes else "none",
        "loss": [round(loss, 5) for loss in losses],
    }
    if followed is not None:
        metrics["validation"] = followed.top1
    return TrainedDescriptor(config, recipe, network.cpu().eval(), classes, metrics)


@dataclass(frozen=True)
class _Material:
    """n clips to train on.

    Attributes:
        clips: [n] of any length, or all of one.
        targets: [n] class of each clip, or None.
        near: [n, n] how near clips are without labels, or whether pairs are similar.
        source: [n] rows of `near` that clips stand for: copies at other speeds share one.
    """

    clips: list[Float32Array]
    targets: Int64Array | None
    near: NDArray[np.generic] | None
    source: Int64Array

    @classmethod
    def of(cls, used: Sequence[TrainingClip], classes: list[str], recipe: DescriptorRecipe) -> _Material:
        sequences = [clip.sequence for clip in used]
        near: NDArray[np.generic] | None = None
        if recipe.objective == "pairs":
            near = similar_by_motion(sequences, recipe.similar)
        elif not classes:
            near = neighbourhoods(alignment_distances(sequences), recipe.neighbours, recipe.sharpness)
        copies = [at_speeds(clip) if recipe.speeds else [clip] for clip in sequences]
        source = np.repeat(np.arange(len(used)), [len(c) for c in copies])
        clips = [clip for several in copies for clip in several]
        if recipe.frames:
            clips = [resampled(clip, recipe.frames) for clip in clips]
        index = {label: i for i, label in enumerate(classes)}
        labels = np.array([index[clip.label or ""] for clip in used], dtype=np.int64) if classes else None
        return cls(clips, labels[source] if labels is not None else None, near, source)

    def batch(self, rows: Int64Array) -> tuple[Tensor, Tensor]:
        """Clips [B, T, 15, 3] and their lengths [B]."""
        return padded([self.clips[i] for i in rows])

    def partners(self, rows: Int64Array, rng: np.random.Generator) -> Tensor | None:
        """A clip of the same class for each, itself at worst; None without classes."""
        if self.targets is None:
            return None
        chosen = [rng.choice(np.flatnonzero(self.targets == self.targets[i])) for i in rows]
        return padded([self.clips[i] for i in chosen])[0]


class _Followed:
    """Top-1 of validation clips among the clips that are trained on, as training goes on."""

    def __init__(
        self, used: Sequence[TrainingClip], validation: Sequence[TrainingClip], recipe: DescriptorRecipe
    ) -> None:
        self._known, self._asked, self._recipe = used, validation, recipe
        self.top1: list[tuple[int, float]] = []

    def __call__(self, network: DescriptorNetwork, epoch: int) -> None:
        network.eval()
        model = TrainedDescriptor(DescriptorsConfig(), self._recipe, network, [], {})
        known, asked = (model.embed([clip.sequence for clip in clips]) for clips in (self._known, self._asked))
        network.train()
        nearest = (asked @ known.T).argmax(axis=1)
        right = [clip.label == self._known[hit].label for clip, hit in zip(self._asked, nearest, strict=True)]
        self.top1.append((epoch, float(np.mean(right))))


def _classes(clips: Sequence[TrainingClip], supervision: str) -> list[str]:
    """The labels to train with, those of two clips at least, in order; none where training goes without."""
    counts = Counter(clip.label for clip in clips if clip.label is not None)
    classes = sorted(label for label, count in counts.items() if count > 1)
    if supervision == "none" or (supervision == "auto" and len(classes) < 2):
        return []
    if len(classes) < 2:
        raise ValueError("labels are to supervise, but fewer than two classes have two clips each")
    return classes


def _fit(
    network: DescriptorNetwork,
    material: _Material,
    recipe: DescriptorRecipe,
    seed: int,
    rng: np.random.Generator,
    device: str,
    checkpoint: Checkpoint | None,
    progress: Progress | None,
    followed: _Followed | None,
) -> list[float]:
    optimiser = torch.optim.AdamW(
        network.parameters(), lr=recipe.learning_rate, weight_decay=recipe.weight_decay, eps=1e-7
    )

    def rate(share: float) -> float:
        return recipe.learning_rate * one_cycle(share) if recipe.warm_up else recipe.learning_rate

    def after(done: int) -> None:
        if followed is not None and (done % VALIDATE_EVERY == 0 or done == recipe.epochs):
            followed(network, done)

    return Training(
        network, optimiser, recipe.epochs, rate, lambda: order(len(material.clips), recipe.batch, rng),
        lambda rows: _loss(network, material, rows, recipe, rng, device), seed, rng, checkpoint, CHECKPOINT_EVERY,
        progress, after,
    ).run()  # fmt: skip


def _loss(
    network: DescriptorNetwork,
    material: _Material,
    rows: Int64Array,
    recipe: DescriptorRecipe,
    rng: np.random.Generator,
    device: str,
) -> Tensor:
    clips, lengths = material.batch(rows)
    if recipe.objective == "contrast":
        if material.targets is None:  # two variants of each clip: its own other variant is its nearest
            rows, clips = np.tile(rows, 2), clips.repeat(2, 1, 1, 1)
        clips = recipe.augmentation(clips, rng, material.partners(rows, rng))
    parts = network.parts(clips.to(device), lengths.to(device))
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
    if recipe.objective == "pairs":
        return loss + torch.stack([contrastive_loss(part, near, recipe.margin) for part in parts]).sum()
    near = near.masked_fill(torch.eye(len(near), dtype=torch.bool, device=device), 0)
    wanted = near / near.sum(dim=1, keepdim=True)
    return torch.stack([neighbour_contrast(part, wanted, recipe.temperature) for part in parts]).sum()
