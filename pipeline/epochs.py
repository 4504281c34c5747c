"""The loop over epochs and batches that networks are trained by, which can be gone on from where it was interrupted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Literal, Protocol

import numpy as np
import torch
from motionlake.arrays import Progress
from motionlake.checkpoint import Checkpoint
from numpy.typing import NDArray
from torch import Tensor, nn

STEEPEST: Final = 1.0  # norm that gradients are cut to


@dataclass(frozen=True)
class Training:
    """What is trained, and how.

    Attributes:
        network: in training mode from the first epoch on.
        optimiser: of its parameters.
        epochs: how many.
        rate: learning rate when a share (0 to 1) of the training is done.
        batches: of an epoch, the examples of each, drawn anew.
        loss: of the examples of a batch.
        seed: of torch's chance in each epoch, so that it is the same after a resumption.
        rng: that `batches` and `loss` draw from.
        checkpoint: a file that keeps the training, deleted at the end.
        every: epochs from one checkpoint to the next.
        stays: the file stays at the end, for a training of several networks that is interrupted at a later one.
        progress: called with (epochs done, epochs, mean loss).
        after: called with the epochs done, before `progress`.
    """

    network: nn.Module
    optimiser: torch.optim.Optimizer
    epochs: int
    rate: Callable[[float], float]
    batches: Callable[[], Sequence[NDArray[np.int64]]]
    loss: Callable[[NDArray[np.int64]], Tensor]
    seed: int
    rng: np.random.Generator
    checkpoint: Checkpoint | None = None
    every: int = 10
    progress: Progress | None = None
    after: Callable[[int], None] | None = None
    stays: bool = False

    def run(self) -> list[float]:
        """Train to the end; returns the mean loss of each epoch, those before a resumption too."""
        kept = self.checkpoint
        losses = kept.resume(self.network, self.optimiser, self.rng) if kept else []
        self.network.train()
        for epoch in range(len(losses), self.epochs):
            torch.manual_seed(self.seed * 100_003 + epoch)
            losses.append(self._epoch(epoch))
            done = epoch + 1
            if kept and (done % self.every == 0 or (self.stays and done == self.epochs)):
                kept.save(self.network, self.optimiser, self.rng, losses)
            if self.after is not None:
                self.after(done)
            if self.progress is not None:
                self.progress(done, self.epochs, losses[-1])
        if kept and not self.stays:
            kept.remove()
        return losses

    def _epoch(self, epoch: int) -> float:
        batches = self.batches()
        total = 0.0
        for step, rows in enumerate(batches):
            for group in self.optimiser.param_groups:
                group["lr"] = self.rate((epoch + step / len(batches)) / self.epochs)
            self.optimiser.zero_grad(set_to_none=True)
            loss = self.loss(rows)
            loss.backward()  # type: ignore[no-untyped-call]
            nn.utils.clip_grad_norm_(self.network.parameters(), STEEPEST)
            self.optimiser.step()
            total += float(loss.detach())
        return total / len(batches)


class Rates(Protocol):
    """What a recipe says of its optimiser."""

    @property
    def optimiser(self) -> Literal["adam", "sgd"]: ...
    @property
    def learning_rate(self) -> float: ...
    @property
    def weight_decay(self) -> float: ...


def optimiser_of(network: nn.Module, recipe: Rates) -> torch.optim.Optimizer:
    """AdamW; plain descent, as a thesis has it, by name."""
    if recipe.optimiser == "sgd":
        return torch.optim.SGD(network.parameters(), lr=recipe.learning_rate)
    return torch.optim.AdamW(network.parameters(), lr=recipe.learning_rate, weight_decay=recipe.weight_decay)


def rate_of(recipe: Rates) -> Callable[[float], float]:
    """The learning rate at a share of the training: down to nothing by a cosine; that of plain descent stays."""
    if recipe.optimiser == "sgd":
        return lambda share: recipe.learning_rate
    return lambda share: recipe.learning_rate * 0.5 * (1 + float(np.cos(np.pi * share)))
