"""Deep autoencoder descriptor after Wang and Neff, Deep Signatures for Indexing and Retrieval (MIG 2015).

Taken over: a motion segment of fixed length is encoded by deep fully connected autoencoders, one for each functional
part of the body, and the concatenated bottlenecks are its signature; no labels. Different here: clips are resampled
rather than cut to the fixed length; the parts are five of three joints each (trunk, arms, legs) as joint positions; no
layer-wise pretraining, but batch normalisation and end-to-end training; the signature keeps its 160 numbers (32 a
part) as they are instead of one bit each, since bits would only lose.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Final

import torch
from motionlake.motion.skeleton import COMMON
from torch import Tensor, nn

from bench.deephums.baseline import FRAMES

PARTS: Final = (
    ("hips", "neck", "head"),
    ("left_shoulder", "left_elbow", "left_wrist"),
    ("right_shoulder", "right_elbow", "right_wrist"),
    ("left_hip", "left_knee", "left_ankle"),
    ("right_hip", "right_knee", "right_ankle"),
)
WIDTHS: Final = (512, 256, 128, 64, 32)


class DeepAutoencoder(nn.Module):
    """Five autoencoders of five encoding and five decoding layers.

    Args:
        frames: T of the clips.
        widths: of the encoding layers; the last is the signature of a part.
    """

    order: Tensor
    mean: Tensor
    scale: Tensor

    def __init__(self, frames: int = FRAMES, widths: tuple[int, ...] = WIDTHS) -> None:
        super().__init__()
        joints = [[COMMON.index(name) for name in part] for part in PARTS]
        self.register_buffer("order", torch.tensor(joints))
        self.register_buffer("mean", torch.zeros(frames, len(PARTS) * len(PARTS[0]), 3))
        self.register_buffer("scale", torch.ones(()))
        size = frames * 3 * len(PARTS[0])
        self.encoders = nn.ModuleList(_layers((size, *widths)) for _ in PARTS)
        self.decoders = nn.ModuleList(_layers((*widths[::-1], size)) for _ in PARTS)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor | None]:
        """[B, 160] signatures of clips [B, T, 15, 3]; no logits."""
        return torch.cat(self._encode(x), dim=1), None

    def prepare(self, x: Tensor) -> None:
        """Centres clips at their mean motion, and scales them as one."""
        self.mean.copy_(x.mean(dim=0))
        self.scale.copy_((x - self.mean.to(x.device)).std().clamp(min=1e-6))

    def loss(self, x: Tensor, labels: Tensor) -> Tensor:
        """Mean square error of reconstruction as a share of the variance of the clips to train on."""
        made = [decode(code) for decode, code in zip(self.decoders, self._encode(x), strict=True)]
        return torch.stack([(a - b).square().mean() for a, b in zip(made, self._parts(x), strict=True)]).mean()

    def _parts(self, x: Tensor) -> list[Tensor]:
        centred = (x - self.mean) / self.scale
        return [centred[:, :, joints].flatten(1) for joints in self.order]

    def _encode(self, x: Tensor) -> list[Tensor]:
        return [encode(part) for encode, part in zip(self.encoders, self._parts(x), strict=True)]


def _layers(widths: tuple[int, ...]) -> nn.Sequential:
    made: list[nn.Module] = []
    for i, (given, wanted) in enumerate(pairwise(widths)):
        made.append(nn.Linear(given, wanted))
        if i < len(widths) - 2:
            made += [nn.BatchNorm1d(wanted), nn.ReLU()]
    return nn.Sequential(*made)
