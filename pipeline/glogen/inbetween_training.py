"""Training LocGen: what lies between the sparse poses of real motion."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
import torch
from motionlake.arrays import Float64Array, FloatArray, Int64Array, Progress
from motionlake.glogen.inbetweening import (
    MOVING,
    POSE,
    DenseDecoder,
    Inbetweener,
    LocGenRecipe,
    between,
    interpolated_motion,
    locgen_network,
)
from motionlake.glogen.sparse import HEIGHT, TrainingPiece
from motionlake.glogen.trajectories import FPS, BodyMotion
from motionlake.motion.resampling import interpolated
from motionlake.training import Checkpoint, Training, on_threads, optimiser_of, rate_of
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits

Pair = tuple[Float64Array, Float64Array]
WINDOW: Final = 64  # frames that "frames" sees at once while training
CHECKPOINT_EVERY: Final = 5


def train_locgen(
    pieces: Sequence[TrainingPiece],
    recipe: LocGenRecipe,
    seed: int,
    *,
    checkpoint: Path | None = None,
    stays: bool = False,
    progress: Progress | None = None,
) -> tuple[DenseDecoder | Inbetweener, list[float]]:
    """Train on pieces of clips, of any class.

    Args:
        pieces: with their sparse poses.
        recipe: how.
        seed: of weights, order and chance.
        checkpoint: a file to save training to and to go on from; deleted at the end, unless it `stays`.
        progress: called with (epochs done, epochs, mean loss).

    Returns:
        The network in evaluation mode, and the loss of each epoch.
    """
    rng = np.random.default_rng(seed)
    with on_threads(1), torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = locgen_network(recipe)
        learn = np.concatenate([_interpolated(piece, piece.sparse.rows) for piece in pieces])
        network.scale.learn(torch.from_numpy(learn).float())
        data = np.concatenate([*[piece.sparse.rows.ravel() for piece in pieces], [seed]]).astype(np.float32)
        kept = Checkpoint(checkpoint, data, recipe) if checkpoint else None
        losses = _fit(network, pieces, recipe, seed, rng, kept, stays, progress)
    return network.eval(), losses


def _fit(
    network: DenseDecoder | Inbetweener,
    pieces: Sequence[TrainingPiece],
    recipe: LocGenRecipe,
    seed: int,
    rng: np.random.Generator,
    checkpoint: Checkpoint | None,
    stays: bool,
    progress: Progress | None,
) -> list[float]:
    def loss(chosen: Int64Array) -> Tensor:
        some = [pieces[i] for i in chosen]
        return _frames_loss(network, some, rng) if isinstance(network, DenseDecoder) else _between_loss(network, some)

    return Training(
        network, optimiser_of(network, recipe), recipe.epochs_of(len(pieces)), rate_of(recipe),
        lambda: np.array_split(rng.permutation(len(pieces)), recipe.batches(len(pieces))), loss, seed, rng, checkpoint,
        CHECKPOINT_EVERY, progress, stays=stays,
    ).run()  # fmt: skip


def _frames_loss(network: DenseDecoder, pieces: Sequence[TrainingPiece], rng: np.random.Generator) -> Tensor:
    recipe = network.recipe
    inputs, outputs = [], []
    for piece in pieces:
        rows = piece.sparse.rows.copy()
        rows[:, :HEIGHT] += recipe.noise * rng.standard_normal(rows[:, :HEIGHT].shape)
        start = int(rng.integers(0, max(1, len(piece.motion) - WINDOW + 1)))
        inputs.append(_window(_interpolated(piece, rows), start))
        outputs.append(_window(_true(piece.motion), start))
    given, wanted = (torch.from_numpy(np.stack(several)).float() for several in (inputs, outputs))
    made, scaled = network(given), network.scale(wanted[..., :MOVING])
    moving = made[..., :MOVING]
    error = _error(moving, scaled) + recipe.smooth * _error(torch.diff(moving, dim=1), torch.diff(scaled, dim=1))
    feet: Tensor = binary_cross_entropy_with_logits(made[..., MOVING:], wanted[..., MOVING:])
    return error + 0.1 * feet


def _between_loss(network: Inbetweener, pieces: Sequence[TrainingPiece]) -> Tensor:
    count = network.recipe.between
    pairs = [pair for piece in pieces for pair in poses_between(piece, count)]
    given, wanted = (torch.from_numpy(np.stack([pair[i] for pair in pairs])).float() for i in (0, 1))
    error: Tensor = (network(given) - network.scale(wanted)).square().mean()
    return error


def poses_between(piece: TrainingPiece, count: int) -> list[Pair]:
    """Of every two sparse poses that follow each other [M, 61] interpolated and real poses after the first.

    The real ones are, as the sparse poses, equally far apart in moved distance.
    """
    rows, places = piece.sparse.rows[:, :POSE], piece.sparse.places
    frames = np.concatenate([piece.motion.joints.reshape(len(piece.motion), -1), piece.motion.height[:, None]], axis=1)
    share = np.arange(1, count + 1) / count
    return [
        (between(rows[i], rows[i + 1], count), interpolated(frames, places[i] + share * (places[i + 1] - places[i])))
        for i in range(len(rows) - 1)
    ]


def _interpolated(piece: TrainingPiece, rows: Float64Array) -> Float64Array:
    at = np.arange(len(piece.motion)) / FPS
    return interpolated_motion(rows, piece.sparse.places / FPS, at)


def _true(motion: BodyMotion) -> Float64Array:
    """[T, 66] joints, height, velocity, turning, standing feet."""
    return np.concatenate(
        [
            motion.joints.reshape(len(motion), -1), motion.height[:, None], motion.velocity, motion.turn[:, None],
            motion.stands,
        ],
        axis=1,
    )  # fmt: skip


def _window(rows: Float64Array, start: int) -> FloatArray:
    """`WINDOW` rows; a short motion stays in its last frame."""
    return rows[np.minimum(np.arange(start, start + WINDOW), len(rows) - 1)]


def _error(made: Tensor, true: Tensor) -> Tensor:
    squares = (made - true).square()
    return squares[..., :HEIGHT].mean() + 0.1 * squares[..., HEIGHT:].mean()
