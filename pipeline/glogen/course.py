"""Sparse poses by GloGen, block after block, class after class, until the time is filled."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import torch
from motionlake.arrays import BoolArray, Float64Array, FloatArray, Int64Array
from motionlake.glogen.config import SEEDS
from motionlake.glogen.network import Ahead, Blocks
from motionlake.glogen.sparse import DURATION, JOINT_COLUMNS
from motionlake.glogen.training import ByClass
from motionlake.glogen.trajectories import JOINTS_GIVEN
from torch import Tensor

# An action is slowed down or hurried at most so much to end with its time.
SLOWEST: Final = 1.5
FASTEST: Final = 0.75
# Batches of exactly this many, the last one filled up, so that a motion does not depend on those beside it.
BATCH: Final = 32


class Course:
    """One motion as it grows.

    Attributes:
        rows: sparse poses so far, the last one given first; the logarithm of their seconds has the pace in it.
        begins: the second that each class begins at.
    """

    def __init__(
        self,
        given: Float64Array,
        targets: Sequence[int],
        latent: Float64Array,
        seconds: float,
        pace: float,
        ending: Sequence[bool] = (),
        taken: Sequence[int] = (),
    ) -> None:
        """A motion that is to be made.

        Args:
            given: [5, 65] sparse poses.
            targets: K classes, each for an equal share of the time.
            latent: [K, L].
            seconds: in all.
            pace: 2: twice as fast as the recordings.
            ending: [K] classes whose motion comes to its end; so many whole ones are made as fit the time best, a
                little faster or slower. None by default.
            taken: [K] of the poses that are made at a time, how many are kept before others are made from these; all
                by default.
        """
        self.rows: list[Float64Array] = [given[-1]]
        self.begins: list[float] = [0.0]
        self._last = given
        self._targets, self._latent = list(targets), latent
        self._seconds, self._pace = seconds, pace
        self._ending = list(ending) or [False] * len(self._targets)
        self._taken: list[int | None] = list(taken) or [None] * len(self._targets)
        self._time = 0.0
        self._anew = False

    @property
    def done(self) -> bool:
        return self._time >= self._seconds

    @property
    def target(self) -> int:
        return self._targets[len(self.begins) - 1]

    @property
    def anew(self) -> bool:
        """Whether the class begins, or its action begins again, with the next poses."""
        return self._anew

    @property
    def given(self) -> Float64Array:
        """[5, 65] the last poses."""
        return self._last

    @property
    def latent(self) -> Float64Array:
        latent: Float64Array = self._latent[len(self.begins) - 1]
        return latent

    def take(self, made: Float64Array) -> None:
        """Go on by poses [n, 65], as far as the time of the class goes."""
        made = made[: self._taken[len(self.begins) - 1]]
        until = self._seconds * len(self.begins) / len(self._targets)
        slower = self._fitting(made, until - self._time) if self._ending[len(self.begins) - 1] else 1.0
        taken = 0
        while taken < len(made) and self._time < until:
            row = made[taken].copy()
            row[DURATION] += np.log(slower / self._pace)
            self._time += float(np.exp(row[DURATION]))
            self.rows.append(row)
            taken += 1
        self._last = np.concatenate([self._last, made[:taken]])[-SEEDS:]
        self._anew = self._ending[len(self.begins) - 1]
        if self._time >= until and len(self.begins) < len(self._targets):
            self.begins.append(self._time)
            self._anew = True

    def _fitting(self, made: Float64Array, left: float) -> float:
        """How much slower an action is to be, that whole ones fill the time that is left."""
        once = float(np.exp(made[:, DURATION]).sum()) / self._pace
        slower = left / (once * max(1, round(left / once)))
        # A hair more than asked for: rounding is not to begin another one.
        return float(np.clip(slower * (1 + 1e-6), FASTEST, SLOWEST))

    def times(self) -> Float64Array:
        """[n] seconds of `rows`, from 0."""
        return np.concatenate([[0.0], np.cumsum(np.exp([row[DURATION] for row in self.rows[1:]]))])


def go_on(networks: ByClass, courses: Sequence[Course]) -> Sequence[Course]:
    """Fill the time of every course."""
    while True:
        growing = [course for course in courses if not course.done]
        if not growing:
            return courses
        by_network: list[list[Course]] = [[] for _ in networks.of]
        for course in growing:
            by_network[networks.place(course.target)[0]].append(course)
        for index, asked in enumerate(by_network):
            for start in range(0, len(asked), BATCH):
                some = asked[start : start + BATCH]
                for course, made in zip(some, _ahead(networks, index, some), strict=True):
                    course.take(made)


def _ahead(networks: ByClass, index: int, courses: Sequence[Course]) -> Float64Array:
    filled = [*courses, *[courses[0]] * (BATCH - len(courses))]
    targets = np.array([networks.place(course.target)[1] for course in filled])
    made = follow(
        networks.network(index), np.stack([course.given for course in filled]), targets,
        np.stack([course.latent for course in filled]), np.array([course.anew for course in filled]),
    )  # fmt: skip
    return made[: len(courses)]


# Of the mean joint on the way from foreign poses to where a class begins, at most; body lengths a second.
SPEED: Final = 1.5


def follow(
    network: Ahead | Blocks,
    given: FloatArray,
    targets: Int64Array,
    latent: FloatArray,
    anew: BoolArray | None = None,
) -> Float64Array:
    """Sparse poses that follow, within what the network has seen while training.

    Args:
        network: in evaluation mode.
        given: [B, 5, 65] sparse poses; of any class.
        targets: [B] class wanted.
        latent: [B, L] what is left to chance; zeros for what is likeliest.
        anew: [B] whether the class begins with what follows, given the end of another, or its own; not if not given.

    Returns:
        [B, 15, 65].
    """
    wanted, chance = torch.from_numpy(targets), torch.from_numpy(np.asarray(latent, dtype=np.float32))
    begins = torch.zeros(len(given), dtype=torch.bool) if anew is None else torch.from_numpy(anew)
    with torch.inference_mode():
        rows = torch.from_numpy(np.asarray(given, dtype=np.float32))
        read = network.scale(rows)
        if isinstance(network, Ahead):
            read = network.beginnings(read, wanted, begins)
        made = network.scale.within(network.scale.back(network(read, wanted, chance)))
        return led_over(made, (rows - network.scale.back(read))[:, -1]).double().numpy()


def led_over(made: Tensor, apart: Tensor) -> Tensor:
    """Sparse poses [B, n, 65] to follow poses that are `apart` [B, 65] from those they were made after.

    The first of them takes as long as the way there needs.
    """
    led = made.clone()
    way = apart[:, JOINT_COLUMNS].reshape(-1, JOINTS_GIVEN, 3).norm(dim=2).mean(dim=1)
    led[:, 0, DURATION] = torch.maximum(led[:, 0, DURATION], (way / SPEED).clamp(min=1e-6).log())
    return led
