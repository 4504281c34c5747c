"""The two baselines that need no network, which the papers leave out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array
from numpy.typing import NDArray

from bench.glogen.motions import Motions, Pasts, Task, padded, pasts_of

ASKED_AT_ONCE: Final = 256


@dataclass
class ZeroVelocity:
    """The last pose, held."""

    task: Task

    def fit(self, data: Motions, seed: int) -> None:
        """Nothing to learn."""

    def predict(self, pasts: Pasts, classes: NDArray[np.int64], rng: np.random.Generator | None = None) -> Float32Array:
        """See `Baseline.predict`."""
        return np.repeat(pasts_of(pasts, self.task)[:, -1:], self.task.horizon, axis=1)


class NearestReal:
    """What followed the nearest past among real motions of the class, as it is; of all where the class has none.

    Pasts are compared pose by pose (Euclidean), at every pose of a motion that the horizon can follow.
    """

    def __init__(self, task: Task) -> None:
        self._task = task
        self._pasts = self._futures = np.zeros((0, 0), np.float32)
        self._classes = np.zeros(0, np.int64)

    def fit(self, data: Motions, seed: int) -> None:
        """Remember every past and what followed.

        Raises:
            ValueError: none that is long enough.
        """
        pasts, futures, classes = [], [], []
        for motion, label in zip(data.poses, data.classes.tolist(), strict=True):
            for stop in range(self._task.least, len(motion) - self._task.horizon + 1):
                pasts.append(padded(np.asarray(motion[:stop], np.float32), self._task.past).ravel())
                futures.append(motion[stop : stop + self._task.horizon])
                classes.append(label)
        if not pasts:
            raise ValueError(f"no motion of {self._task.least + self._task.horizon} poses")
        self._pasts, self._futures, self._classes = np.stack(pasts), np.stack(futures), np.array(classes, np.int64)

    def predict(self, pasts: Pasts, classes: NDArray[np.int64], rng: np.random.Generator | None = None) -> Float32Array:
        """See `Baseline.predict`.

        Raises:
            RuntimeError: not fitted.
        """
        if not len(self._pasts):
            raise RuntimeError("fit before predict")
        asked = pasts_of(pasts, self._task).reshape(len(classes), -1)
        found = np.zeros((len(asked), *self._futures.shape[1:]), np.float32)
        for label in np.unique(classes):
            known = np.flatnonzero(self._classes == label)
            known = known if len(known) else np.arange(len(self._classes))
            rows = np.flatnonzero(classes == label)
            for start in range(0, len(rows), ASKED_AT_ONCE):
                part = rows[start : start + ASKED_AT_ONCE]
                found[part] = self._futures[known[_nearest(asked[part], self._pasts[known])]]
        return found


def _nearest(asked: Float32Array, known: Float32Array) -> NDArray[np.int64]:
    """[q] row of `known` [n, d] nearest to each of `asked` [q, d]; the first of equals."""
    apart = (known.astype(np.float64) ** 2).sum(axis=1) - 2 * (asked.astype(np.float64) @ known.astype(np.float64).T)
    return np.asarray(apart.argmin(axis=1), np.int64)
