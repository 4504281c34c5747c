"""One way to train every baseline: the same batches, augmentation, schedule and budget."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np
import torch
from motionlake.arrays import Float32Array
from motionlake.training import on_threads
from numpy.typing import NDArray
from torch import Tensor, nn

from bench.deephums.baseline import Baseline
from bench.fitting import BATCH, Budget, Training

Augment = Callable[[Tensor, Tensor], Tensor]


@dataclass(frozen=True)
class Clips:
    """n clips of one length [n, T, 15, 3], their classes [n] from 0, who performs them [n]."""

    x: Float32Array
    labels: NDArray[np.int64]
    subjects: tuple[str, ...]

    def of(self, rows: NDArray[np.integer]) -> Clips:
        """Some of them."""
        return Clips(self.x[rows], self.labels[rows], tuple(self.subjects[i] for i in rows))


@dataclass(frozen=True)
class Epoch:
    """One epoch.

    Attributes:
        loss: mean of its batches.
        retrieval: top-1 of the clips held out, asked of the clips trained on by embedding; None without such.
        recognition: top-1 of the classifier on the clips held out; None without them or without classes.
        seconds: of training up to its end, without validation.
    """

    loss: float
    retrieval: float | None
    recognition: float | None
    seconds: float


@dataclass(frozen=True)
class Fitted:
    """A trained network, in evaluation mode, and its epochs."""

    network: Baseline
    epochs: tuple[Epoch, ...]


def split_subject(clips: Clips, subject: str | None = None) -> tuple[Clips, Clips]:
    """Clips to train on, and those of one subject, held out (by default the last by name).

    Raises:
        ValueError: no such subject, or nobody else.
    """
    known = sorted(set(clips.subjects))
    chosen = known[-1] if subject is None and known else subject
    if chosen not in known or len(known) < 2:
        raise ValueError(f"subject {chosen!r} cannot be held out of {', '.join(known) or 'nobody'}")
    held = np.array([name == chosen for name in clips.subjects])
    return clips.of(np.flatnonzero(~held)), clips.of(np.flatnonzero(held))


def fit(
    build: Callable[[], nn.Module],
    clips: Clips,
    budget: Budget,
    *,
    seed: int,
    held_out: Clips | None = None,
    augment: Augment = lambda x, labels: x,
    device: str = "cpu",
) -> Fitted:
    """Train a network with AdamW, the learning rate rising to its peak and falling to nothing (one cycle).

    Args:
        build: makes the network, a `Baseline`, with weights drawn from torch's generator.
        clips: to train on.
        budget: when to end.
        seed: of weights, order of batches and whatever `augment` draws from torch's generator.
        held_out: clips of a subject whose top-1 is told after every epoch.
        augment: a batch [B, T, 15, 3] and its labels [B] to another batch of its shape.
        device: of the computation.

    Returns:
        The network; the same for the same input and seed on one machine, unless seconds end it.

    Raises:
        ValueError: fewer than two clips.
    """
    if len(clips.labels) < 2:
        raise ValueError(f"{len(clips.labels)} clips are too few to train on")
    with on_threads(1), torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = build().to(device)
        cast(Baseline, network).prepare(torch.from_numpy(clips.x).to(device))
        x, labels = torch.from_numpy(clips.x), torch.from_numpy(clips.labels)

        def loss(rows: Tensor) -> Tensor:
            augmented = augment(x[rows], labels[rows]).to(device)
            return cast(Baseline, network).loss(augmented, labels[rows].to(device))

        training = Training(network, len(x), budget)
        epochs: list[Epoch] = []
        while not training.over:
            mean = training.epoch(loss)
            epochs.append(Epoch(mean, *_validated(network, clips, held_out, device), training.seconds))
        network.eval()
    return Fitted(cast(Baseline, network), tuple(epochs))


def embed(network: Baseline, x: Float32Array, device: str = "cpu") -> tuple[Float32Array, Float32Array | None]:
    """Embeddings [n, d] and logits [n, C] (None without classes) of clips [n, T, 15, 3], in evaluation mode."""
    module = cast(nn.Module, network).eval()
    with torch.no_grad():
        found = [module(rows.to(device)) for rows in torch.split(torch.from_numpy(x), 4 * BATCH)]
    embeddings = torch.cat([embedding for embedding, _ in found]).cpu().numpy()
    if found[0][1] is None:
        return embeddings, None
    return embeddings, torch.cat([logits for _, logits in found]).cpu().numpy()


def _validated(
    network: nn.Module, clips: Clips, held_out: Clips | None, device: str
) -> tuple[float | None, float | None]:
    if held_out is None or not len(held_out.labels):
        return None, None
    model = cast(Baseline, network)
    known, _ = embed(model, clips.x, device)
    asked, logits = embed(model, held_out.x, device)
    nearest = torch.cdist(torch.from_numpy(asked), torch.from_numpy(known)).argmin(dim=1).numpy()
    retrieval = float(np.mean(clips.labels[nearest] == held_out.labels))
    if logits is None:
        return retrieval, None
    return retrieval, float(np.mean(logits.argmax(axis=1) == held_out.labels))
