"""Training the clustering adversarial autoencoder (PESTA, section 5.2)."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from motionlake.arrays import Float32Array, Int64Array, Progress
from motionlake.deep_motifs.motifs import Motifs, assign, fit_motifs
from motionlake.deep_motifs.words.linear import linear_embedding
from motionlake.pesta.config import PosturesConfig
from motionlake.pesta.dictionary import (
    AutoencoderEncoder,
    AutoencoderRecipe,
    NearestCode,
    PostureAutoencoder,
    PostureDictionary,
    recipe_of,
)
from motionlake.training import Checkpoint, Loop, on_threads
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits, one_hot

REPORT_EVERY: Final = 50
CHECKPOINT_EVERY: Final = 100
REVIVE_EVERY: Final = 100
SETTLE_ROWS: Final = 4096
SOM_EPOCHS: Final = 30


def train_autoencoder(
    postures: Float32Array,
    clips: Int64Array,
    config: PosturesConfig,
    *,
    recipe: AutoencoderRecipe | None = None,
    checkpoint: Path | None = None,
    device: str | None = None,
    progress: Progress | None = None,
) -> PostureDictionary:
    """Train the autoencoder on postures; its heads are the dictionary.

    Args:
        postures: [n, D] features of single frames.
        clips: [n] clip of each.
        config: m and the seed.
        recipe: how to train; that of the configuration if not given.
        checkpoint: a file to save training to and to go on from; deleted at the end.
        device: of the computation; CUDA where there is one, else the CPU.
        progress: called with (steps done, steps, loss) every so often.

    Returns:
        The dictionary; the same for the same input, configuration and seed, interrupted or not (on CUDA: up to
        rounding). Its metrics: `occupied` symbols of all postures, `largest` share of one symbol, `perplexity` of
        their use, mean square error of reconstruction on the postures kept out, as a share of their variance.

    Raises:
        ValueError: fewer training postures than symbols.
    """
    recipe = recipe or recipe_of(config)
    device = device or ("cuda" if torch.cuda.is_available() else "cpu")
    rng = np.random.default_rng(config.seed)
    order = rng.permutation(len(postures))
    held = int(recipe.validation * len(postures))
    outside, inside = np.sort(order[:held]), np.sort(order[held:])
    if len(inside) < config.m:
        raise ValueError(f"{len(inside)} postures to train on are too few for {config.m} symbols")
    known = postures[inside]
    with on_threads(1), torch.random.fork_rng(devices=[]):
        torch.manual_seed(config.seed)
        network = PostureAutoencoder(postures.shape[1], config.m, recipe.style, recipe.hidden, recipe.heads)
        _start(network, known, clips[inside], config, recipe)
        kept = Checkpoint(checkpoint, known, config, recipe) if checkpoint else None
        network.to(device)
        parameters = [*network.autoencoder(), *network.critics()]
        optimiser = torch.optim.Adam(parameters, lr=recipe.learning_rate, betas=(recipe.momentum, 0.999))

        def train(step: int) -> float:
            if step % REVIVE_EVERY == 0:
                _revive(network, known, rng, device)
            optimiser.zero_grad(set_to_none=True)
            loss = _step(network, known[rng.integers(0, len(known), recipe.batch)], recipe, rng, device)
            optimiser.step()
            return loss

        steps = recipe.count(len(known))
        losses = Loop(
            network, optimiser, rng, steps, train, kept, CHECKPOINT_EVERY, progress, REPORT_EVERY
        ).run()  # fmt: skip
        network = network.cpu().eval()
        _settle(network, known)
        metrics = _metrics(network, postures, outside, losses)
        codes = network.heads.detach().numpy().copy()
        typical = _typical(network, known)
    return PostureDictionary(config, AutoencoderEncoder(network), codes, typical, metrics)


def _start(
    network: PostureAutoencoder,
    postures: Float32Array,
    clips: Int64Array,
    config: PosturesConfig,
    recipe: AutoencoderRecipe,
) -> None:
    """Standardise; lay out "nearest" heads by k-means among the codes that training starts from."""
    mean = postures.mean(axis=0, dtype=np.float64).astype(np.float32)
    scale = float(np.std(postures - mean, dtype=np.float64)) or 1.0
    network.mean.copy_(torch.from_numpy(mean))
    network.scale.fill_(scale)
    if recipe.heads == "linear":
        return
    matrix = linear_embedding(postures[:, None], clips, recipe.linear, config.seed)
    codes = (postures - mean) @ matrix.T
    heads = fit_motifs(codes, config.m, config.seed).centroids
    with torch.no_grad():
        network.start[: len(matrix)] = torch.from_numpy(matrix * scale)
        network.heads.copy_(torch.from_numpy(np.resize(_padded(heads, recipe.style), network.heads.shape)))
        nearest = network.apart(torch.from_numpy(_padded(codes, recipe.style))).min(dim=1).values
        square = float(nearest.clamp(min=0).mean()) or 1.0
        network.spread.fill_((square / recipe.style) ** 0.5)
        network.temperature.fill_(recipe.softness * square)


def _padded(rows: Float32Array, width: int) -> Float32Array:
    return np.pad(rows, [(0, 0), (0, width - rows.shape[1])])


def _step(
    network: PostureAutoencoder,
    postures: Float32Array,
    recipe: AutoencoderRecipe,
    rng: np.random.Generator,
    device: str,
) -> float:
    """Gradients of one step: reconstruction, fooling the critics, and the critics' own; returns the first loss."""
    makers, critics = network.autoencoder(), network.critics()
    wanted = torch.from_numpy(postures).to(device)
    classes, style = network.encode(wanted)
    code = network.code(classes, style)
    variance = network.scale.square()
    loss = (network.decode(code) - wanted).square().mean() / variance
    if recipe.from_head:
        hard = network.heads[classes.argmax(dim=1)]
        soft = classes @ network.heads
        from_head = network.decode(hard + soft - soft.detach())
        loss = loss + recipe.from_head * (from_head - wanted).square().mean() / variance
    for critic in critics:
        critic.requires_grad_(False)
    fooled = _is(network.class_critic(classes), 1.0) + _is(network.style_critic(style), 1.0)
    loss = loss + recipe.adversarial * fooled
    loss.backward()  # type: ignore[no-untyped-call]
    for critic in critics:
        critic.requires_grad_(True)
    drawn = torch.from_numpy(rng.integers(0, len(network.heads), len(postures))).to(device)
    category = one_hot(drawn, len(network.heads)).float()
    normal = torch.from_numpy(rng.standard_normal(style.shape).astype(np.float32)).to(device)
    told = _is(network.class_critic(category), 1.0) + _is(network.class_critic(classes.detach()), 0.0)
    told = told + _is(network.style_critic(normal), 1.0) + _is(network.style_critic(style.detach()), 0.0)
    told.backward()  # type: ignore[no-untyped-call]
    torch.nn.utils.clip_grad_norm_(makers, recipe.clip)
    torch.nn.utils.clip_grad_norm_(critics, recipe.clip)
    return float(loss.detach())


