"""LSTMs that predict the next pose, and how two papers feed them in training so that errors do not add up.

Auto-conditioned LSTM: Zhou et al., Auto-Conditioned Recurrent Networks for Extended Complex Human Motion Synthesis
(ICLR 2018). Taken over: three layers; true poses and own outputs alternate, five of each, from the beginning of a
sequence on; the output is the next pose itself, at every step; MSE. Different here: width, class prior, no root motion.

Scheduled sampling: Bengio et al., Scheduled Sampling for Sequence Prediction with Recurrent Neural Networks (NIPS
2015). Taken over: every step after what is given takes the true pose with a probability that falls with the training
(inverse sigmoid decay), tossed for each example and step. Different here: poses for words; one layer.
"""

from __future__ import annotations

import math
from typing import Final

import torch
from torch import Tensor, nn

from bench.glogen.baseline import Network, Shape, with_prior

TRUE_STEPS: Final = 5
OWN_STEPS: Final = 5
LAYERS: Final = 3
DECAY: Final = 50.0  # k of the inverse sigmoid


class NextPose(Network):
    """A stack of LSTMs from a pose to the next.

    Args:
        shape: of the task.
        layers: of the stack.
    """

    def __init__(self, shape: Shape, layers: int) -> None:
        super().__init__()
        self._horizon, self._residual = shape.horizon, shape.settings.residual is True
        self.lstm = nn.LSTM(shape.entered, shape.settings.hidden, layers, batch_first=True)
        self.out = nn.Linear(shape.settings.hidden, shape.width)

    def truths(self, count: int, steps: int, past: int, done: float) -> Tensor:
        """[count, steps] bool: which steps of a sequence are fed the true pose in training."""
        raise NotImplementedError

    def loss(self, past: Tensor, future: Tensor, prior: Tensor, done: float) -> Tensor:
        poses = torch.cat([past, future], dim=1)
        fed = poses[:, :-1]
        found = self.unroll(fed, prior, self.truths(len(fed), fed.shape[1], past.shape[1], done))
        return nn.functional.mse_loss(found, poses[:, 1:])

    def extend(self, past: Tensor, prior: Tensor, chance: torch.Generator | None) -> Tensor:
        given, steps = past.shape[1], past.shape[1] + self._horizon - 1
        poses = torch.cat([past, past.new_zeros(len(past), steps - given, past.shape[2])], dim=1)
        truths = torch.arange(steps).expand(len(past), -1) < given
        return self.unroll(poses, prior, truths)[:, given - 1 :]

    def unroll(self, poses: Tensor, prior: Tensor, truths: Tensor) -> Tensor:
        """[B, T, D] next poses.

        Args:
            poses: [B, T, D] true ones.
            prior: [B, C].
            truths: [B, T] bool: where a step is fed the true pose; elsewhere the output of the step before. The
                first step always is.
        """
        everywhere, state, step = truths.all(dim=0).tolist(), None, 0
        found: list[Tensor] = []
        while step < poses.shape[1]:
            stop = step + 1
            if step == 0 or everywhere[step]:
                while stop < poses.shape[1] and everywhere[stop]:
                    stop += 1
                fed = poses[:, step:stop]
            else:
                fed = torch.where(truths[:, step:stop, None], poses[:, step:stop], found[-1][:, -1:])
            states, state = self.lstm(with_prior(fed, prior), state)
            moved = self.out(states)
            found.append(fed + moved if self._residual else moved)
            step = stop
        return torch.cat(found, dim=1)


class AutoConditioned(NextPose):
    """acLSTM."""

    def __init__(self, shape: Shape) -> None:
        super().__init__(shape, LAYERS)

    def truths(self, count: int, steps: int, past: int, done: float) -> Tensor:
        return (torch.arange(steps) % (TRUE_STEPS + OWN_STEPS) < TRUE_STEPS).expand(count, -1)


class ScheduledSampling(NextPose):
    """Scheduled sampling."""

    def __init__(self, shape: Shape) -> None:
        super().__init__(shape, 1)

    def truths(self, count: int, steps: int, past: int, done: float) -> Tensor:
        return (torch.rand(count, steps) < truth_probability(done)) | (torch.arange(steps) < past)


def truth_probability(done: float) -> float:
    """k / (k + exp(i / k)) at iteration i: inverse sigmoid decay, with training as long as brings it to k / (k + k^2).

    That is 2 k ln(k) iterations, so that half of the steps are true after half of the training.
    """
    return DECAY / (DECAY + math.exp(done * 2 * math.log(DECAY)))
