"""The decoder that all encoder-decoder baselines share: one pose after the other, from its own output."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import torch
from torch import Tensor, nn

from bench.glogen.baseline import Shape

State = tuple[Tensor, Tensor]


class Decoder(nn.Module):
    """An LSTM that is fed its own last pose, the class prior and a context.

    Training and prediction run it alike ("sampling-based loss" of Martinez et al., On Human Motion Prediction Using
    Recurrent Neural Networks, CVPR 2017), and its output is added to the pose it is fed (their residual connection)
    unless the settings say otherwise.

    Args:
        shape: of the task.
        context: length of the context.
    """

    def __init__(self, shape: Shape, context: int = 0) -> None:
        super().__init__()
        self._horizon, self._residual = shape.horizon, shape.settings.residual is not False
        self.cell = nn.LSTMCell(shape.entered + context, shape.settings.hidden)
        self.out = nn.Linear(shape.settings.hidden, shape.width)

    def forward(
        self, pose: Tensor, prior: Tensor, state: State, context: Callable[[Tensor], Tensor] | None = None
    ) -> Tensor:
        """[B, H, D] after the pose [B, D].

        Args:
            pose: the last one given.
            prior: [B, C].
            state: hidden and cell state [B, hidden] to begin with.
            context: of a hidden state [B, hidden], what enters beside the pose.
        """
        poses = []
        for _ in range(self._horizon):
            entered = [pose, prior] if context is None else [pose, prior, context(state[0])]
            state = cast(State, self.cell(torch.cat(entered, dim=1), state))
            moved = self.out(state[0])
            pose = pose + moved if self._residual else moved
            poses.append(pose)
        return torch.stack(poses, dim=1)
