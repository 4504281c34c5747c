"""Several networks of GloGen as one: each class that goes on has its own, those that come to their end share one."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from motionlake.glogen.glogen.network import Ahead, Blocks, glogen_network
from motionlake.glogen.glogen.recipe import GloGenRecipe
from torch import Tensor, nn


class ByClass(nn.Module):
    """Networks by class.

    Attributes:
        recipe: of all.
        of: the classes of each network, in its own order.
    """

    def __init__(self, recipe: GloGenRecipe, networks: Sequence[Ahead | Blocks], of: Sequence[Sequence[int]]) -> None:
        super().__init__()
        self.recipe = recipe
        self.of = [list(classes) for classes in of]
        self.networks = nn.ModuleList(networks)
        self._places = {target: (i, own.index(target)) for i, own in enumerate(self.of) for target in own}

    def place(self, target: int) -> tuple[int, int]:
        """Which network knows a class, and as which of its own."""
        return self._places[target]

    def network(self, index: int) -> Ahead | Blocks:
        network: Ahead | Blocks = self.networks[index]  # type: ignore[assignment]
        return network

    def embedding(self, rows: Tensor, targets: Tensor, *, with_class: bool) -> Tensor:
        """[B, n // 5 * E] what the networks of their classes make of motions [B, n, 65] (section 4.4).

        Args:
            rows: sparse poses.
            targets: [B] classes.
            with_class: their prior is read with the poses, as in figure 4.7; else the poses alone.
        """
        found: dict[int, Tensor] = {}
        for index in range(len(self.of)):
            mine = [i for i, target in enumerate(targets.tolist()) if self.place(target)[0] == index]
            if mine:
                network = self.network(index)
                own = torch.tensor([self.place(int(targets[i]))[1] for i in mine], dtype=torch.int64)
                made = network.embedding(network.scale(rows[mine]), own if with_class else None)
                found |= dict(zip(mine, made, strict=True))
        return torch.stack([found[i] for i in range(len(rows))])


def untrained(recipe: GloGenRecipe, of: Sequence[Sequence[int]]) -> ByClass:
    """Networks for weights that were saved."""
    return ByClass(recipe, [glogen_network(recipe, len(classes)) for classes in of], of)


def groups(going: Sequence[bool], known: Sequence[bool]) -> list[list[int]]:
    """The classes of each network: each that goes on alone, all others together.

    Args:
        going: [C] whether each goes on.
        known: [C] whether there are motions of it; one without joins the others, or the first where there are none.
    """
    alone = [[target] for target, on in enumerate(going) if on and known[target]]
    others = [target for target, on in enumerate(going) if not (on and known[target])]
    if not alone or any(known[target] for target in others):
        return [others, *alone]
    return [[*alone[0], *others], *alone[1:]]
