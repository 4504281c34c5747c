"""Recognition embedding after HCN: Li et al., Co-occurrence Feature Learning from Skeleton Data (IJCAI 2018).

Taken over: two streams of the same layers over joint positions and over motion to the next frame; point-wise and
temporal convolutions for each joint (conv1 and conv2), then joints become channels, so that conv3 and conv4 see all
joints at once; streams concatenated, conv5, conv6 and two fully connected layers with dropout; the layer before the
classifier is the embedding; 32 frames, here every other one of those given. Different here: one body, 15 joints, batch
normalisation after each convolution, global positions replaced by positions seen from the body, and the budget of the
harness.
"""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor, nn

from bench.deephums.baseline import FRAMES, JOINTS, Recogniser, velocities

WIDTH: Final = 256
BASE: Final = 32


class HierarchicalCooccurrence(Recogniser):
    """HCN-like network.

    Args:
        classes: C.
        frames: T, a multiple of 32.
        dropout: after conv4, conv5 and conv6 and before the classifier.
        base: channels of conv2 and conv3, a multiple of 16; the other layers have 2, 4 and 8 times as many.
    """

    def __init__(self, classes: int, frames: int = FRAMES, dropout: float = 0.5, base: int = BASE) -> None:
        super().__init__(WIDTH, classes)
        self.position_stream, self.motion_stream = _Stream(dropout, base), _Stream(dropout, base)
        self.joined = nn.Sequential(
            _convolution(4 * base, 4 * base), nn.MaxPool2d(2), nn.Dropout2d(dropout),
            _convolution(4 * base, 8 * base), nn.MaxPool2d(2),
        )  # fmt: skip
        self.embedding = nn.Sequential(
            nn.Dropout(dropout), nn.Linear(8 * base * (frames // 32) * (base // 16), WIDTH), nn.ReLU(),
            nn.Dropout(dropout),
        )  # fmt: skip

    def embed(self, x: Tensor) -> Tensor:
        x = x[:, ::2]
        streams = [self.position_stream(x), self.motion_stream(velocities(x))]
        found: Tensor = self.embedding(self.joined(torch.cat(streams, dim=1)).flatten(1))
        return found


class _Stream(nn.Module):
    """[B, T, 15, 3] to [B, 2 base, T / 4, base / 4], T of the frames that are left."""

    def __init__(self, dropout: float, base: int) -> None:
        super().__init__()
        self.of_joint = nn.Sequential(
            nn.BatchNorm2d(3),
            nn.Conv2d(3, 2 * base, 1), nn.BatchNorm2d(2 * base), nn.ReLU(),
            nn.Conv2d(2 * base, base, (3, 1), padding=(1, 0)), nn.BatchNorm2d(base),
        )  # fmt: skip
        self.of_all = nn.Sequential(
            _convolution(JOINTS, base), nn.MaxPool2d(2),
            _convolution(base, 2 * base), nn.MaxPool2d(2), nn.Dropout2d(dropout),
        )  # fmt: skip

    def forward(self, x: Tensor) -> Tensor:
        local: Tensor = self.of_joint(x.permute(0, 3, 1, 2))  # [B, base, T, 15]
        found: Tensor = self.of_all(local.permute(0, 3, 2, 1))  # joints are channels: [B, 15, T, base]
        return found


def _convolution(given: int, wanted: int) -> nn.Sequential:
    return nn.Sequential(nn.Conv2d(given, wanted, 3, padding=1), nn.BatchNorm2d(wanted), nn.ReLU())
