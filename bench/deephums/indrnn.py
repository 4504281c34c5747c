"""Recognition embedding after IndRNN: Li et al., Independently Recurrent Neural Network (CVPR 2018).

Taken over: stacked layers in which each unit recurs on itself alone, h_t = relu(W x_t + u * h_(t-1) + b), batch
normalisation after each layer, recurrent weights kept within the bound that lets a gradient live for T steps, the last
state to the classifier; that state is the embedding. Different here: joint-wise motion to the next frame stands beside
the positions, 64 frames of 15 joints rather than 20 of 50, four layers of 512 units rather than six, batch statistics
over clips and frames together, and the budget of the harness.
"""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor, nn

from bench.deephums.baseline import FRAMES, JOINTS, Recogniser, velocities

HIDDEN: Final = 512
LAYERS: Final = 4


class IndependentlyRecurrent(Recogniser):
    """IndRNN-like network.

    Args:
        classes: C.
        frames: T, which bounds the recurrent weights.
        hidden: units a layer.
        layers: how many.
        dropout: between layers, the same units in all frames of a clip.
    """

    def __init__(
        self, classes: int, frames: int = FRAMES, hidden: int = HIDDEN, layers: int = LAYERS, dropout: float = 0.25
    ) -> None:
        super().__init__(hidden, classes)
        widths = [6 * JOINTS, *[hidden] * layers]
        self.layers = nn.ModuleList(
            _Layer(given, hidden, frames, last=i == layers - 1) for i, given in enumerate(widths[:-1])
        )
        self.dropout = dropout

    def embed(self, x: Tensor) -> Tensor:
        state = torch.cat([x, velocities(x)], dim=-1).flatten(2).transpose(0, 1)  # [T, B, 90]
        for layer in self.layers:
            state = layer(state)
            if self.training and self.dropout:
                kept = torch.rand(1, *state.shape[1:], device=state.device) >= self.dropout
                state = state * kept / (1 - self.dropout)
        return state[-1]


class _Layer(nn.Module):
    """[T, B, in] to [T, B, hidden]."""

    def __init__(self, given: int, hidden: int, frames: int, *, last: bool) -> None:
        super().__init__()
        self.bound = 2.0 ** (1.0 / frames)
        self.enter = nn.Linear(given, hidden)
        low = 0.5 ** (1.0 / frames) if last else 0.0  # the last layer starts with long memory
        self.recurrent = nn.Parameter(torch.empty(hidden).uniform_(low, self.bound))
        self.norm = nn.BatchNorm1d(hidden)

    def forward(self, x: Tensor) -> Tensor:
        weights = self.recurrent.clamp(-self.bound, self.bound)
        states = torch.stack(_recur(self.enter(x).unbind(0), weights))
        found: Tensor = self.norm(states.flatten(0, 1))
        return found.view_as(states)


def _recur(entered: tuple[Tensor, ...], weights: Tensor) -> list[Tensor]:
    """h_t = relu(x_t + u * h_(t-1)) of T inputs [B, hidden]."""
    states = [torch.relu(entered[0])]
    for given in entered[1:]:
        states.append(torch.relu(torch.addcmul(given, weights, states[-1])))
    return states