def _is(judged: Tensor, value: float) -> Tensor:
    return binary_cross_entropy_with_logits(judged, torch.full_like(judged, value))


@torch.no_grad()
def _revive(network: PostureAutoencoder, postures: Float32Array, rng: np.random.Generator, device: str) -> None:
    """Guard against collapse: heads that no posture of a sample has move to postures far from their head."""
    if network.form == "linear":
        return
    rows = np.sort(rng.permutation(len(postures))[: 8 * len(network.heads)])
    classes, style = network.encode(torch.from_numpy(postures[rows]).to(device))
    code = network.code(classes, style)
    nearest = network.apart(code).min(dim=1)
    used = torch.bincount(nearest.indices, minlength=len(network.heads)) > 0
    dead = torch.nonzero(~used)[:, 0]
    far = torch.argsort(nearest.values, descending=True, stable=True)[: len(dead)]
    network.heads[dead[: len(far)]] = code[far]


@torch.no_grad()
def _settle(network: PostureAutoencoder, postures: Float32Array) -> None:
    """Move every "nearest" head to the mean code of its class, postures weighted by their class probabilities."""
    if network.form == "linear":
        return
    sums, weights = torch.zeros_like(network.heads), torch.zeros(len(network.heads), 1)
    for rows in torch.split(torch.from_numpy(postures), SETTLE_ROWS):
        classes, style = network.encode(rows)
        sums += classes.T @ network.code(classes, style)
        weights += classes.sum(dim=0)[:, None]
    network.heads.copy_(torch.where(weights > 0, sums / weights, network.heads))


@torch.no_grad()
def _typical(network: PostureAutoencoder, postures: Float32Array) -> Float32Array:
    """[m, D] the mean posture of each symbol; that which the decoder makes of its head, where no posture has it."""
    symbols = AutoencoderEncoder(network).symbols(postures)
    sums = np.zeros((len(network.heads), postures.shape[1]))
    np.add.at(sums, symbols, postures)
    counts = np.bincount(symbols, minlength=len(sums))[:, None]
    means = sums / np.maximum(counts, 1)
    return np.where(counts > 0, means, network.decode(network.heads).numpy()).astype(np.float32)


