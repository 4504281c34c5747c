"""What encodes clips in a descriptor network: what encoders read, and the networks over it (DeepHuMS, section 3.2)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import torch
from motionlake.deephums.sketch import unit
from motionlake.motion.skeleton import COMMON
from torch import Tensor, nn

CHANNELS: Final = 2 * 3 * len(COMMON)
NOISE: Final = 0.02  # of a joint that is there, body lengths


class MissingJoints(nn.Module):
    """Joints that are zero in all frames, by linear regression on those that are not (the mean of a Gaussian)."""

    mean: Tensor
    covariance: Tensor

    def __init__(self) -> None:
        super().__init__()
        size = 3 * (len(COMMON) - 1)  # the root's place holds its path
        self.register_buffer("mean", torch.zeros(size))
        self.register_buffer("covariance", torch.eye(size))

    def learn(self, frames: Tensor) -> None:
        """From postures [n, 15, 3] of which no joint is missing."""
        rows = frames[:, 1:].flatten(1)
        self.mean.copy_(rows.mean(dim=0))
        self.covariance.copy_(torch.cov(rows.T) + NOISE**2 * torch.eye(rows.shape[1]))

    def forward(self, clips: Tensor) -> Tensor:
        """[B, T, 15, 3] clips without missing joints."""
        gone = (clips[:, :, 1:] == 0).all(dim=3).all(dim=1)
        some = gone.any(dim=1) & ~gone.all(dim=1)
        if not bool(some.any()):
            return clips
        there = (~gone[some]).repeat_interleave(3, dim=1).to(clips.dtype)
        both = there[:, :, None] * there[:, None]
        known = self.covariance * both + torch.diag_embed(1 - there)
        apart = (clips[some, :, 1:].flatten(2) - self.mean) * there[:, None]
        weights = torch.linalg.solve(known, apart.transpose(1, 2))
        guessed = (self.covariance @ (weights * there[..., None])).transpose(1, 2) + self.mean
        body = torch.where(there[:, None] > 0, clips[some, :, 1:].flatten(2), guessed)
        filled = clips.clone()
        filled[some, :, 1:] = body.reshape(*body.shape[:2], -1, 3)
        return filled


class ConvolutionalGru(nn.Module):
    """Strided convolutions over time, a GRU both ways, mean and maximum over time. Clips of equal length.

    Args:
        reading: of `READINGS`, what enters.
        convolutions: width and stride of each.
        hidden: channels, and units of the GRU each way.
        dropout: share of numbers dropped while training.
        width: of what comes out.
    """

    def __init__(
        self, reading: str, convolutions: Sequence[tuple[int, int]], hidden: int, dropout: float, width: int
    ) -> None:
        super().__init__()
        self.reading, channels = READINGS[reading]
        self.standardise = nn.BatchNorm1d(channels)
        inputs = [channels, *[hidden] * (len(convolutions) - 1)]
        self.convolutions = nn.Sequential(
            *(_convolution(i, hidden, *one, dropout) for i, one in zip(inputs, convolutions, strict=True))
        )
        self.recurrent = nn.GRU(hidden, hidden, batch_first=True, bidirectional=True)
        self.dropout = nn.Dropout(dropout)
        self.project = nn.Linear(4 * hidden, width)

    def forward(self, clips: Tensor, _lengths: Tensor | None = None) -> Tensor:
        """[B, width] of clips [B, T, 15, 3]; `lengths` is not used."""
        seen = self.convolutions(self.standardise(self.reading(clips).transpose(1, 2)))
        states, _ = self.recurrent(seen.transpose(1, 2))
        pooled = torch.cat([states.mean(dim=1), states.amax(dim=1)], dim=1)
        return self.project(self.dropout(pooled))  # type: ignore[no-any-return]


class Lstm(nn.Module):
    """The thesis's: an LSTM over the frames as they are; its last state gives the descriptor."""

    def __init__(self, hidden: int, width: int) -> None:
        super().__init__()
        self.recurrent = nn.LSTM(CHANNELS, hidden, batch_first=True)
        self.project = nn.Linear(hidden, width)

    def forward(self, clips: Tensor, lengths: Tensor | None = None) -> Tensor:
        """[B, width] of clips [B, T, 15, 3], of which the first `lengths` [B] frames count."""
        states, _ = self.recurrent(positions_and_motion(clips))
        last = torch.full((len(clips),), clips.shape[1]) if lengths is None else lengths
        return self.project(states[torch.arange(len(clips)), last - 1])  # type: ignore[no-any-return]


def positions_and_motion(clips: Tensor) -> Tensor:
    """[B, T, 90] joints and their motion to the next frame (the thesis's input), of clips [B, T, 15, 3]."""
    return torch.cat([clips.flatten(2), motion_of(clips).flatten(2)], dim=2)


def displacement_and_motion(clips: Tensor) -> Tensor:
    """[B, T, 90] displacement of the joints from the posture that a clip starts and ends in, and their motion to the
    next frame, each divided by its root mean square over the clip: how a body moves, not how far nor how it stands.
    """
    ends = torch.cat([clips[:, :2], clips[:, -2:]], dim=1).mean(dim=1, keepdim=True)
    return torch.cat([unit(clips - ends).flatten(2), unit(motion_of(clips)).flatten(2)], dim=2)


def positions_and_speed(clips: Tensor) -> Tensor:
    """[B, T, 90] joints and their velocity, in body lengths a quarter of the clip."""
    return torch.cat([clips.flatten(2), motion_of(clips).flatten(2) * (clips.shape[1] / 4)], dim=2)


def motion_of(clips: Tensor) -> Tensor:
    """[B, T, J, 3] from each frame of clips [B, T, J, 3] to the next; zero in the last."""
    motion = torch.zeros_like(clips)
    motion[:, :-1] = clips[:, 1:] - clips[:, :-1]
    return motion


class Reading(NamedTuple):
    """What an encoder reads of clips [B, T, 15, 3], and how many numbers a frame that is."""

    of: Callable[[Tensor], Tensor]
    channels: int


# How a body moves, and where its joints are.
READINGS: Final = {
    "moves": Reading(displacement_and_motion, CHANNELS),
    "joints": Reading(positions_and_speed, CHANNELS),
}


def _convolution(inputs: int, outputs: int, width: int, stride: int, dropout: float) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv1d(inputs, outputs, width, stride, width // 2),
        nn.BatchNorm1d(outputs),
        nn.GELU(),
        nn.Dropout(dropout),
    )
