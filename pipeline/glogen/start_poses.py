"""Where the motions of each class start, so that a class can follow poses that are none of its own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import torch
from motionlake.glogen.config import SEEDS
from motionlake.glogen.sparse import JOINT_COLUMNS, WIDTH
from torch import Tensor, nn

KNOWN: Final = 16  # beginnings that are known of a class that goes on
REACH: Final = 0.9  # quantile of the distances of given poses from the beginning of their class
# How much nearer another class's beginnings are than the wanted one's, in reaches: up to where given poses are taken
# for the wanted class's own, and from where on they are foreign.
OWN: Final = 0.25
FOREIGN: Final = 0.5


class Beginnings(nn.Module):
    """The given poses that the motions of a class have had while training.

    A network that is asked for a class from the poses of another goes on with something between the two. So foreign
    poses are brought to where the wanted class begins before they are read, and the first pose that is made leads over.
    """

    poses: Tensor
    reach: Tensor

    def __init__(self, classes: int, known: int = 1) -> None:
        super().__init__()
        self.register_buffer("poses", torch.zeros(classes, known, SEEDS, WIDTH))
        self.register_buffer("reach", torch.ones(()))

    def learn(self, given: Sequence[Tensor], going: Sequence[bool]) -> None:
        """From scaled given poses [n, 5, 65] of each class: their mean, or the most different of a class that goes on.

        The reach is the median over classes.
        """
        reaches = []
        for target, (own, on) in enumerate(zip(given, going, strict=True)):
            if len(own):
                known = _different(own, self.poses.shape[1]) if on else own.mean(dim=0, keepdim=True)
                self.poses[target] = known[torch.arange(self.poses.shape[1]) % len(known)]
                reaches.append(torch.quantile(_apart(own, self.poses[target]).amin(dim=1), REACH))
        if reaches:
            self.reach.copy_(torch.stack(reaches).median().clamp(min=1e-6))

    def forward(self, given: Tensor, targets: Tensor, anew: Tensor) -> Tensor:
        """[B, 5, 65] scaled given poses, foreign ones brought to the nearest beginning of the class wanted.

        Args:
            given: [B, 5, 65].
            targets: [B] class wanted.
            anew: [B] whether the class begins with what follows: the poses are those of what was before, and foreign.
        """
        to_all = torch.stack([_apart(given, known) for known in self.poses], dim=1)  # [B, C, K]
        rows = torch.arange(len(given))
        apart, place = to_all[rows, targets].min(dim=1)
        further = (apart - to_all.amin(dim=(1, 2))) / self.reach
        foreign = ((further - OWN) / (FOREIGN - OWN)).clamp(0, 1)
        foreign = torch.where(anew, 1.0, foreign)
        return torch.lerp(given, self.poses[targets, place], foreign[:, None, None])


def _apart(given: Tensor, known: Tensor) -> Tensor:
    """[n, k] how far the joints of the last pose of [n, 5, 65] are from those of [k, 5, 65] (root mean square)."""
    apart = given[:, None, -1, JOINT_COLUMNS] - known[None, :, -1, JOINT_COLUMNS]
    return apart.square().mean(dim=2).sqrt()


def _different(given: Tensor, count: int) -> Tensor:
    """Up to `count` of [n, 5, 65], each the furthest from those before it; the first is the nearest to the mean."""
    chosen = [int(_apart(given, given.mean(dim=0, keepdim=True))[:, 0].argmin())]
    apart = _apart(given, given[chosen])[:, 0]
    while len(chosen) < count and float(apart.max()) > 0:
        chosen.append(int(apart.argmax()))
        apart = torch.minimum(apart, _apart(given, given[chosen[-1:]])[:, 0])
    return given[chosen]
