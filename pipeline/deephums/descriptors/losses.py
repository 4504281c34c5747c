"""What descriptor networks minimise (DeepHuMS, section 3.2).

Two of the thesis's equations are misprinted. Equation 3.1 with Y = 1 for similar samples, as its text has it, pulls
dissimilar samples together and pushes similar ones apart; here similar ones attract and dissimilar ones repel up to
the margin. Equation 3.2 lacks its minus sign; cross entropy is torch's.
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import normalize


def contrastive_loss(descriptors: Tensor, similar: Tensor, margin: float) -> Tensor:
    """Equation 3.1 over all pairs of a batch, similar and dissimilar pairs weighted alike.

    Args:
        descriptors: [B, d].
        similar: [B, B] whether two clips are similar.
        margin: m, how far apart dissimilar clips are pushed.
    """
    squares = (descriptors[:, None] - descriptors[None]).square().sum(dim=-1)
    # The root has no slope at zero.
    short = (margin - (squares + 1e-12).sqrt()).clamp(min=0)
    pairs = torch.triu(torch.ones_like(similar), diagonal=1)
    attracted, repelled = similar & pairs, ~similar & pairs
    return (_mean(squares, attracted) + _mean(short.square(), repelled)) / 2


def class_contrast(descriptors: Tensor, classes: Tensor, temperature: float) -> Tensor:
    """Supervised contrast: of all other clips of a batch, those of the same class should be the nearest.

    Khosla et al., Supervised Contrastive Learning, 2020, equation 2.

    Args:
        descriptors: [B, d].
        classes: [B].
        temperature: of the softmax over cosines.
    """
    same = classes[:, None] == classes[None]
    wanted = same & ~_diagonal(same)
    return neighbour_contrast(descriptors, wanted / wanted.sum(dim=1, keepdim=True).clamp(min=1), temperature)


def neighbour_contrast(descriptors: Tensor, wanted: Tensor, temperature: float) -> Tensor:
    """Cross entropy between wanted neighbours and those that the descriptors give.

    Args:
        descriptors: [B, d].
        wanted: [B, B] how much of a clip's neighbourhood each other clip is; rows sum to one, or to zero for clips
            that have none.
        temperature: of the softmax over cosines.
    """
    unit = normalize(descriptors, dim=1)
    cosines = (unit @ unit.T / temperature).masked_fill(_diagonal(wanted), -1e9)
    logarithms = torch.log_softmax(cosines, dim=1).masked_fill(_diagonal(wanted), 0)
    return -(wanted * logarithms).sum(dim=1).mean()


def _diagonal(square: Tensor) -> Tensor:
    return torch.eye(len(square), dtype=torch.bool, device=square.device)


def _mean(values: Tensor, chosen: Tensor) -> Tensor:
    return (values * chosen).sum() / chosen.sum().clamp(min=1)
