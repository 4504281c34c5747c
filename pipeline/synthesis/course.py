"""Sparse poses by GloGen, block after block, class after class, until the time is filled."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import torch

from pipeline.clip import FloatArray
from pipeline.glogen.network import Ahead, Blocks
from pipeline.glogen.recipe import SEEDS
from pipeline.trajectories.sparse import DURATION

# Batches of exactly this many, the last one filled up, so that a motion does not depend on those beside it.
BATCH: Final = 32


class Course:
    """One motion as it grows.

    Attributes:
        rows: sparse poses so far, the last one given first; the logarithm of their seconds has the pace in it.
        begins: the second that each class begins at.
    """

    def __init__(
        self, given: FloatArray, targets: Sequence[int], latent: FloatArray, seconds: float, pace: float
    ) -> None:
        """`given` [5, 65] sparse poses; `targets` classes, each for an equal share of `seconds`; `latent` [K, L]."""
        self.rows: list[FloatArray] = [given[-1]]
        self.begins: list[float] = [0.0]
        self._last = given
        self._targets, self._latent = list(targets), latent
        self._seconds, self._pace = seconds, pace
        self._time = 0.0

    @property
    def done(self) -> bool:
        return self._time >= self._seconds

    @property
    def target(self) -> int:
        return self._targets[len(self.begins) - 1]

    @property
    def given(self) -> FloatArray:
        """[5, 65] the last poses."""
        return self._last

    @property
    def latent(self) -> FloatArray:
        latent: FloatArray = self._latent[len(self.begins) - 1]
        return latent

    def take(self, made: FloatArray) -> None:
        """Go on by poses [n, 65], as far as the time of the class goes."""
        until = self._seconds * len(self.begins) / len(self._targets)
        taken = 0
        while taken < len(made) and self._time < until:
            row = made[taken].copy()
            row[DURATION] -= np.log(self._pace)
            self._time += float(np.exp(row[DURATION]))
            self.rows.append(row)
            taken += 1
        self._last = np.concatenate([self._last, made[:taken]])[-SEEDS:]
        if self._time >= until and len(self.begins) < len(self._targets):
            self.begins.append(self._time)

    def times(self) -> FloatArray:
        """[n] seconds of `rows`, from 0."""
        return np.concatenate([[0.0], np.cumsum(np.exp([row[DURATION] for row in self.rows[1:]]))])


def go_on(network: Ahead | Blocks, courses: Sequence[Course]) -> Sequence[Course]:
    """Fill the time of every course."""
    while True:
        growing = [course for course in courses if not course.done]
        if not growing:
            return courses
        for start in range(0, len(growing), BATCH):
            some = growing[start : start + BATCH]
            for course, made in zip(some, _ahead(network, some), strict=True):
                course.take(made)


def _ahead(network: Ahead | Blocks, courses: Sequence[Course]) -> FloatArray:
    filled = [*courses, *[courses[0]] * (BATCH - len(courses))]
    given = torch.from_numpy(np.stack([course.given for course in filled])).float()
    targets = torch.tensor([course.target for course in filled])
    latent = torch.from_numpy(np.stack([course.latent for course in filled])).float()
    with torch.inference_mode():
        scaled = network(network.scale(given), targets, latent)
        rows = network.scale.within(network.scale.back(scaled))
    return rows[: len(courses)].double().numpy()
