"""Training until the loss on what is held out stops falling: its measures, and the network that had the least."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

import torch
from torch import Tensor, nn

Network = TypeVar("Network", bound=nn.Module)


class Watched(nn.Module, Generic[Network]):
    """A network in training with what tells when to stop: one module, so that a checkpoint keeps all of it.

    Attributes:
        best: the network as it was when its loss was least; as it began, before the first measure.

    Args:
        network: that is trained.
        measures: how many there will be at most.
        numbers: of a measure: the loss first, and what is noted beside it.
    """

    found: Tensor

    def __init__(self, network: Network, measures: int, numbers: int = 1) -> None:
        super().__init__()
        self.network, self.best = network, copy.deepcopy(network)
        self.register_buffer("found", torch.full((measures, numbers), torch.nan, dtype=torch.float64))

    @property
    def measures(self) -> list[list[float]]:
        """[[loss, ...]] so far."""
        return [row for row in self.found.tolist() if row[0] == row[0]]

    @property
    def losses(self) -> list[float]:
        """The loss of each measure so far."""
        return [row[0] for row in self.measures]

    def add(self, loss: float, *beside: float) -> None:
        """Enter a measure, and keep the weights if its loss is the least."""
        before = self.losses
        self.found[len(before)] = torch.tensor([loss, *beside], dtype=torch.float64)
        if not before or loss < min(before):
            self.best.load_state_dict(self.network.state_dict())


def stands_still(losses: Sequence[float], patience: int, below: Callable[[float], float]) -> bool:
    """Whether the last `patience` of some losses have not fallen; never with a patience of 0.

    Args:
        losses: in their order.
        patience: how many.
        below: what a loss has to be less than to have fallen, by the least that had before it.
    """
    least, since = float("inf"), 0
    for loss in losses:
        least, since = (loss, 0) if loss < below(least) else (least, since + 1)
    return 0 < patience <= since
