"""Training, keeping and using word networks (Deep Motifs, sections 3.3 and 3.4, equation 2)."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
import torch
from safetensors import safe_open
from safetensors.torch import save_file
from threadpoolctl import threadpool_limits
from torch import Tensor

from pipeline.words.config import NetworkConfig
from pipeline.words.features import Float32Array, WordConfig
from pipeline.words.network import ConvBody, WordNetwork, build
from pipeline.words.triplets import TrainingWords, TripletConfig, time_warped, training_words

Progress = Callable[[int, int, float], None]

METADATA_KEY: Final = "word_network"
# Words are embedded in batches of exactly this many, the last one padded, so that a word's vector does not
# depend on the words beside it.
EMBED_BATCH: Final = 64


@dataclass(frozen=True)
class Recipe:
    """How a word network is trained; the defaults measured best (`docs/words.md`).

    Attributes:
        triplets: what positives and negatives are.
        margin: alpha of equation 2, in units of the squared median word distance.
        temporal_weight: of the positives closest in time, beside 1 for each other kind. The paper's is 1.
        triplet_weight: of the triplet loss.
        metric_weight: of the term that keeps embedding distances equal to word distances.
        batch: anchors of a step.
        pool: words of a step drawn at random, beside neighbours of the anchors.
        learning_rate: of Adam at its peak; it falls to zero along a cosine.
        threads: of the computation; results depend on it in the last digits.
    """

    triplets: TripletConfig = field(default_factory=TripletConfig)
    margin: float = 0.2
    temporal_weight: float = 0.0
    triplet_weight: float = 1.0
    metric_weight: float = 1.0
    batch: int = 64
    pool: int = 128
    learning_rate: float = 1e-3
    threads: int = 1

    @classmethod
    def deep_motifs(cls) -> Recipe:
        """The paper's (sections 3.3, 3.4): DTW alone, positives closest in time, equation 2 and nothing beside it."""
        return cls(triplets=TripletConfig(elastic=1.0), temporal_weight=1.0, metric_weight=0.0)


@dataclass(frozen=True)
class TrainedNetwork:
    """A word network with what it needs to be used again.

    Attributes:
        network: in evaluation mode.
        architecture: its name.
        words: the words it was trained on.
        figures: of its training.
    """

    network: WordNetwork
    architecture: str
    words: WordConfig
    figures: Mapping[str, float]

    def embed(self, words: Float32Array) -> Float32Array:
        """Embed `words` [n, length, D] as [n, d]; on one thread, each word independent of the others.

        Raises:
            ValueError: words of another shape than the network was trained on.
        """
        expected = (self.words.length, self.words.dimension)
        if words.shape[1:] != expected:
            raise ValueError(f"words of shape {words.shape[1:]}, but the network embeds {expected}")
        batches = []
        with _threads(1), torch.inference_mode():
            for start in range(0, max(len(words), 1), EMBED_BATCH):
                batch = np.zeros((EMBED_BATCH, *expected), dtype=np.float32)
                count = len(words[start : start + EMBED_BATCH])
                batch[:count] = words[start : start + EMBED_BATCH]
                batches.append(self.network(torch.from_numpy(batch))[:count].numpy())
        return np.concatenate(batches)

    def save(self, path: Path) -> None:
        """Write weights and configuration as one safetensors file."""
        kept = {"architecture": self.architecture, "words": asdict(self.words), "figures": dict(self.figures)}
        tensors = {name: value.contiguous() for name, value in self.network.state_dict().items()}
        save_file(tensors, path, metadata={METADATA_KEY: json.dumps(kept, sort_keys=True)})


def load_network(path: Path) -> TrainedNetwork:
    """Read a network that `TrainedNetwork.save` wrote.

    Raises:
        ValueError: the file holds something else.
    """
    with safe_open(path, framework="pt") as file:
        metadata = (file.metadata() or {}).get(METADATA_KEY)
        if metadata is None:
            raise ValueError(f"{path} holds no word network")
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    kept = json.loads(metadata)
    words = WordConfig(**kept["words"])
    network = build(kept["architecture"], words.length, words.dimension)
    network.load_state_dict(tensors)
    return TrainedNetwork(network.eval(), kept["architecture"], words, kept["figures"])


def train_words(
    features: list[Float32Array],
    words: WordConfig,
    config: NetworkConfig,
    *,
    recipe: Recipe | None = None,
    progress: Progress | None = None,
) -> TrainedNetwork:
    """Train a word network on clips.

    Args:
        features: [T, D] of each clip, as `word_features` gives them.
        words: how words are cut.
        config: architecture, seed, steps and sample size.
        recipe: how to train.
        progress: called with (steps done, steps, loss) every so often.

    Returns:
        The network; the same for the same input, configuration, seed and threads.

    Raises:
        ValueError: fewer than two words, or an unknown architecture.
    """
    recipe = recipe or Recipe()
    with _threads(recipe.threads), torch.random.fork_rng(devices=[]):
        material = training_words(features, words, recipe.triplets, config.max_words, config.seed)
        torch.manual_seed(config.seed)
        network = build(config.architecture, words.length, words.dimension)
        _initialise(network, material)
        losses = _fit(network, material, recipe, config, progress)
    figures = {
        "words": float(len(material.words)),
        "anchors": float(len(material.anchors)),
        "word_distance_median": material.scale,
        "loss_first": float(np.mean(losses[:50])) if losses else 0.0,
        "loss_last": float(np.mean(losses[-50:])) if losses else 0.0,
    }
    return TrainedNetwork(network.eval(), config.architecture, words, figures)