@torch.no_grad()
def _metrics(
    network: PostureAutoencoder, postures: Float32Array, outside: Int64Array, losses: list[float]
) -> dict[str, Any]:
    symbols = AutoencoderEncoder(network).symbols(postures)
    share = np.bincount(symbols, minlength=len(network.heads)) / len(symbols)
    entropy = -float(np.sum(share[share > 0] * np.log(share[share > 0])))
    metrics = {
        "postures": len(postures),
        "occupied": int(np.count_nonzero(share)),
        "largest": float(share.max()),
        "perplexity": float(np.exp(entropy)),
        "loss": [round(float(np.mean(losses[i : i + REPORT_EVERY])), 5) for i in range(0, len(losses), REPORT_EVERY)],
    }
    if len(outside):
        kept_out = torch.from_numpy(postures[outside])
        classes, style = network.encode(kept_out)
        error = (network.decode(network.code(classes, style)) - kept_out).square().mean() / network.scale.square()
        metrics["validation_error"] = float(error)
    return metrics


def grid(m: int) -> tuple[int, int]:
    """Rows and columns of a map of m nodes, as nearly square as m divides."""
    rows = max(r for r in range(1, int(m**0.5) + 1) if m % r == 0)
    return rows, m // rows


def self_organising_map(postures: Float32Array, rows: int, columns: int, seed: int) -> Float32Array:
    """[rows * columns, D] nodes, row by row, of a map trained in batches [Wu et al. 2009].

    Each epoch every node becomes the mean of all postures, weighted by a Gaussian of the distance on the grid
    between it and their nearest nodes; its width falls from half the longer side to a third of a node.
    """
    rng = np.random.default_rng(seed)
    places = np.stack(np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"), axis=-1).reshape(-1, 2)
    steps = np.square(places[:, None] - places[None]).sum(axis=2)
    nodes = _plane(postures, places, rng)
    first, last = max(rows, columns) / 2, 1 / 3
    for epoch in range(SOM_EPOCHS):
        width = first * (last / first) ** (epoch / (SOM_EPOCHS - 1))
        nearest = assign(postures, Motifs(nodes, np.ones(len(nodes))))
        counts = np.bincount(nearest, minlength=len(nodes)).astype(np.float64)
        sums = np.zeros(nodes.shape)
        np.add.at(sums, nearest, postures)
        near = np.exp(-steps / (2 * width**2))
        reached = near @ counts
        moved = (near @ sums) / np.maximum(reached, 1e-12)[:, None]
        nodes = np.where(reached[:, None] > 1e-9, moved, nodes).astype(np.float32)
    return nodes


def _plane(postures: Float32Array, places: np.ndarray, rng: np.random.Generator) -> Float32Array:
    """Nodes laid out over the plane of the first two principal components, a little disturbed."""
    mean = postures.mean(axis=0, dtype=np.float64)
    centred = postures - mean
    variances, directions = np.linalg.eigh(centred.T @ centred / len(postures))
    first = directions[:, -2:] * np.sqrt(np.maximum(variances[-2:], 0))
    spans = np.maximum(places.max(axis=0), 1)
    at = 2 * (places / spans) - 1
    flat = mean + at @ first[:, ::-1].T
    return np.asarray(flat + 1e-3 * rng.standard_normal(flat.shape) * centred.std(), dtype=np.float32)


def sample_postures(features: list[Float32Array], config: PosturesConfig) -> tuple[Float32Array, Int64Array]:
    """Postures [n, D] of clips, drawn at random up to `max_postures`, and the clip of each, in order."""
    stacked = np.concatenate(features)
    clips = np.repeat(np.arange(len(features)), [len(rows) for rows in features])
    if len(stacked) <= config.max_postures:
        return stacked, clips
    chosen = np.random.default_rng(config.seed).choice(len(stacked), config.max_postures, replace=False)
    chosen.sort()
    return stacked[chosen], clips[chosen]


def fit_dictionary(
    features: list[Float32Array],
    config: PosturesConfig,
    *,
    checkpoint: Path | None = None,
    progress: Progress | None = None,
) -> PostureDictionary:
    """Train a dictionary without labels on clips.

    Args:
        features: [T, D] postures of each clip, as `word_features` with `config.frames` gives them.
        config: kind, m, seed, recipe and size of the sample.
        checkpoint: a file that the autoencoder's training is saved to and goes on from.
        progress: called with (steps done, steps, loss); only the autoencoder is trained in steps.

    Raises:
        ValueError: fewer postures than symbols.
    """
    postures, clips = sample_postures(features, config)
    if len(postures) < config.m:
        raise ValueError(f"{len(postures)} postures are too few for {config.m} symbols")
    if config.dictionary == "aae":
        return train_autoencoder(postures, clips, config, checkpoint=checkpoint, progress=progress)
    if config.dictionary == "kmeans":
        codes = fit_motifs(postures, config.m, config.seed).centroids  # densest first
    else:
        codes = self_organising_map(postures, *grid(config.m), config.seed)
    encoder = NearestCode(np.ascontiguousarray(codes, dtype=np.float32))
    metrics = {"postures": len(postures), "occupied": len(np.unique(encoder.symbols(postures)))}
    return PostureDictionary(config, encoder, encoder.codes, encoder.codes, metrics)
