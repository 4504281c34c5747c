"""LocGen and its training: dense, natural motion between sparse poses (section 4.2, second stage).

Equation 4.3 as printed, alpha X_i + (1 - alpha) X_{i+1} with alpha = j / M, runs from X_{i+1} back to X_i. Here the
poses run from X_i to X_{i+1}, as its text has it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import numpy as np
import torch
from motionlake.arrays import Float64Array, FloatArray, Int64Array, Progress
from motionlake.glogen.config import LocGenRecipe
from motionlake.glogen.network import RowScale
from motionlake.glogen.sparse import HEIGHT, STEP, TURN, TrainingPiece
from motionlake.glogen.trajectories import FPS, BodyMotion, turned_steps
from motionlake.motion.resampling import interpolated
from motionlake.training import Checkpoint, Training, on_threads, optimiser_of, rate_of
from scipy.interpolate import PchipInterpolator
from torch import Tensor, nn
from torch.nn.functional import binary_cross_entropy_with_logits

POSE: Final = HEIGHT + 1  # joints and height
MOVING: Final = POSE + 3  # and velocity and turning
WIDTH: Final = MOVING + 2  # and where between two poses, seconds there
WINDOW: Final = 64  # frames that "frames" sees at once while training
CHECKPOINT_EVERY: Final = 5
# Batches of exactly this many, the last one filled up, so that a motion does not depend on those beside it.
BATCH: Final = 16


class DenseDecoder(nn.Module):
    """Reads a whole motion frame by frame, both ways in time; gives what to add, and which foot stands."""

    def __init__(self, recipe: LocGenRecipe) -> None:
        super().__init__()
        self.recipe = recipe
        self.scale = RowScale(WIDTH)
        self.embed = nn.Sequential(nn.Linear(WIDTH, recipe.embedding), nn.GELU(), nn.Dropout(recipe.dropout))
        self.recurrent = nn.GRU(
            recipe.embedding, recipe.state // 2, 2, batch_first=True, bidirectional=True, dropout=recipe.dropout
        )
        self.out = nn.Linear(recipe.state, MOVING + 2)
        for parameter in self.out.parameters():  # starts from the interpolated poses themselves
            nn.init.zeros_(parameter)

    def forward(self, rows: Tensor) -> Tensor:
        """[B, T, 66] of interpolated rows [B, T, 66]: scaled joints, height, velocity and turning; logits of feet."""
        scaled = self.scale(rows)
        states, _ = self.recurrent(self.embed(scaled))
        found = self.out(states)
        return torch.cat([scaled[..., :MOVING] + found[..., :MOVING], found[..., MOVING:]], dim=-1)


class Inbetweener(nn.Module):
    """The thesis's: poses between two sparse poses, an encoder whose states all go to the decoder (equation 4.4)."""

    def __init__(self, recipe: LocGenRecipe) -> None:
        super().__init__()
        self.recipe = recipe
        self.scale = RowScale(WIDTH)
        self.embed = nn.Linear(POSE, recipe.embedding)
        self.encoder = nn.LSTM(recipe.embedding, recipe.state // 2, batch_first=True, bidirectional=True)
        self.decoder = nn.LSTM(recipe.state, recipe.state // 2, batch_first=True, bidirectional=True)
        self.out = nn.Linear(recipe.state, POSE)

    def forward(self, poses: Tensor) -> Tensor:
        """[B, M, 61] scaled natural poses, of M interpolated ones [B, M, 61] between two sparse poses."""
        states, _ = self.encoder(self.embed(self.scale(poses)))
        decoded, _ = self.decoder(states)
        return self.out(decoded)  # type: ignore[no-any-return]


def locgen_network(recipe: LocGenRecipe) -> DenseDecoder | Inbetweener:
    """An untrained network."""
    return DenseDecoder(recipe) if recipe.architecture == "frames" else Inbetweener(recipe)


def between(first: Float64Array, second: Float64Array, count: int) -> Float64Array:
    """[M, d] M = `count` poses after the pose `first` [d], the last of them `second`: equation 4.3, forwards."""
    share = np.arange(1, count + 1)[:, None] / count
    poses: Float64Array = (1 - share) * first + share * second
    return poses


def interpolated_motion(rows: Float64Array, times: Float64Array, at: Float64Array) -> Float64Array:
    """Sparse poses at given times.

    Args:
        rows: [n, 65] sparse poses.
        times: [n] seconds of them, ascending.
        at: [T] seconds, within.

    Returns:
        [T, 66]: 60 joint coordinates and height, by cubics that do not overshoot (Fritsch and Butland, 1984), which on
        recorded motion are nearer to it than straight lines; velocity of the hips (left, forward, body lengths a
        second) and turning (radians a second), even from pose to pose; how far between its two poses an instant is,
        0 to 1; the logarithm of the seconds between these.
    """
    index = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    seconds = times[index + 1] - times[index]
    share = ((at - times[index]) / seconds)[:, None]
    poses = PchipInterpolator(times, rows[:, : HEIGHT + 1])(at)
    turned = rows[index + 1, TURN] * share[:, 0]
    # Steps are seen from the pose before; the body has turned since.
    velocity = turned_steps(rows[index + 1, STEP] / seconds[:, None], -turned)
    turning = (rows[index + 1, TURN] / seconds)[:, None]
    return np.concatenate([poses, velocity, turning, share, np.log(seconds)[:, None]], axis=1)


def dense_motions(
    network: DenseDecoder | Inbetweener, rows: Sequence[Float64Array], times: Sequence[Float64Array], frames: int
) -> list[BodyMotion]:
    """Motions of `frames` frames at 30 a second; the first is a thirtieth of a second after the first sparse pose.

    Args:
        network: trained.
        rows: of each motion its sparse poses [n, 65].
        times: of each the seconds of these, ascending from 0; `frames` frames lie within.
        frames: T.
    """
    at = np.arange(1, frames + 1) / FPS
    given = np.stack([interpolated_motion(r, t, np.minimum(at, t[-1])) for r, t in zip(rows, times, strict=True)])
    if isinstance(network, Inbetweener):
        return [_between(network, *one, at) for one in zip(rows, times, given, strict=True)]
    made = []
    for start in range(0, len(given), BATCH):
        some = given[start : start + BATCH]
        batch = np.concatenate([some, np.repeat(some[:1], BATCH - len(some), axis=0)])
        with torch.inference_mode():
            found = network(torch.from_numpy(batch).float())
            moving = network.scale.back(found[..., :MOVING]).double().numpy()
            stands = torch.sigmoid(found[..., MOVING:]).double().numpy()
        made += [BodyMotion.of_rows(moving[i], stands[i]) for i in range(len(some))]
    return made


def _between(
    network: Inbetweener, rows: Float64Array, times: Float64Array, given: Float64Array, at: Float64Array
) -> BodyMotion:
    """The thesis's: M poses between each two sparse poses, evenly in time; ways and turning as interpolated."""
    count = network.recipe.between
    poses = np.stack([between(rows[i, :POSE], rows[i + 1, :POSE], count) for i in range(len(rows) - 1)])
    with torch.inference_mode():
        natural = network.scale.back(network(torch.from_numpy(poses).float())).double().numpy()
    shares = np.arange(1, count + 1) / count
    instants = np.concatenate([[0.0], (times[:-1, None] + np.diff(times)[:, None] * shares).ravel()])
    known = np.concatenate([rows[:1, :POSE], natural.reshape(-1, POSE)])
    places = np.interp(np.minimum(at, times[-1]), instants, np.arange(len(instants)))
    pose = interpolated(known, places)
    return BodyMotion.of_rows(np.concatenate([pose, given[:, POSE:MOVING]], axis=1), np.zeros((len(at), 2)))


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
        loss, count = _examples(network, pieces, rng)
        losses = Training(
            network, optimiser_of(network, recipe), recipe.epochs_of(len(pieces)), rate_of(recipe),
            lambda: np.array_split(rng.permutation(count), recipe.batches(count)), loss, seed, rng, kept,
            CHECKPOINT_EVERY, progress, stays=stays,
        ).run()  # fmt: skip
    return network.eval(), losses


def _examples(
    network: DenseDecoder | Inbetweener, pieces: Sequence[TrainingPiece], rng: np.random.Generator
) -> tuple[Callable[[Int64Array], Tensor], int]:
    """The loss of chosen examples, and how many: pieces, or, as in the thesis, what lies between two poses."""
    if isinstance(network, DenseDecoder):
        return lambda chosen: _frames_loss(network, [pieces[i] for i in chosen], rng), len(pieces)
    pairs = [pair for piece in pieces for pair in poses_between(piece, network.recipe.between)]
    given, wanted = (torch.from_numpy(np.stack(some)).float() for some in zip(*pairs, strict=True))
    return lambda chosen: _between_loss(network, given[chosen], wanted[chosen]), len(pairs)


def _frames_loss(network: DenseDecoder, pieces: Sequence[TrainingPiece], rng: np.random.Generator) -> Tensor:
    recipe = network.recipe
    inputs, outputs = [], []
    for piece in pieces:
        rows = piece.sparse.rows.copy()
        rows[:, :HEIGHT] += recipe.noise * rng.standard_normal(rows[:, :HEIGHT].shape)
        start = int(rng.integers(0, max(1, len(piece.motion) - WINDOW + 1)))
        inputs.append(_window(_interpolated(piece, rows), start))
        outputs.append(_window(np.concatenate([piece.motion.rows, piece.motion.stands], axis=1), start))
    given, wanted = (torch.from_numpy(np.stack(several)).float() for several in (inputs, outputs))
    made, scaled = network(given), network.scale(wanted[..., :MOVING])
    moving = made[..., :MOVING]
    error = _error(moving, scaled) + recipe.smooth * _error(torch.diff(moving, dim=1), torch.diff(scaled, dim=1))
    feet: Tensor = binary_cross_entropy_with_logits(made[..., MOVING:], wanted[..., MOVING:])
    return error + 0.1 * feet


def _between_loss(network: Inbetweener, given: Tensor, wanted: Tensor) -> Tensor:
    error: Tensor = (network(given) - network.scale(wanted)).square().mean()
    return error


def poses_between(piece: TrainingPiece, count: int) -> list[tuple[Float64Array, Float64Array]]:
    """Of every two sparse poses that follow each other [M, 61] interpolated and real poses after the first.

    The real ones are, as the sparse poses, equally far apart in moved distance.
    """
    rows, places = piece.sparse.rows[:, :POSE], piece.sparse.places
    frames = piece.motion.rows[:, :POSE]
    share = np.arange(1, count + 1) / count
    return [
        (between(rows[i], rows[i + 1], count), interpolated(frames, places[i] + share * (places[i + 1] - places[i])))
        for i in range(len(rows) - 1)
    ]


def _interpolated(piece: TrainingPiece, rows: Float64Array) -> Float64Array:
    at = np.arange(len(piece.motion)) / FPS
    return interpolated_motion(rows, piece.sparse.places / FPS, at)


def _window(rows: Float64Array, start: int) -> FloatArray:
    """`WINDOW` rows; a short motion stays in its last frame."""
    return rows[np.minimum(np.arange(start, start + WINDOW), len(rows) - 1)]


def _error(made: Tensor, true: Tensor) -> Tensor:
    squares = (made - true).square()
    return squares[..., :HEIGHT].mean() + 0.1 * squares[..., HEIGHT:].mean()
