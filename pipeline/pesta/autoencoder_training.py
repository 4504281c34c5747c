"""Training the clustering autoencoder (PESTA, section 5.2), until the loss on held-out clips stops falling."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from motionlake.arrays import Float32Array, Int64Array, Progress
from motionlake.early_stopping import Watched, stands_still
from motionlake.pesta.autoencoder import AutoencoderEncoder, AutoencoderRecipe, PostureAutoencoder
from motionlake.pesta.config import PosturesConfig
from motionlake.pesta.occupancy import mean_postures
from motionlake.training import Checkpoint, Loop, on_threads
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits, one_hot

REPORT_EVERY: Final = 50
CHECKPOINT_EVERY: Final = 250
VALIDATED: Final = 4096  # held-out postures at most that are validated on
LEAST_FALL: Final = 1e-3  # of the validation loss, that counts as one


@dataclass(frozen=True)
class TrainedAutoencoder:
    """A trained network with its dictionary.

    Attributes:
        encoder: from postures to symbols.
        codes: [m, d] of the symbols, whose Euclidean distances are theirs: the heads, as in the paper, or, where these
            were trained to be postures by themselves (`AutoencoderRecipe.from_head`), what the decoder makes of them.
        postures: [m, D] the mean posture of each symbol; what the decoder makes of its head, where none has it.
        metrics: `steps` done; `curve`, of each validation the step, the loss, and the symbols in use of the held-out
            postures; `validation_error`, the mean square error of these made again, as a share of the variance.
    """

    encoder: AutoencoderEncoder
    codes: Float32Array
    postures: Float32Array
    metrics: dict[str, Any]


def train_autoencoder(
    postures: Float32Array,
    clips: Int64Array,
    config: PosturesConfig,
    recipe: AutoencoderRecipe,
    *,
    checkpoint: Path | None = None,
    device: str | None = None,
    progress: Progress | None = None,
) -> TrainedAutoencoder:
    """Train the autoencoder on postures.

    Args:
        postures: [n, D] features of single frames.
        clips: [n] clip of each.
        config: m and the seed.
        recipe: how to train.
        checkpoint: a file to save training to and to go on from; deleted at the end.
        device: of the computation; CUDA where there is one, else the CPU.
        progress: called with (steps done, steps at most, loss) every so often.

    Returns:
        The network with the lowest validation loss; the same for the same input, configuration and seed, interrupted or
        not (on CUDA: up to rounding).

    Raises:
        ValueError: fewer training postures than symbols.
    """
    device = device or ("cuda" if torch.cuda.is_available() else "cpu")
    rng = np.random.default_rng(config.seed)
    outside = held_out(clips, recipe, rng)
    known, other = postures[~outside], postures[outside]
    other = other[np.sort(rng.permutation(len(other))[:VALIDATED])] if len(other) else known[:VALIDATED]
    if len(known) < config.m:
        raise ValueError(f"{len(known)} postures to train on are too few for {config.m} symbols")
    with on_threads(1), torch.random.fork_rng(devices=[]):
        torch.manual_seed(config.seed)
        size = (postures.shape[1], config.m, recipe.style, recipe.hidden)
        network = PostureAutoencoder(*size)
        mean = known.mean(axis=0, dtype=np.float64).astype(np.float32)
        network.mean.copy_(torch.from_numpy(mean))
        network.scale.fill_(float(np.std(known - mean, dtype=np.float64)) or 1.0)
        steps = recipe.count(len(known))
        watched = Watched(network, -(-steps // recipe.every), numbers=3).to(device)
        kept = Checkpoint(checkpoint, known, config, recipe) if checkpoint else None
        parameters = [*network.autoencoder(), *network.critics()]
        optimiser = torch.optim.Adam(parameters, lr=recipe.learning_rate, betas=(recipe.momentum, 0.999))
        seen = torch.from_numpy(other).to(device)

        def train(step: int) -> float:
            optimiser.zero_grad(set_to_none=True)
            loss = _step(network, known[rng.integers(0, len(known), recipe.batch)], recipe, rng, device)
            optimiser.step()
            if (step + 1) % recipe.every == 0 or step + 1 == steps:
                loss_outside, occupied = _validated(network, seen, recipe)
                watched.add(loss_outside, step + 1, occupied)
            return loss

        done = Loop(
            watched, optimiser, rng, steps, train, kept, CHECKPOINT_EVERY, progress, REPORT_EVERY,
            over=lambda: stands_still(watched.losses, recipe.patience, lambda least: least - LEAST_FALL),
        ).run()  # fmt: skip
        return _trained(watched.cpu(), known, other, recipe, len(done))


def held_out(clips: Int64Array, recipe: AutoencoderRecipe, rng: np.random.Generator) -> np.ndarray:
    """[n] which postures are validated on, by their clips [n]; of a single clip, as of the paper, single postures."""
    names = np.unique(clips)
    if recipe.by_posture or len(names) == 1:
        chosen = np.zeros(len(clips), dtype=np.bool_)
        chosen[rng.permutation(len(clips))[: int(recipe.validation * len(clips))]] = True
        return chosen
    return np.isin(clips, rng.permutation(names)[: round(recipe.validation * len(names))])


def _step(
    network: PostureAutoencoder,
    postures: Float32Array,
    recipe: AutoencoderRecipe,
    rng: np.random.Generator,
    device: str,
) -> float:
    """Gradients of one step: those of the autoencoder, then the critics' own; returns the first loss."""
    makers, critics = network.autoencoder(), network.critics()
    wanted = torch.from_numpy(postures).to(device)
    for critic in critics:
        critic.requires_grad_(False)
    classes, style = network.encode(wanted)
    loss = _made_again(network, wanted, classes, style, recipe)
    loss = loss + recipe.class_weight * _CLASS_TERMS[recipe.classes](network, classes, recipe)
    loss = loss + recipe.style_weight * _is(network.style_critic(style), 1.0)
    loss.backward()  # type: ignore[no-untyped-call]
    for critic in critics:
        critic.requires_grad_(True)
    normal = torch.from_numpy(rng.standard_normal(style.shape).astype(np.float32)).to(device)
    told = _is(network.style_critic(normal), 1.0) + _is(network.style_critic(style.detach()), 0.0)
    if recipe.classes == "critic":
        drawn = torch.from_numpy(rng.integers(0, len(network.heads), len(postures))).to(device)
        category = one_hot(drawn, len(network.heads)).float()
        told = told + _is(network.class_critic(category), 1.0) + _is(network.class_critic(classes.detach()), 0.0)
    told.backward()  # type: ignore[no-untyped-call]
    torch.nn.utils.clip_grad_norm_(makers, recipe.clip)
    torch.nn.utils.clip_grad_norm_(critics, recipe.clip)
    return float(loss.detach())


