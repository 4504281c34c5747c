"""Training a word network by the paper's recipe (Deep Motifs, sections 3.3 and 3.4, equations 1 and 2).

A triplet is a word, one of its positives or a time-warped copy of it, and a negative. Negatives are "random", every
other anchor of the step, which are drawn at random; or "semi-hard", of these the nearest that is farther than the
positive (FaceNet, which the network follows). A share of the clips is held out: when the loss on triplets of their
words has not fallen for some time, training stops, and the weights with which it was least are kept.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from motionlake.arrays import Float32Array, Int64Array, Progress
from motionlake.deep_motifs.config import NetworkConfig
from motionlake.deep_motifs.words.network import WordNetwork
from motionlake.deep_motifs.words.positives import Anchors, anchors, split_clips
from motionlake.deep_motifs.words.triplets import copies
from motionlake.early_stopping import Watched, stands_still
from motionlake.motion.features import WordConfig, windows
from motionlake.training import Checkpoint, Loop
from torch import Tensor


@dataclass(frozen=True)
class DeepMotifs:
    """The paper's recipe; what it does not say was chosen so that two cores can train it (`docs/words.md`).

    Attributes:
        temporal: z, positives closest in time.
        nearest: k, positives nearest by DTW.
        far: lengths of a word, by which negatives of the same clip are away.
        margin: alpha of equation 1, between squared distances of unit vectors.
        batch: anchors of a step; with their positives and copies four times as many words.
        held_out: share of the clips that only tells when to stop.
        probes: anchors of these clips that the loss is measured on.
        every: steps from one such measure to the next.
        patience: measures in a row that fall no more, after which training stops.
        falls: share of the least measure so far that the next must fall by to count.
        learning_rate: of Adam.
        threads: of the computation; results depend on it in the last digits.
    """

    temporal: int = 4
    nearest: int = 5
    far: int = 4
    margin: float = 0.2
    batch: int = 32
    held_out: float = 0.1
    probes: int = 128
    every: int = 20
    patience: int = 8
    falls: float = 0.01
    learning_rate: float = 1e-3
    threads: int = 1


@dataclass(frozen=True)
class Material:
    """Words to train on, and words of other clips."""

    trained: Anchors
    held_out: Anchors


def gathered(features: list[Float32Array], words: WordConfig, config: NetworkConfig, recipe: DeepMotifs) -> Material:
    """Split clips, cut them into words and find the positives of each on its own side.

    Raises `ValueError` for fewer than two clips.
    """
    counts = [len(windows(len(clip), words)) for clip in features]
    sides = split_clips(counts, config.max_words, recipe.held_out, config.seed)
    return Material(
        *(
            anchors([features[clip] for clip in side], words, recipe.temporal, recipe.nearest, threads=recipe.threads)
            for side in sides
        )
    )


@dataclass(frozen=True)
class DeepMotifsTraining:
    """One training; `network` is on `device` and ready to be trained."""

    network: WordNetwork
    material: Material
    words: WordConfig
    config: NetworkConfig
    recipe: DeepMotifs
    device: str

    def run(self, checkpoint: Checkpoint | None, every: int, progress: Progress | None, told: int) -> dict[str, Any]:
        """Train; the network then has the best weights. Returns the metrics: sizes, losses, steps."""
        recipe, rng = self.recipe, np.random.default_rng(self.config.seed)
        watched = Watched(self.network, -(-self.config.steps // recipe.every))
        optimiser = torch.optim.Adam(self.network.parameters(), lr=recipe.learning_rate)
        probe = self._batch(self.material.held_out, recipe.probes, np.random.default_rng([self.config.seed, 2]))

        def step(number: int) -> float:
            self.network.train()
            rows, batch = self._batch(self.material.trained, recipe.batch, rng)
            loss = self._loss(self.material.trained, rows, self.network(batch.to(self.device)))
            optimiser.zero_grad(set_to_none=True)
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()
            if (number + 1) % recipe.every == 0 or number + 1 == self.config.steps:
                watched.add(self._held_out(*probe))
            return float(loss.detach())

        def over() -> bool:
            return stands_still(watched.losses, recipe.patience, lambda least: least * (1 - recipe.falls))

        losses = Loop(
            watched, optimiser, rng, self.config.steps, step, checkpoint, every, progress, told, over=over
        ).run()
        if watched.losses:
            self.network.load_state_dict(watched.best.state_dict())
        trained, held_out = self.material.trained, self.material.held_out
        return {
            "words": len(trained.words) + len(held_out.words),
            "held_out_words": len(held_out.words),
            "steps": len(losses),
            "stopped": over(),
            "loss": [round(float(np.mean(some)), 6) for some in _batched(losses, recipe.every)],
            "held_out_loss": [round(loss, 6) for loss in watched.losses],
        }

    def _batch(self, material: Anchors, count: int, rng: np.random.Generator) -> tuple[Int64Array, Tensor]:
        rows, batch = drawn(material, count, rng, self.words, reversible=self.config.reversible)
        return rows, torch.from_numpy(batch)

    def _loss(self, material: Anchors, rows: Int64Array, embedded: Tensor) -> Tensor:
        """Equation 2 of a batch [4 B, d] as `drawn` orders it."""
        anchor, *positives = torch.split(embedded, len(rows))
        near = torch.stack([(anchor - positive).square().sum(dim=1) for positive in positives])
        apart = (anchor[:, None] - anchor[None]).square().sum(dim=2)
        allowed = torch.from_numpy(material.negatives(rows, self.recipe.far * self.words.length)).to(self.device)
        return triplet_loss(near, apart, allowed, self.recipe.margin, self.config.negatives)

    @torch.no_grad()
    def _held_out(self, rows: Int64Array, batch: Tensor) -> float:
        self.network.eval()
        embedded = torch.cat([self.network(some.to(self.device)) for some in torch.split(batch, 128)])
        return float(self._loss(self.material.held_out, rows, embedded))


def drawn(
    material: Anchors, count: int, rng: np.random.Generator, words: WordConfig, *, reversible: bool
) -> tuple[Int64Array, Float32Array]:
    """Anchors [B], and the words [4 B, length, D] of a batch: they, a positive of either kind, and copies of them."""
    rows = rng.integers(0, len(material.words), count)
    temporal, near = (
        table[rows, rng.integers(0, table.shape[1], count)] for table in (material.temporal, material.nearest)
    )
    warped = copies(material.words[rows], rng, words, reversible=reversible)
    return rows, np.concatenate([material.words[np.concatenate([rows, temporal, near])], warped])


def _batched(losses: list[float], count: int) -> list[list[float]]:
    return [losses[i : i + count] for i in range(0, len(losses), count)]


def triplet_loss(positives: Tensor, apart: Tensor, allowed: Tensor, margin: float, negatives: str) -> Tensor:
    """Equation 1, averaged over the triplets of B anchors; 0 where no anchor has a negative.

    Args:
        positives: [p, B] squared distances of each anchor's positives.
        apart: [B, B] squared distances of anchors from one another.
        allowed: [B, B] which of them are negatives.
        margin: alpha.
        negatives: "random": all that are allowed. "semi-hard": for each positive the nearest of those that are farther
            than it; the farthest where none is.
    """
    pairs = positives[:, :, None] - apart[None] + margin
    if negatives == "semi-hard":
        with torch.no_grad():
            farther = allowed & (apart[None] > positives[:, :, None])
            nearest = apart.expand_as(pairs).masked_fill(~farther, torch.inf).argmin(dim=2)
            farthest = apart.masked_fill(~allowed, -torch.inf).argmax(dim=1).expand_as(nearest)
            chosen = torch.where(farther.any(dim=2), nearest, farthest)
        hinge = torch.relu(pairs.gather(2, chosen[:, :, None])[:, :, 0]) * allowed.any(dim=1)
        return hinge.sum() / (len(positives) * allowed.any(dim=1).sum()).clamp(min=1)
    return (torch.relu(pairs) * allowed).sum() / (len(positives) * allowed.sum()).clamp(min=1)
