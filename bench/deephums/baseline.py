"""What the baselines have in common: clips of one length in, embeddings out."""

from __future__ import annotations

from typing import Final, Protocol

import torch
from torch import Tensor, nn

FRAMES: Final = 64
JOINTS: Final = 15


class Baseline(Protocol):
    """A network from clips to embeddings; a `torch.nn.Module`."""

    def __call__(self, x: Tensor) -> tuple[Tensor, Tensor | None]:
        """Embeddings [B, d] and class logits [B, C] (None without classes) of clips x [B, T, 15, 3]."""
        ...

    def prepare(self, x: Tensor) -> None:
        """Looks at all clips to train on [n, T, 15, 3] before the first step."""
        ...

    def loss(self, x: Tensor, labels: Tensor) -> Tensor:
        """What training makes small; labels [B] int64, which a network without classes does not look at."""
        ...


class Recogniser(nn.Module):
    """A network of which the layer before the classifier is the embedding; trained by cross-entropy."""

    def __init__(self, width: int, classes: int) -> None:
        super().__init__()
        self.classifier = nn.Linear(width, classes)

    def embed(self, x: Tensor) -> Tensor:
        """[B, d] of clips [B, T, 15, 3]."""
        raise NotImplementedError

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor | None]:
        embedding = self.embed(x)
        return embedding, self.classifier(embedding)

    def prepare(self, x: Tensor) -> None:
        """Nothing to prepare: what enters is normalised by the batch."""

    def loss(self, x: Tensor, labels: Tensor) -> Tensor:
        return nn.functional.cross_entropy(self(x)[1], labels)


def velocities(x: Tensor) -> Tensor:
    """[B, T, J, 3] motion to the next frame; none in the last."""
    return torch.cat([x[:, 1:] - x[:, :-1], torch.zeros_like(x[:, :1])], dim=1)