def _made_again(
    network: PostureAutoencoder, wanted: Tensor, classes: Tensor, style: Tensor, recipe: AutoencoderRecipe
) -> Tensor:
    """The mean square error of postures from their codes, and from their heads alone, as shares of the variance."""
    loss = (network.decode(network.code(classes, style)) - wanted).square().mean()
    if recipe.from_head:
        soft = classes @ network.heads
        hard = network.heads[classes.argmax(dim=1)]
        # The head of the class that is taken, with the gradient of the mixture of all.
        loss = loss + recipe.from_head * (network.decode(hard + soft - soft.detach()) - wanted).square().mean()
    return loss / network.scale.square()


def _little_information(network: PostureAutoencoder, classes: Tensor, recipe: AutoencoderRecipe) -> Tensor:
    """Less the mutual information of posture and class in a batch [B, m], its second entropy weighted."""
    return recipe.sharpness * _entropy(classes).mean() - _entropy(classes.mean(dim=0))


def _entropy(shares: Tensor) -> Tensor:
    return -torch.xlogy(shares, shares.clamp(min=1e-12)).sum(dim=-1)


def _unlike_one_hot(network: PostureAutoencoder, classes: Tensor, recipe: AutoencoderRecipe) -> Tensor:
    """How surely the critic tells classes from one-hot vectors."""
    return _is(network.class_critic(classes), 1.0)


_CLASS_TERMS: Final[dict[str, Callable[[PostureAutoencoder, Tensor, AutoencoderRecipe], Tensor]]] = {
    "information": _little_information,
    "critic": _unlike_one_hot,
}


def _is(judged: Tensor, value: float) -> Tensor:
    return binary_cross_entropy_with_logits(judged, torch.full_like(judged, value))


@torch.no_grad()
def _validated(network: PostureAutoencoder, postures: Tensor, recipe: AutoencoderRecipe) -> tuple[float, int]:
    """The loss of held-out postures, of which critics have no part, and how many symbols they have."""
    classes, style = network.encode(postures)
    loss = _made_again(network, postures, classes, style, recipe)
    if recipe.classes == "information":
        loss = loss + recipe.class_weight * _little_information(network, classes, recipe)
    return float(loss), len(torch.unique(classes.argmax(dim=1)))


@torch.no_grad()
def _trained(
    watched: Watched[PostureAutoencoder],
    known: Float32Array,
    other: Float32Array,
    recipe: AutoencoderRecipe,
    steps: int,
) -> TrainedAutoencoder:
    network = watched.best.eval()
    encoder, m = AutoencoderEncoder(network), len(network.heads)
    means, counts = mean_postures(known, encoder.symbols(known), m)
    heads, drawn = network.heads.detach().numpy().copy(), network.decode(network.heads).numpy()
    typical = np.where(counts[:, None] > 0, means, drawn).astype(np.float32)
    held = torch.from_numpy(other)
    error = (network.decode(network.code(*network.encode(held))) - held).square().mean() / network.scale.square()
    metrics = {
        "steps": steps,
        "curve": [[int(step), round(loss, 5), int(occupied)] for loss, step, occupied in watched.measures],
        "validation_error": float(error),
    }
    return TrainedAutoencoder(encoder, drawn if recipe.from_head else heads, typical, metrics)
