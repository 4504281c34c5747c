"""Training word networks (Deep Motifs, sections 3.3 and 3.4, equation 2).

By recipe "metric" (`Recipe`) or by that of the paper (`motionlake.deep_motifs.words.deep_motifs`), as the configuration
says; those that have a closed form, by it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from motionlake.arrays import Float32Array, Progress
from motionlake.deep_motifs.config import CLOSED, NetworkConfig
from motionlake.deep_motifs.words.deep_motifs import DeepMotifs, DeepMotifsTraining, gathered
from motionlake.deep_motifs.words.linear import LinearConfig, linear_embedding
from motionlake.deep_motifs.words.network import LinearBody, TrainedNetwork, WordNetwork, build
from motionlake.deep_motifs.words.triplets import (
    TrainingWords,
    TripletConfig,
    copies,
    sample_words,
    time_reversed,
    training_words,
)
from motionlake.motion.features import WordConfig
from motionlake.training import Checkpoint, Loop, on_threads
from torch import Tensor

REPORT_EVERY: Final = 50
CHECKPOINT_EVERY: Final = 100


@dataclass(frozen=True)
class Recipe:
    """Recipe "metric"; the defaults measured best (`docs/words.md`).

    Attributes:
        triplets: what positives and negatives are.
        linear: the embedding that "moves" and "linear" are and that "conv" starts from.
        margin: alpha of equation 2, in units of the squared median word distance.
        triplet_weight: of the triplet loss.
        metric_weight: of the term that keeps embedding distances equal to word distances.
        batch: anchors of a step.
        pool: words of a step drawn at random, beside neighbours of the anchors.
        learning_rate: of Adam at its peak; it falls to zero along a cosine.
        threads: of the computation; results depend on it in the last digits.
    """

    triplets: TripletConfig = field(default_factory=TripletConfig)
    linear: LinearConfig = field(default_factory=LinearConfig)
    margin: float = 0.2
    triplet_weight: float = 1.0
    metric_weight: float = 1.0
    batch: int = 64
    pool: int = 128
    learning_rate: float = 1e-3
    threads: int = 1


def train_words(
    features: list[Float32Array],
    words: WordConfig,
    config: NetworkConfig,
    *,
    recipe: Recipe | None = None,
    deep_motifs: DeepMotifs | None = None,
    start: TrainedNetwork | None = None,
    checkpoint: Path | None = None,
    device: str | None = None,
    progress: Progress | None = None,
) -> TrainedNetwork:
    """Train a word network on clips.

    It is the same for the same input, configuration, seed and threads, interrupted or not (on CUDA: up to rounding).

    Args:
        features: [T, D] of each clip, as `word_features` gives them.
        words: how words are cut.
        config: architecture, recipe, seed, steps and sample size.
        recipe: how to train by recipe "metric", and in closed form.
        deep_motifs: how to train by the paper's.
        start: a network of the same words and architecture to go on from (fine-tuning).
        checkpoint: a file to save training to and to go on from; deleted at the end.
        device: of the computation; CUDA where there is one, else the CPU.
        progress: called with (steps done, steps, loss) every so often.

    Raises:
        ValueError: fewer than two words (by the paper's recipe, clips), an unknown architecture, or a start of other
            words or architecture.
    """
    recipe, paper = recipe or Recipe(), deep_motifs or DeepMotifs()
    by_paper = config.recipe == "deep_motifs"
    device = device or ("cuda" if torch.cuda.is_available() else "cpu")
    if start is not None and (start.words, start.architecture) != (words, config.built):
        raise ValueError("fine-tuning needs a network of the same words and architecture")
    with on_threads(paper.threads if by_paper else recipe.threads), torch.random.fork_rng(devices=[]):
        torch.manual_seed(config.seed)
        network = build(config.built, words)
        if by_paper:
            metrics = _by_paper(network, features, words, config, paper, start, checkpoint, device, progress)
        elif config.built in CLOSED:
            metrics = _solve(network, features, words, config, recipe, start)
        else:
            material = training_words(features, words, recipe.triplets, recipe.linear, config.max_words, config.seed)
            _initialise(network, material.words, material.linear, start)
            kept = Checkpoint(checkpoint, material.words, config, words, recipe) if checkpoint else None
            losses = _Fit(network.to(device), material, recipe, words, config, device).run(kept, progress)
            metrics = {"words": len(material.words), "anchors": len(material.anchors), "loss": _curve(losses)}
    return TrainedNetwork(network.cpu().eval(), config.built, words, metrics)


def _by_paper(
    network: WordNetwork,
    features: list[Float32Array],
    words: WordConfig,
    config: NetworkConfig,
    recipe: DeepMotifs,
    start: TrainedNetwork | None,
    checkpoint: Path | None,
    device: str,
    progress: Progress | None,
) -> dict[str, Any]:
    """Train by the paper's recipe; linear paths start as principal components."""
    material = gathered(features, words, config, recipe)
    trained = material.trained
    matrix = linear_embedding(trained.words, trained.clips, LinearConfig.principal(), config.seed)
    _initialise(network, trained.words, matrix, start)
    kept = Checkpoint(checkpoint, trained.words, config, words, recipe) if checkpoint else None
    training = DeepMotifsTraining(network.to(device), material, words, config, recipe, device)
    return training.run(kept, CHECKPOINT_EVERY, progress, REPORT_EVERY)


def _solve(
    network: WordNetwork,
    features: list[Float32Array],
    words: WordConfig,
    config: NetworkConfig,
    recipe: Recipe,
    start: TrainedNetwork | None,
) -> dict[str, Any]:
    """The optimum of "moves" and "linear" has a closed form."""
    stacked, clips, _ = sample_words(features, words, config.max_words, config.seed)
    if start is None:
        _standardise(network, stacked)
    else:
        network.load_state_dict(start.network.state_dict())
    body = network.body
    assert isinstance(body, LinearBody)

    def seen(chosen: Float32Array) -> Tensor:
        return body.seen((torch.from_numpy(chosen) - network.mean) / network.scale)

    with torch.no_grad():
        read = seen(stacked)
        count = body.weights(read)
        before = None if start is None else (body.linear.weight / count).numpy()
        alike = (seen(time_reversed(stacked, words)) * count).numpy() if config.reversible else None
        matrix = linear_embedding((read * count).numpy(), clips, recipe.linear, config.seed, before, alike)
        body.start_from(torch.from_numpy(matrix) * count)
    return {"words": len(stacked), "clips": len(np.unique(clips)), "components": len(matrix)}


def _initialise(network: WordNetwork, words: Float32Array, linear: Float32Array, start: TrainedNetwork | None) -> None:
    """Standardise the input; start linear paths as the linear embedding."""
    if start is not None:
        network.load_state_dict(start.network.state_dict())
        return
    _standardise(network, words)
    if isinstance(network.body, LinearBody):
        network.body.start_from(torch.from_numpy(linear) * network.scale)


def _standardise(network: WordNetwork, words: Float32Array) -> None:
    """Centre the input and bring it to unit variance.

    One scale for all features: their relative size is the metric's.
    """
    mean = words.mean(axis=(0, 1), dtype=np.float64)
    network.mean.copy_(torch.from_numpy(mean))
    network.scale.fill_(float(np.std(words - mean.astype(np.float32), dtype=np.float64)) or 1.0)


@dataclass(frozen=True)
class _Fit:
    """Training of a network by steps."""

    network: WordNetwork
    material: TrainingWords
    recipe: Recipe
    words: WordConfig
    config: NetworkConfig
    device: str

    def run(self, checkpoint: Checkpoint | None, progress: Progress | None) -> list[float]:
        """The loss of each step."""
        rng = np.random.default_rng(self.config.seed)
        optimiser = torch.optim.Adam(self.network.parameters(), lr=self.recipe.learning_rate)
        self.network.train()

        def train(step: int) -> float:
            for group in optimiser.param_groups:
                group["lr"] = self.recipe.learning_rate * _rate(step, self.config.steps)
            loss = self._loss(rng)
            optimiser.zero_grad(set_to_none=True)
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()
            return float(loss.detach())

        return Loop(
            self.network, optimiser, rng, self.config.steps, train, checkpoint, CHECKPOINT_EVERY, progress, REPORT_EVERY
        ).run()

    def _loss(self, rng: np.random.Generator) -> Tensor:
        """Of one step: anchors against a pool of random words, their neighbours and their positives."""
        material, recipe = self.material, self.recipe
        rows = rng.integers(0, len(material.anchors), recipe.batch)
        pick = np.arange(recipe.batch)
        near, neighbours = (
            table[rows, rng.integers(0, table.shape[1], recipe.batch)]
            for table in (material.nearest, material.neighbours)
        )
        random = rng.integers(0, len(material.words), recipe.pool)
        anchors = material.words[material.anchors[rows]]
        pool = np.concatenate([near, neighbours, random])
        played = copies(anchors, rng, self.words, reversible=self.config.reversible)
        batch = np.concatenate([anchors, played, material.words[pool]])
        embedded = self.network(torch.from_numpy(batch).to(self.device))
        anchor, warped, others = embedded.split([recipe.batch, recipe.batch, len(pool)])
        target = torch.from_numpy(material.distances[rows[:, None], pool]).to(self.device)
        squared = (anchor[:, None] - others[None]).square().sum(dim=2)
        positives = torch.stack([squared[pick, pick], (anchor - warped).square().sum(dim=1)])
        negative = target > recipe.triplets.far
        loss = recipe.triplet_weight * _triplet_loss(positives, squared, negative, recipe.margin)
        if recipe.metric_weight:
            loss = loss + recipe.metric_weight * _metric_loss(squared, target)
        return loss


def _rate(step: int, steps: int, warm_up: float = 0.1) -> float:
    """Share of the peak learning rate: a linear rise, then a cosine down to zero."""
    done = (step + 1) / (steps + 1)
    return done / warm_up if done < warm_up else 0.5 + 0.5 * float(np.cos(np.pi * (done - warm_up) / (1 - warm_up)))


def _curve(losses: list[float]) -> list[float]:
    """Mean loss of every `REPORT_EVERY` steps."""
    return [round(float(np.mean(losses[i : i + REPORT_EVERY])), 5) for i in range(0, len(losses), REPORT_EVERY)]


def _triplet_loss(positives: Tensor, squared: Tensor, negative: Tensor, margin: float) -> Tensor:
    """Equation 2, averaged over every positive of an anchor and every negative of the pool.

    Squared embedding distances of positives [p, B] and of the pool [B, P]; a mask [B, P].
    """
    hinge = torch.relu(positives[:, :, None] - squared[None] + margin)
    return (hinge * negative).sum() / (len(positives) * negative.sum().clamp(min=1))


def _metric_loss(squared: Tensor, target: Tensor) -> Tensor:
    """Sammon's weighting of (embedding distance - word distance)^2: errors count relative to the distance."""
    weight = 1 / (target + 0.1)
    distance = (squared + 1e-8).sqrt()
    return (weight * (distance - target).square()).sum() / weight.sum()
