"""Training GloGen on sparse poses of known class."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import torch
from motionlake.arrays import Float32Array, Int64Array, Progress
from motionlake.glogen.config import SEEDS, GloGenRecipe
from motionlake.glogen.network import ParallelDecoder, Seq2Seq, glogen_network
from motionlake.glogen.sparse import HEIGHT, JOINT_COLUMNS
from motionlake.glogen.trajectories import JOINTS_GIVEN
from motionlake.training import Checkpoint, Training, on_threads, optimiser_of, rate_of
from torch import Tensor, nn

CHECKPOINT_EVERY: Final = 10
LEAST: Final = 3  # poses that a window of a motion holds after the given ones, where the motion has them


def train_glogen(
    motions: Sequence[Float32Array],
    targets: Int64Array,
    classes: int,
    recipe: GloGenRecipe,
    seed: int,
    *,
    cyclic: Sequence[bool] = (),
    share: float = 1.0,
    checkpoint: Path | None = None,
    stays: bool = False,
    progress: Progress | None = None,
) -> tuple[ParallelDecoder | Seq2Seq, list[float]]:
    """Train on motions.

    Args:
        motions: sparse poses [sparse, 65] of each; of classes that go on any number of them, more than the given ones.
        targets: [n] class of each.
        classes: how many there are.
        recipe: how.
        seed: of weights, order and chance.
        cyclic: whether each class is cyclic, so that prediction may start at any pose; none by default.
        share: of the motions of classes that go on that an epoch takes, drawn anew: less than 1 where they overlap.
        checkpoint: a file to save training to and to go on from; deleted at the end, unless it `stays`.
        progress: called with (epochs done, epochs, mean loss).

    Returns:
        The network in evaluation mode, and the loss of each epoch.
    """
    rng = np.random.default_rng(seed)
    on = list(cyclic) or [False] * classes
    with on_threads(1), torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = glogen_network(replace(recipe, dropout=recipe.going_dropout) if any(on) else recipe, classes)
        rows, labels = [torch.from_numpy(motion) for motion in motions], torch.from_numpy(targets)
        network.learn(rows, labels, on)
        data = np.concatenate([*[motion.ravel() for motion in motions], targets, [seed]]).astype(np.float32)
        kept = Checkpoint(checkpoint, data, recipe) if checkpoint else None
        material = _Motions(rows, labels, on, recipe.sparse, share)
        items = material.items()
        count = len(material.drawn(items, np.random.default_rng(0)))

        def loss(chosen: Int64Array) -> Tensor:
            return _loss(network, *material.windows(chosen, rng), material.targets[chosen], recipe, rng)

        losses = Training(
            network, optimiser_of(network, recipe), recipe.epochs_of(count, any(on)), rate_of(recipe),
            lambda: np.array_split(material.drawn(items, rng), recipe.batches(count)), loss, seed, rng,
            kept, CHECKPOINT_EVERY, progress, stays=stays,
        ).run()  # fmt: skip
    return network.eval(), losses


def epochs_of(
    lengths: Sequence[int], targets: Sequence[int], cyclic: Sequence[bool], recipe: GloGenRecipe, share: float = 1.0
) -> int:
    """How many epochs `train_glogen` trains on motions of so many sparse poses."""
    items = _items(lengths, targets, cyclic)
    drawn = sum(cyclic[targets[i]] for i in items.tolist())
    return recipe.epochs_of(len(items) - drawn + round(share * drawn), any(cyclic))


def _items(lengths: Sequence[int], targets: Sequence[int], cyclic: Sequence[bool]) -> Int64Array:
    counts = [max(1, n // SEEDS - 1) if cyclic[t] else 1 for n, t in zip(lengths, targets, strict=True)]
    return np.repeat(np.arange(len(lengths)), counts)


@dataclass(frozen=True)
class _Motions:
    """Motions [n_i, 65] and their classes [n]; prediction of a cyclic class may start at any pose."""

    rows: list[Tensor]
    targets: Tensor
    cyclic: list[bool]
    sparse: int
    share: float

    def items(self) -> Int64Array:
        """Motions as an epoch takes them: once; those of classes that go on as often as they hold five poses."""
        return _items([len(rows) for rows in self.rows], self.targets.tolist(), self.cyclic)

    def drawn(self, items: Int64Array, rng: np.random.Generator) -> Int64Array:
        """What one epoch takes of the items, in its order."""
        if self.share == 1.0:
            return rng.permutation(items)
        on = np.array(self.cyclic)[self.targets.numpy()[items]]
        some = rng.permutation(items[on])[: round(self.share * int(on.sum()))]
        return rng.permutation(np.concatenate([items[~on], some]))

    def windows(self, chosen: Int64Array, rng: np.random.Generator) -> tuple[Tensor, Tensor]:
        """[B, sparse, 65] poses and [B, sparse] which of them there are: a motion may end before its window does."""
        found, there = [], []
        for i in chosen.tolist():
            rows = self.rows[i]
            last = max(0, len(rows) - SEEDS - LEAST)
            start = int(rng.integers(0, last + 1)) if self.cyclic[int(self.targets[i])] else 0
            places = torch.arange(start, start + self.sparse)
            found.append(rows[places.clamp(max=len(rows) - 1)])
            there.append(places < len(rows))
        return torch.stack(found), torch.stack(there)


def _loss(
    network: ParallelDecoder | Seq2Seq,
    rows: Tensor,
    there: Tensor,
    targets: Tensor,
    recipe: GloGenRecipe,
    rng: np.random.Generator,
) -> Tensor:
    if isinstance(network, Seq2Seq):
        return _block_loss(network, network.scale(rows), targets, rng)
    if recipe.noise:
        rows = rows.clone()
        rows[:, :SEEDS, : HEIGHT + 1] += recipe.noise * torch.randn_like(rows[:, :SEEDS, : HEIGHT + 1])
    scaled = network.scale(rows)
    mean, logarithm = network.infer(scaled, targets)
    latent = mean + (logarithm / 2).exp() * torch.randn_like(mean)
    made = network(unseen(scaled[:, :SEEDS], recipe.missing, rng), targets, latent)
    error = _error(made, scaled[:, SEEDS:], there[:, SEEDS:])
    before = scaled[:, SEEDS - 1 : SEEDS]
    steps = torch.diff(torch.cat([before, made], dim=1), dim=1), torch.diff(scaled[:, SEEDS - 1 :], dim=1)
    divergence = 0.5 * (mean.square() + logarithm.exp() - 1 - logarithm).sum(dim=1).mean()
    return error + recipe.smooth * _error(*steps, there[:, SEEDS:]) + recipe.divergence * divergence


def _block_loss(network: Seq2Seq, scaled: Tensor, targets: Tensor, rng: np.random.Generator) -> Tensor:
    """Mean squared error of every block from the five poses before it."""
    seen = unseen(scaled, network.recipe.missing, rng)
    errors = [
        (network.block(seen[:, start : start + SEEDS], targets)[:, : scaled.shape[1] - start - SEEDS]
         - scaled[:, start + SEEDS : start + 2 * SEEDS]).square().mean()
        for start in range(0, scaled.shape[1] - SEEDS, SEEDS)
    ]  # fmt: skip
    return torch.stack(errors).mean()


def unseen(scaled: Tensor, share: float, rng: np.random.Generator) -> Tensor:
    """Scaled poses [B, n, 65] in which a share of each motion's joints stands at its mean in all poses."""
    if not share:
        return scaled
    there = torch.from_numpy(rng.random((len(scaled), 1, JOINTS_GIVEN)) >= share).to(scaled.dtype)
    joints = scaled[..., JOINT_COLUMNS] * there.repeat_interleave(3, dim=2)
    return torch.cat([joints, scaled[..., HEIGHT:]], dim=2)


