"""A sketch of a clip: in which directions its joints move and stand, and about when. It needs no training.

Whole-clip alignment forgives that two clips are not in step; so does a sketch, by how wide it is in time, and sketches
are compared by one product. (Parts above and below zero that are smoothed apart are the first layer of a scattering
transform: Bruna and Mallat, PAMI 2013.)
"""

from __future__ import annotations

from typing import Final

import numpy as np
import torch
from motionlake.motion.skeleton import COMMON
from torch import Tensor, nn
from torch.nn.functional import normalize

FRAMES: Final = 48  # of a clip that is sketched
EVERY: Final = 3  # of them one instant of the sketch
BREADTH: Final = 4.0  # frames; standard deviation of the filter over time
# How much displacement and velocity count, whose root mean square over the clip is 1, and joints, in body lengths.
COUNTS: Final = (0.5, 2.0, 0.8)
INSTANTS: Final = FRAMES // EVERY
NUMBERS: Final = INSTANTS * 2 * 3 * 3 * len(COMMON)
_PAIRS: Final = tuple((COMMON.index(f"left_{side}"), COMMON.index(f"right_{side}")) for side in ("hip", "shoulder"))


class Sketch(nn.Module):
    """Sketches in their principal directions.

    Args:
        width: numbers that come out.
    """

    directions: Tensor

    def __init__(self, width: int) -> None:
        super().__init__()
        self.register_buffer("directions", torch.zeros(width, NUMBERS))

    def learn(self, clips: Tensor) -> None:
        """The directions in which clips [n, 48, 15, 3] differ most, as many as there are; the others stay zero."""
        self.directions.copy_(principal(sketches(clips), len(self.directions)))

    def forward(self, clips: Tensor, _lengths: Tensor | None = None) -> Tensor:
        """[B, width] of clips [B, 48, 15, 3]; `lengths` is not used."""
        return sketches(clips) @ self.directions.T


def principal(rows: Tensor, width: int) -> Tensor:
    """[width, d] the directions, of length one, in which rows [n, d] are longest; zero where there are fewer."""
    _, _, directions = torch.linalg.svd(rows, full_matrices=False)
    signs = torch.sign(directions.sum(dim=1, keepdim=True))  # SVD leaves them open
    found = (directions * torch.where(signs == 0, 1.0, signs))[:width]
    return nn.functional.pad(found, (0, 0, 0, width - len(found)))


def sketches(clips: Tensor) -> Tensor:
    """[B, 4320] of length one, of clips [B, 48, 15, 3]: joints as `clip_sequence` has them.

    Displacement from the posture that the clip starts and ends in, velocity, and joints, the body facing one way in
    the mean; of each number how far it is above zero, and how far below, smoothed over time.
    """
    turned = _turned(clips)
    ends = torch.cat([turned[:, :2], turned[:, -2:]], dim=1).mean(dim=1, keepdim=True)
    parts = (unit(turned - ends), unit(_velocity(turned)), turned)
    frames = torch.cat([count * part.flatten(2) for count, part in zip(COUNTS, parts, strict=True)], dim=2)
    apart = torch.cat([frames, -frames], dim=2).clamp(min=0)
    return normalize(torch.einsum("st,btd->bsd", _filter().to(clips), apart).flatten(1), dim=1)


def unit(values: Tensor) -> Tensor:
    """Of [B, T, J, 3] each of B divided by its root mean square length over T."""
    squares = values.square().sum(dim=(2, 3), keepdim=True).mean(dim=1, keepdim=True)
    return values / (squares + 1e-8).sqrt()


def _turned(clips: Tensor) -> Tensor:
    """Clips facing +z in the mean, as far as hips and shoulders tell."""
    across = sum(normalize(clips[:, :, left] - clips[:, :, right], dim=2) for left, right in _PAIRS)
    assert isinstance(across, Tensor)
    facing = normalize(torch.stack([across[..., 0], -across[..., 2]], dim=-1), dim=2).sum(dim=1)
    facing = normalize(facing + torch.tensor([1e-6, 0.0]).to(clips), dim=1)
    cosine, sine = facing[:, 0], facing[:, 1]
    none, one = torch.zeros_like(cosine), torch.ones_like(cosine)
    turns = torch.stack([cosine, none, sine, none, one, none, -sine, none, cosine], dim=1).reshape(-1, 3, 3)
    return clips @ turns[:, None]


def _velocity(clips: Tensor) -> Tensor:
    """[B, T, J, 3] a frame, as `numpy.gradient` has it."""
    within = (clips[:, 2:] - clips[:, :-2]) / 2
    return torch.cat([clips[:, 1:2] - clips[:, :1], within, clips[:, -1:] - clips[:, -2:-1]], dim=1)


def _filter() -> Tensor:
    """[16, 48] a Gaussian filter over time, at every third frame; beyond its ends a clip stands still."""
    from scipy.ndimage import gaussian_filter1d

    smoothed = gaussian_filter1d(np.eye(FRAMES), BREADTH, axis=0, mode="nearest")
    return torch.from_numpy(smoothed[1::EVERY].astype(np.float32))