@contextmanager
def _threads(count: int) -> Iterator[None]:
    """So many threads for torch and for numpy's linear algebra, whatever the machine or its environment says."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        with threadpool_limits(limits=count):
            yield
    finally:
        torch.set_num_threads(before)


def _initialise(network: WordNetwork, material: TrainingWords) -> None:
    """Standardise the input; start the linear path of "conv" as the principal components of the words.

    One scale for all features: their relative size is the metric's. It makes the distance of two words
    frame by frame, in units of the median word distance, the distance of their flattened inputs.
    """
    n, length, dimension = material.words.shape
    mean = material.words.reshape(-1, dimension).mean(axis=0, dtype=np.float64)
    network.mean.copy_(torch.from_numpy(mean))
    network.scale.fill_(material.scale * length**0.5)
    if isinstance(network.body, ConvBody):
        flat = ((material.words - mean) / float(network.scale)).reshape(n, -1)
        covariance = (flat.T @ flat) / n
        _, vectors = np.linalg.eigh(covariance)
        components = vectors[:, ::-1].T
        signs = np.sign(components[np.arange(len(components)), np.abs(components).argmax(axis=1)])
        network.body.start_from(torch.from_numpy((components * signs[:, None]).astype(np.float32)))


def _fit(
    network: WordNetwork,
    material: TrainingWords,
    recipe: Recipe,
    config: NetworkConfig,
    progress: Progress | None,
) -> list[float]:
    rng = np.random.default_rng(config.seed)
    optimiser = torch.optim.Adam(network.parameters(), lr=recipe.learning_rate)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, recipe.learning_rate, total_steps=config.steps + 1, pct_start=0.1
    )
    losses: list[float] = []
    network.train()
    for step in range(config.steps):
        loss = _loss(network, material, recipe, rng)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        schedule.step()
        losses.append(float(loss.detach()))
        if progress is not None and (step % 50 == 49 or step + 1 == config.steps):
            progress(step + 1, config.steps, losses[-1])
    return losses


def _loss(network: WordNetwork, material: TrainingWords, recipe: Recipe, rng: np.random.Generator) -> Tensor:
    """One step: anchors against a pool of random words, their neighbours and their positives."""
    rows = rng.integers(0, len(material.anchors), recipe.batch)
    pick = np.arange(recipe.batch)
    near, temporal, neighbours = (
        table[rows, rng.integers(0, table.shape[1], recipe.batch)]
        for table in (material.nearest, material.temporal, material.neighbours)
    )
    random = rng.integers(0, len(material.words), recipe.pool)
    anchors = material.words[material.anchors[rows]]
    pool = np.concatenate([near, temporal, neighbours, random])
    batch = np.concatenate([anchors, time_warped(anchors, rng), material.words[pool]])
    embedded = network(torch.from_numpy(batch))
    anchor, warped, others = embedded.split([recipe.batch, recipe.batch, len(pool)])
    target = torch.from_numpy(material.distances[rows[:, None], pool])
    squared = (anchor[:, None] - others[None]).square().sum(dim=2)
    positives = torch.stack(
        [squared[pick, pick], squared[pick, pick + recipe.batch], (anchor - warped).square().sum(dim=1)]
    )
    kinds = torch.tensor([1.0, recipe.temporal_weight, 1.0])
    negative = target > recipe.triplets.far
    loss = recipe.triplet_weight * _triplet_loss(positives, kinds, squared, negative, recipe.margin)
    if recipe.metric_weight:
        loss = loss + recipe.metric_weight * _metric_loss(squared, target)
    return loss


def _triplet_loss(positives: Tensor, kinds: Tensor, squared: Tensor, negative: Tensor, margin: float) -> Tensor:
    """Equation 2, averaged over every positive of an anchor and every negative of the pool.

    positives [p, B] and squared [B, P] are squared embedding distances, kinds [p] weights, negative [B, P]
    a mask.
    """
    hinge = torch.relu(positives[:, :, None] - squared[None] + margin) * kinds[:, None, None]
    return (hinge * negative).sum() / (kinds.sum() * negative.sum().clamp(min=1))


def _metric_loss(squared: Tensor, target: Tensor) -> Tensor:
    """Sammon's weighting of (embedding distance - word distance)^2: errors count relative to the distance."""
    weight = 1 / (target + 0.1)
    distance = (squared + 1e-8).sqrt()
    return (weight * (distance - target).square()).sum() / weight.sum()