def _error(made: Tensor, true: Tensor, there: Tensor) -> Tensor:
    """Squared error of the joints, and a quarter of that of the other columns, of the poses there are [B, n]."""
    squares = (made - true).square()
    each = squares[..., JOINT_COLUMNS].mean(dim=2) + 0.25 * squares[..., HEIGHT:].mean(dim=2)
    return (each * there).sum() / there.sum().clamp(min=1)


class ByClass(nn.Module):
    """Networks by class.

    Attributes:
        recipe: of all.
        of: the classes of each network, in its own order.
    """

    def __init__(
        self, recipe: GloGenRecipe, networks: Sequence[ParallelDecoder | Seq2Seq], of: Sequence[Sequence[int]]
    ) -> None:
        super().__init__()
        self.recipe = recipe
        self.of = [list(classes) for classes in of]
        self.networks = nn.ModuleList(networks)
        self._places = {target: (i, own.index(target)) for i, own in enumerate(self.of) for target in own}

    def place(self, target: int) -> tuple[int, int]:
        """Which network knows a class, and as which of its own."""
        return self._places[target]

    def network(self, index: int) -> ParallelDecoder | Seq2Seq:
        network: ParallelDecoder | Seq2Seq = self.networks[index]  # type: ignore[assignment]
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


def groups(cyclic: Sequence[bool], known: Sequence[bool]) -> list[list[int]]:
    """The classes of each network: each cyclic class alone, all others together.

    Args:
        cyclic: [C] whether each is cyclic.
        known: [C] whether there are motions of it; one without joins the others, or the first where there are none.
    """
    alone = [[target] for target, on in enumerate(cyclic) if on and known[target]]
    others = [target for target, on in enumerate(cyclic) if not (on and known[target])]
    if not alone or any(known[target] for target in others):
        return [others, *alone]
    return [[*alone[0], *others], *alone[1:]]
