"""LocGen: dense, natural motion between sparse poses (section 4.2, second stage).

Equation 4.3 as printed, alpha X_i + (1 - alpha) X_{i+1} with alpha = j / M, runs from X_{i+1} back to X_i. Here the
poses run from X_i to X_{i+1}, as its text has it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
import torch
from motionlake.arrays import Float64Array
from motionlake.glogen.sparse import DURATION, HEIGHT, STEP, TURN
from motionlake.glogen.trajectories import FPS, JOINTS_GIVEN, BodyMotion
from motionlake.motion.resampling import interpolated
from motionlake.motion.rotations import turn_on_ground
from scipy.interpolate import PchipInterpolator
from torch import Tensor, nn

JOINT_SCALE: Final = 0.1  # body lengths
POSE: Final = HEIGHT + 1  # joints and height
MOVING: Final = POSE + 3  # and velocity and turning


class RowScale(nn.Module):
    """Rows of interpolated motion to numbers of about one; joints are scaled alike."""

    mean: Tensor
    scale: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(WIDTH))
        self.register_buffer("scale", torch.ones(WIDTH))

    def learn(self, rows: Tensor) -> None:
        """From interpolated rows [n, 66]."""
        self.mean.copy_(rows.mean(dim=0))
        self.scale.copy_(rows.std(dim=0).clamp(min=1e-3))
        self.scale[:HEIGHT] = JOINT_SCALE

    def forward(self, rows: Tensor) -> Tensor:
        return (rows - self.mean[: rows.shape[-1]]) / self.scale[: rows.shape[-1]]


class DenseDecoder(nn.Module):
    """Reads a whole motion frame by frame, both ways in time; gives what to add, and which foot stands."""

    def __init__(self, recipe: LocGenRecipe) -> None:
        super().__init__()
        self.recipe = recipe
        self.scale = RowScale()
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
        self.scale = RowScale()
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


Architecture = Literal["frames", "between"]


@dataclass(frozen=True)
class LocGenRecipe:
    """Sizes and training of LocGen.

    Attributes:
        architecture: "frames": reads a whole interpolated motion at 30 frames a second; "between": the thesis's, reads
            the poses between two sparse poses alone.
        between: M of equation 4.3, poses from one sparse pose to the next; "frames" takes as many as the time holds.
        embedding, state: widths of what is made of a pose, and of the recurrent layers, both directions together.
        noise: of the sparse poses while training, body lengths.
        smooth: weight of the error of differences from frame to frame.
        epochs, steps: of training: so many epochs, more where these have fewer steps than `steps`.
    """

    architecture: Architecture = "frames"
    between: int = 0
    embedding: int = 128
    state: int = 192
    noise: float = 0.004
    smooth: float = 4.0
    dropout: float = 0.1
    optimiser: Literal["adam", "sgd"] = "adam"
    learning_rate: float = 2e-3
    weight_decay: float = 0.01
    batch: int = 16
    epochs: int = 20
    steps: int = 200

    def batches(self, count: int) -> int:
        """How many batches `count` pieces make."""
        return max(1, round(count / self.batch))

    def epochs_of(self, count: int) -> int:
        """How many epochs are trained on `count` pieces."""
        return max(self.epochs, -(-self.steps // self.batches(count)))


_RECIPES: Final = {
    "default": LocGenRecipe(),
    # Sections 4.2 and 4.3: as GloGen without classes, M = 5.
    "glogen": LocGenRecipe(
        architecture="between", between=5, embedding=200, state=1000, noise=0.0, smooth=0.0, dropout=0.0,
        optimiser="sgd", learning_rate=0.1, weight_decay=0.0, batch=64, epochs=10, steps=0,
    ),
}  # fmt: skip


def locgen_recipe(name: str, epochs: int = 0) -> LocGenRecipe:
    """The recipe of a name; `epochs` other than 0 replaces its own."""
    recipe = _RECIPES[name]
    return replace(recipe, epochs=epochs, steps=0) if epochs else recipe


WIDTH: Final = HEIGHT + 1 + 2 + 1 + 2  # joints, height, velocity, turning, where between two poses, seconds there


def between(first: Float64Array, second: Float64Array, count: int) -> Float64Array:
    """[M, d] M = `count` poses after the pose `first` [d], the last of them `second`: equation 4.3, forwards."""
    share = np.arange(1, count + 1)[:, None] / count
    poses: Float64Array = (1 - share) * first + share * second
    return poses


def times_of(rows: Float64Array) -> Float64Array:
    """[n] seconds of sparse poses [n, 65], the first at 0."""
    return np.concatenate([[0.0], np.cumsum(np.exp(rows[1:, DURATION]))])


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
    left, forward = (rows[index + 1, STEP] / seconds[:, None]).T
    turned = rows[index + 1, TURN] * share[:, 0]
    # Steps are seen from the pose before; the body has turned since.
    velocity = np.stack(turn_on_ground(left, forward, -turned), axis=1)
    turning = (rows[index + 1, TURN] / seconds)[:, None]
    return np.concatenate([poses, velocity, turning, share, np.log(seconds)[:, None]], axis=1)


# Batches of exactly this many, the last one filled up, so that a motion does not depend on those beside it.
BATCH: Final = 16


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
            scale, mean = network.scale.scale[:MOVING], network.scale.mean[:MOVING]
            moving = (found[..., :MOVING] * scale + mean).double().numpy()
            stands = torch.sigmoid(found[..., MOVING:]).double().numpy()
        made += [_motion(moving[i], stands[i]) for i in range(len(some))]
    return made


def _motion(moving: Float64Array, stands: Float64Array) -> BodyMotion:
    joints = moving[:, :HEIGHT].reshape(len(moving), JOINTS_GIVEN, 3)
    return BodyMotion(joints, moving[:, HEIGHT], moving[:, HEIGHT + 1 : HEIGHT + 3], moving[:, HEIGHT + 3], stands)


def _between(
    network: Inbetweener, rows: Float64Array, times: Float64Array, given: Float64Array, at: Float64Array
) -> BodyMotion:
    """The thesis's: M poses between each two sparse poses, evenly in time; ways and turning as interpolated."""
    count = network.recipe.between
    poses = np.stack([between(rows[i, :POSE], rows[i + 1, :POSE], count) for i in range(len(rows) - 1)])
    with torch.inference_mode():
        found = network(torch.from_numpy(poses).float())
        natural = (found * network.scale.scale[:POSE] + network.scale.mean[:POSE]).double().numpy()
    shares = np.arange(1, count + 1) / count
    instants = np.concatenate([[0.0], (times[:-1, None] + np.diff(times)[:, None] * shares).ravel()])
    known = np.concatenate([rows[:1, :POSE], natural.reshape(-1, POSE)])
    places = np.interp(np.minimum(at, times[-1]), instants, np.arange(len(instants)))
    pose = interpolated(known, places)
    return _motion(np.concatenate([pose, given[:, POSE:MOVING]], axis=1), np.zeros((len(at), 2)))
