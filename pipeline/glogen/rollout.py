"""Rollout of sparse poses by GloGen: predict, append, predict again, class after class, until the time is filled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import torch
from motionlake.arrays import BoolArray, Float64Array, FloatArray, Int64Array
from motionlake.glogen.config import SEEDS
from motionlake.glogen.network import ParallelDecoder, Seq2Seq
from motionlake.glogen.sparse import DURATION, JOINT_COLUMNS
from motionlake.glogen.training import ByClass
from motionlake.glogen.trajectories import JOINTS_GIVEN
from torch import Tensor

# Limits of the factor by which an action is slowed down or sped up so that it ends in time.
SLOWEST: Final = 1.5
FASTEST: Final = 0.75
# Batches of exactly this many, the last one filled up, so that a motion does not depend on those beside it.
BATCH: Final = 32


@dataclass
class Rollout:
    """The sparse poses of one motion, extended prediction by prediction.

    Attributes:
        given: [5, 65] the last poses; at first the seed poses.
        targets: K classes, each for an equal share of the time.
        latents: [K, L] latent variables.
        seconds: length of the motion.
        pace: speed relative to the recordings.
        ending: [K] whether a class is an action with an end. Such an action is repeated as often as fits its time
            best, a little faster or slower. None by default.
        taken: [K] how many poses of each prediction are kept; all by default.
        rows: sparse poses so far, from the last seed pose on; the logarithm of their seconds includes the pace.
        begins: start of each class, seconds.
        anew: whether a class, or a repetition of an action, starts with the next poses.
        slowed: how many times as long the first prediction takes as it would, so that its action ends in time.
    """

    given: Float64Array
    targets: Sequence[int]
    latents: Float64Array
    seconds: float
    pace: float
    ending: Sequence[bool] = ()
    taken: Sequence[int] = ()
    rows: list[Float64Array] = field(init=False)
    begins: list[float] = field(init=False, default_factory=lambda: [0.0])
    anew: bool = field(init=False, default=False)
    slowed: float = field(init=False, default=1.0)
    _time: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        self.rows = [self.given[-1]]

    @property
    def done(self) -> bool:
        return self._time >= self.seconds

    @property
    def target(self) -> int:
        """The class of the next poses."""
        return self.targets[len(self.begins) - 1]

    @property
    def latent(self) -> Float64Array:
        """[L] of the next poses."""
        latent: Float64Array = self.latents[len(self.begins) - 1]
        return latent

    def take(self, made: Float64Array) -> None:
        """Append predicted poses [n, 65], as many as fit the time of the current class."""
        index = len(self.begins) - 1
        made = made[: self.taken[index]] if self.taken else made
        until = self.seconds * len(self.begins) / len(self.targets)
        self.anew = bool(self.ending) and self.ending[index]
        slower = self._fitting(made, until - self._time) if self.anew else 1.0
        if len(self.rows) == 1:
            self.slowed = slower
        taken = 0
        while taken < len(made) and self._time < until:
            row = made[taken].copy()
            row[DURATION] += np.log(slower / self.pace)
            self._time += float(np.exp(row[DURATION]))
            self.rows.append(row)
            taken += 1
        self.given = np.concatenate([self.given, made[:taken]])[-SEEDS:]
        if self._time >= until and len(self.begins) < len(self.targets):
            self.begins.append(self._time)
            self.anew = True

    def _fitting(self, made: Float64Array, left: float) -> float:
        """The factor to slow an action by, so that whole repetitions fill the time that is left."""
        once = float(np.exp(made[:, DURATION]).sum()) / self.pace
        slower = left / (once * max(1, round(left / once)))
        # A hair longer, so that rounding does not start another repetition.
        return float(np.clip(slower * (1 + 1e-6), FASTEST, SLOWEST))

    def times(self) -> Float64Array:
        """[n] seconds of `rows`, from 0."""
        return np.concatenate([[0.0], np.cumsum(np.exp([row[DURATION] for row in self.rows[1:]]))])


def roll_out(networks: ByClass, rollouts: Sequence[Rollout]) -> Sequence[Rollout]:
    """Predict until the time of every rollout is filled."""
    while True:
        growing = [rollout for rollout in rollouts if not rollout.done]
        if not growing:
            return rollouts
        by_network: list[list[Rollout]] = [[] for _ in networks.of]
        for rollout in growing:
            by_network[networks.place(rollout.target)[0]].append(rollout)
        for index, waiting in enumerate(by_network):
            for start in range(0, len(waiting), BATCH):
                some = waiting[start : start + BATCH]
                for rollout, made in zip(some, _predicted(networks, index, some), strict=True):
                    rollout.take(made)


def _predicted(networks: ByClass, index: int, rollouts: Sequence[Rollout]) -> Float64Array:
    filled = [*rollouts, *[rollouts[0]] * (BATCH - len(rollouts))]
    targets = np.array([networks.place(rollout.target)[1] for rollout in filled])
    made = predict(
        networks.network(index), np.stack([rollout.given for rollout in filled]), targets,
        np.stack([rollout.latent for rollout in filled]), np.array([rollout.anew for rollout in filled]),
    )  # fmt: skip
    return made[: len(rollouts)]


# Greatest speed of the mean joint on the way from a foreign pose to the start of a class, body lengths a second.
SPEED: Final = 1.5


def predict(
    network: ParallelDecoder | Seq2Seq,
    given: FloatArray,
    targets: Int64Array,
    latent: FloatArray,
    anew: BoolArray | None = None,
) -> Float64Array:
    """Predict the sparse poses after given ones, clamped to the range of the training data.

    Args:
        network: in evaluation mode.
        given: [B, 5, 65] sparse poses, of any class.
        targets: [B] class to predict.
        latent: [B, L] latent variables; zeros for the most likely poses.
        anew: [B] whether the class starts after the given poses, which end another class or repetition; default no.

    Returns:
        [B, 15, 65].
    """
    wanted, chance = torch.from_numpy(targets), torch.from_numpy(np.asarray(latent, dtype=np.float32))
    begins = torch.zeros(len(given), dtype=torch.bool) if anew is None else torch.from_numpy(anew)
    with torch.inference_mode():
        rows = torch.from_numpy(np.asarray(given, dtype=np.float32))
        read = network.scale(rows)
        if isinstance(network, ParallelDecoder):
            read = network.beginnings(read, wanted, begins)
        made = network.scale.within(network.scale.back(network(read, wanted, chance)))
        return led_over(made, (rows - network.scale.back(read))[:, -1]).double().numpy()


def led_over(made: Tensor, apart: Tensor) -> Tensor:
    """Lengthen the first step of predicted poses [B, n, 65] where the given poses are far from those that were read.

    `apart` [B, 65] is that difference; the step takes as long as joints at `SPEED` need.
    """
    led = made.clone()
    way = apart[:, JOINT_COLUMNS].reshape(-1, JOINTS_GIVEN, 3).norm(dim=2).mean(dim=1)
    led[:, 0, DURATION] = torch.maximum(led[:, 0, DURATION], (way / SPEED).clamp(min=1e-6).log())
    return led
