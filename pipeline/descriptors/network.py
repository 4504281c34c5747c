"""The networks that turn clips into descriptors (DeepHuMS, section 3.2): joints and their motion, read in time."""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor, nn

from pipeline.descriptors.config import DIMENSION
from pipeline.descriptors.recipe import DescriptorRecipe
from pipeline.skeleton.canonical import COMMON

CHANNELS: Final = 2 * 3 * len(COMMON)


class DescriptorNetwork(nn.Module):
    """Descriptors of clips, and how likely each class is where it was trained with classes.

    Attributes:
        head: [C, 512] linear classifier on descriptors (C = 0 without classes).
    """

    def __init__(self, recipe: DescriptorRecipe, classes: int = 0) -> None:
        super().__init__()
        encoders = {"conv_gru": ConvolutionalGru, "lstm": Lstm}
        self.encoder = encoders[recipe.encoder](recipe)
        self.head = nn.Linear(DIMENSION, classes) if classes else None

    def forward(self, clips: Tensor, lengths: Tensor | None = None) -> Tensor:
        """[B, 512] descriptors of clips [B, T, 15, 3]; of clip i the first lengths[i] frames count."""
        return self.encoder(clips, lengths)  # type: ignore[no-any-return]


class ConvolutionalGru(nn.Module):
    """Strided convolutions over time, a GRU both ways, mean and maximum over time. Clips of equal length."""

    def __init__(self, recipe: DescriptorRecipe) -> None:
        super().__init__()
        hidden, dropout = recipe.hidden, recipe.dropout
        self.standardise = nn.BatchNorm1d(CHANNELS)
        self.convolutions = nn.Sequential(
            _convolution(CHANNELS, hidden, 5, 1, dropout),
            _convolution(hidden, hidden, 5, 2, dropout),
            _convolution(hidden, hidden, 3, 2, dropout),
        )
        self.recurrent = nn.GRU(hidden, hidden, batch_first=True, bidirectional=True)
        self.dropout = nn.Dropout(dropout)
        self.project = nn.Linear(4 * hidden, DIMENSION)

    def forward(self, clips: Tensor, _lengths: Tensor | None = None) -> Tensor:
        """[B, 512] of clips [B, T, 15, 3]; `lengths` is not used."""
        seen = self.convolutions(self.standardise(displacement_and_motion(clips).transpose(1, 2)))
        states, _ = self.recurrent(seen.transpose(1, 2))
        pooled = torch.cat([states.mean(dim=1), states.amax(dim=1)], dim=1)
        return self.project(self.dropout(pooled))  # type: ignore[no-any-return]


class Lstm(nn.Module):
    """The thesis's: an LSTM over the frames as they are; its last state gives the descriptor."""

    def __init__(self, recipe: DescriptorRecipe) -> None:
        super().__init__()
        self.recurrent = nn.LSTM(CHANNELS, recipe.hidden, batch_first=True)
        self.project = nn.Linear(recipe.hidden, DIMENSION)

    def forward(self, clips: Tensor, lengths: Tensor | None = None) -> Tensor:
        """[B, 512] of clips [B, T, 15, 3], of which the first `lengths` [B] frames count."""
        states, _ = self.recurrent(positions_and_motion(clips))
        last = torch.full((len(clips),), clips.shape[1]) if lengths is None else lengths
        return self.project(states[torch.arange(len(clips)), last - 1])  # type: ignore[no-any-return]


def positions_and_motion(clips: Tensor) -> Tensor:
    """[B, T, 90] joints and their motion to the next frame (the thesis's input), of clips [B, T, 15, 3]."""
    return torch.cat([clips.flatten(2), _motion(clips).flatten(2)], dim=2)


def displacement_and_motion(clips: Tensor) -> Tensor:
    """[B, T, 90] displacement of the joints from the posture that a clip starts and ends in, and their motion to the
    next frame, each divided by its root mean square over the clip: how a body moves, not how far nor how it stands.
    """
    ends = torch.cat([clips[:, :2], clips[:, -2:]], dim=1).mean(dim=1, keepdim=True)
    return torch.cat([_unit(clips - ends).flatten(2), _unit(_motion(clips)).flatten(2)], dim=2)


def _motion(clips: Tensor) -> Tensor:
    motion = torch.zeros_like(clips)
    motion[:, :-1] = clips[:, 1:] - clips[:, :-1]
    return motion


def _unit(values: Tensor) -> Tensor:
    squares = values.square().sum(dim=(2, 3), keepdim=True).mean(dim=1, keepdim=True)
    return values / (squares + 1e-8).sqrt()


def _convolution(inputs: int, outputs: int, width: int, stride: int, dropout: float) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv1d(inputs, outputs, width, stride, width // 2),
        nn.BatchNorm1d(outputs),
        nn.GELU(),
        nn.Dropout(dropout),
    )
