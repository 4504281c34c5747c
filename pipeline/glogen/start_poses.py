"""Where the motions of each class start, so that a class can follow poses that are none of its own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import torch
from motionlake.glogen.config import SEEDS
from motionlake.glogen.sparse import JOINT_COLUMNS, WIDTH
from torch import Tensor, nn

KNOWN: Final = 16  # start poses kept of a cyclic class
REACH: Final = 0.9  # quantile of the distances of training poses from the start poses of their class
# How much nearer (in reaches) the start poses of another class are than those of the requested one: below OWN the given
# poses count as the class's own, above FOREIGN as foreign, and they are blended in between.
OWN: Final = 0.25
FOREIGN: Final = 0.5


class StartPoses(nn.Module):
    """Start poses of each class in the training data.

    Given the poses of another class, the network would predict a mixture of both classes. So foreign poses are replaced
    by the nearest start poses of the requested class, and the first predicted step bridges the gap.
    """

    poses: Tensor
    reach: Tensor

    def __init__(self, classes: int, known: int = 1) -> None:
        super().__init__()
        self.register_buffer("poses", torch.zeros(classes, known, SEEDS, WIDTH))
        self.register_buffer("reach", torch.ones(()))

    def learn(self, given: Sequence[Tensor], going: Sequence[bool]) -> None:
        """Keep the mean of the scaled start poses [n, 5, 65] of a class, or the most different ones of a cyclic class.

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
        """[B, 5, 65] scaled given poses; foreign ones become the nearest start poses of the requested class.

        Args:
            given: [B, 5, 65].
            targets: [B] class requested.
            anew: [B] whether the class starts after these poses, which then count as foreign.
        """
        to_all = torch.stack([_apart(given, known) for known in self.poses], dim=1)  # [B, C, K]
        rows = torch.arange(len(given))
        apart, place = to_all[rows, targets].min(dim=1)
        further = (apart - to_all.amin(dim=(1, 2))) / self.reach
        foreign = ((further - OWN) / (FOREIGN - OWN)).clamp(0, 1)
        foreign = torch.where(anew, 1.0, foreign)
        return torch.lerp(given, self.poses[targets, place], foreign[:, None, None])


def _apart(given: Tensor, known: Tensor) -> Tensor:
    """[n, k] root mean square distance of the joints of the last poses of [n, 5, 65] and [k, 5, 65]."""
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
