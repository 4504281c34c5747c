"""How long baseline networks are trained and at what rate: one budget, one schedule, one loop over batches."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from torch import Tensor, nn

BATCH: Final = 64
WARM: Final = 0.3  # share of the budget over which the learning rate rises


@dataclass(frozen=True)
class Budget:
    """When training ends: after so many epochs, or seconds where they are given and over sooner.

    With seconds, what a network becomes depends on the machine. Where the epochs have fewer steps than `steps`, there
    are more of them.
    """

    epochs: int = 60
    steps: int = 0
    seconds: float | None = None
    learning_rate: float = 2e-3
    weight_decay: float = 1e-2

    def epochs_of(self, count: int) -> int:
        """How many epochs are trained on so many examples."""
        return max(self.epochs, -(-self.steps // max(1, -(-count // BATCH))))


class Training:
    """AdamW over batches, the learning rate rising to its peak and falling to nothing (one cycle).

    Args:
        network: whose parameters are trained.
        count: of examples.
        budget: when to end.

    Attributes:
        seconds: spent in epochs.
        done: share of the budget that was spent before the batch in work.
    """

    def __init__(self, network: nn.Module, count: int, budget: Budget) -> None:
        self._network, self._count, self._budget = network, count, budget
        self._optimiser = torch.optim.AdamW(network.parameters(), weight_decay=budget.weight_decay)
        self._last, self._epochs = budget.epochs_of(count), 0
        self.seconds, self.done = 0.0, 0.0

    @property
    def over(self) -> bool:
        seconds = self._budget.seconds
        return self._epochs >= self._last or (seconds is not None and self.seconds >= seconds)

    def epoch(self, loss: Callable[[Tensor], Tensor]) -> float:
        """Mean loss of one pass in an order drawn anew; a last batch of one joins the one before it.

        Args:
            loss: of the examples with these numbers [B].
        """
        started = time.perf_counter()
        self._network.train()
        batches = list(torch.split(torch.randperm(self._count), BATCH))
        if len(batches) > 1 and len(batches[-1]) == 1:
            batches[-2:] = [torch.cat(batches[-2:])]
        losses = []
        for place, rows in enumerate(batches):
            spent = self.seconds + time.perf_counter() - started
            self._set_rate((self._epochs + place / len(batches)) / self._last, spent)
            self._optimiser.zero_grad(set_to_none=True)
            found = loss(rows)
            found.backward()  # type: ignore[no-untyped-call]
            nn.utils.clip_grad_norm_(self._network.parameters(), 5.0)
            self._optimiser.step()
            losses.append(float(found.detach()))
        self._epochs += 1
        self.seconds += time.perf_counter() - started
        return float(np.mean(losses))

    def _set_rate(self, done: float, spent: float) -> None:
        if self._budget.seconds is not None:
            done = max(done, spent / self._budget.seconds)
        self.done = min(done, 1.0)
        for group in self._optimiser.param_groups:
            group["lr"] = self._budget.learning_rate * one_cycle(self.done)


def one_cycle(done: float) -> float:
    """Share of the peak learning rate when a share `done` of the budget is spent: cosines up from 1/25, down to 0."""
    if done < WARM:
        return float(1 / 25 + (1 - 1 / 25) * (1 - np.cos(np.pi * done / WARM)) / 2)
    return float((1 + np.cos(np.pi * (done - WARM) / (1 - WARM))) / 2)
