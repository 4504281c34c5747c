"""The network of the onset: from how a body stands and moves to its next frames, for all classes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
import torch
from motionlake.arrays import Float64Array, Int64Array, Progress
from motionlake.glogen.config import OnsetRecipe
from motionlake.glogen.onset_examples import FEATURES, FUTURE, KNOTS, ROOT, Examples, joined
from motionlake.glogen.sparse import HEIGHT
from motionlake.training import Checkpoint, Training, on_threads, optimiser_of, rate_of
from torch import Tensor, nn
from torch.nn.functional import one_hot

PACES: Final = (2 / 3, 4 / 5, 1.0, 5 / 4, 3 / 2)  # at which clips are played to learn from
SMALL: Final = 1e-4  # of a squared error: its root is smooth there
OTHERS: Final = 0.25  # weight of the errors of height, velocity and turning


class OnsetNetwork(nn.Module):
    """A residual perceptron.

    Attributes:
        mean, spread: of states, of all columns the same spread.
        sizes: [14, 64] of what follows; the joints of a frame have one.
    """

    mean: Tensor
    spread: Tensor
    sizes: Tensor

    def __init__(self, classes: int, recipe: OnsetRecipe) -> None:
        super().__init__()
        self.classes, self.recipe = classes, recipe
        self.enter = nn.Linear(FEATURES + classes, recipe.width)
        self.blocks = nn.ModuleList(
            nn.Sequential(
                nn.LayerNorm(recipe.width), nn.Linear(recipe.width, recipe.width), nn.GELU(),
                nn.Linear(recipe.width, recipe.width), nn.Dropout(recipe.dropout),
            )
            for _ in range(recipe.blocks)
        )  # fmt: skip
        self.out = nn.Sequential(
            nn.LayerNorm(recipe.width), nn.Dropout(recipe.dropout), nn.Linear(recipe.width, FUTURE)
        )
        self.register_buffer("mean", torch.zeros(FEATURES))
        self.register_buffer("spread", torch.ones(()))
        self.register_buffer("sizes", torch.ones(len(KNOTS), ROOT))

    def learn(self, states: Tensor, futures: Tensor, there: Tensor) -> None:
        """The scales of states [n, 245] and of what follows [n, 14, 64], of which `there` [n, 14] says where it is."""
        self.mean.copy_(states.mean(dim=0))
        self.spread.copy_((states - self.mean).square().mean().sqrt().clamp(min=1e-6))
        counts = there.sum(dim=0).clamp(min=1)[:, None]
        sizes = ((futures.square() * there[..., None]).sum(dim=0) / counts).sqrt()
        sizes[:, :HEIGHT] = sizes[:, :HEIGHT].square().mean(dim=1, keepdim=True).sqrt()
        self.sizes.copy_(sizes.clamp(min=1e-4))

    def forward(self, states: Tensor, targets: Tensor) -> Tensor:
        """[B, 14, 64] what follows states [B, 245] of classes [B], in `sizes`."""
        hidden = self.enter(torch.cat([(states - self.mean) / self.spread, one_hot(targets, self.classes)], dim=1))
        for block in self.blocks:
            hidden = hidden + block(hidden)
        return self.out(hidden).view(-1, len(KNOTS), ROOT)  # type: ignore[no-any-return]

    def follow(self, state: Float64Array, target: int) -> Float64Array:
        """[14, 64] what follows a state [245] of a class."""
        with torch.inference_mode():
            found = self(torch.from_numpy(state[None]).float(), torch.tensor([target]))[0] * self.sizes
        future: Float64Array = found.double().numpy()
        return future


def train_onset_network(
    examples: Sequence[Examples],
    recipe: OnsetRecipe,
    seed: int,
    *,
    checkpoint: Path | None = None,
    progress: Progress | None = None,
) -> tuple[OnsetNetwork, list[float]]:
    """Train on examples; a class without any is not learned.

    Args:
        examples: of each of C classes.
        recipe: how.
        seed: of weights, order and chance.
        checkpoint: a file to save training to and to go on from; it stays.
        progress: called with (epochs done, epochs, mean loss).
    """
    rng = np.random.default_rng(seed)
    with on_threads(1), torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = OnsetNetwork(len(examples), recipe)
        counts = np.array([len(own) for own in examples])
        if not counts.sum():
            return network.eval(), []
        whole = joined(examples)
        states, futures = torch.from_numpy(whole.states).float(), torch.from_numpy(whole.futures).float()
        futures = futures.view(-1, len(KNOTS), ROOT)
        there = torch.from_numpy(np.array(KNOTS) <= whole.lasting[:, None])
        targets = torch.from_numpy(np.repeat(np.arange(len(examples)), counts))
        network.learn(states, futures, there)
        known, firsts = np.flatnonzero(counts), np.cumsum(counts) - counts

        def batches() -> list[Int64Array]:
            """As often of one class as of another."""
            drawn = rng.choice(known, (recipe.epoch, recipe.batch))
            return list(firsts[drawn] + (rng.random(drawn.shape) * counts[drawn]).astype(np.int64))

        def loss(rows: Int64Array) -> Tensor:
            apart = network(states[rows], targets[rows]) - futures[rows] / network.sizes
            squares = apart.square()
            joints = (squares[..., :HEIGHT].mean(dim=2) + SMALL).sqrt()
            others = (squares[..., HEIGHT:].mean(dim=2) + SMALL).sqrt()
            error: Tensor = ((joints + OTHERS * others) * there[rows]).sum() / there[rows].sum()
            return error

        data = np.concatenate([counts, [seed], whole.states.sum(axis=1)]).astype(np.float32)
        kept = Checkpoint(checkpoint, data, recipe) if checkpoint else None
        losses = Training(
            network, optimiser_of(network, recipe), recipe.epochs_of(len(known)), rate_of(recipe), batches, loss, seed,
            rng, kept, progress=progress, stays=True,
        ).run()  # fmt: skip
    return network.eval(), losses
