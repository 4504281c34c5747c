"""What every method of the comparison answers to, and the training that all networks among them share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
import torch
from motionlake.arrays import Float32Array
from motionlake.training import on_threads
from numpy.typing import NDArray
from torch import Tensor, nn

from bench.fitting import Budget, Training
from bench.glogen.motions import Bones, Motions, Pasts, Task, pasts_of, windows_of

Augment = Callable[[Tensor, Tensor], Tensor]
BUDGET: Final = Budget(epochs=40)


class Baseline(Protocol):
    """A method that continues motion."""

    def fit(self, data: Motions, seed: int) -> None:
        """Learn from motions.

        Raises:
            ValueError: none, or one too short.
        """
        ...

    def predict(self, pasts: Pasts, classes: NDArray[np.int64], rng: np.random.Generator | None = None) -> Float32Array:
        """[m, H, D] of what follows pasts [m, p, D], of classes [m].

        Args:
            pasts: poses up to where prediction begins; in the sparse task the five seed poses.
            classes: wanted.
            rng: of what is left to chance; without one the method's best guess. Methods without chance ignore it.
        """
        ...


def unchanged(poses: Tensor, classes: Tensor) -> Tensor:
    """Poses as they are: no augmentation."""
    return poses


@dataclass(frozen=True)
class Settings:
    """What every network is given alike, and what a search may choose.

    Attributes:
        hidden: units of a recurrent layer.
        budget: of training.
        residual: whether the output is a step from the last pose; None: as published.
        augment: windows [B, P + H, D] and their classes [B] to windows of that shape, before normalisation.
    """

    hidden: int = 256
    budget: Budget = BUDGET
    residual: bool | None = None
    augment: Augment = unchanged


@dataclass(frozen=True)
class Shape:
    """What a network is built for.

    Attributes:
        width: D of a pose.
        classes: C of the prior.
        past, horizon: P and H.
        settings: what was chosen.
        bones: of the body.
        centre: [D], to be added to normalised poses to have them to scale (bones need it).
    """

    width: int
    classes: int
    past: int
    horizon: int
    settings: Settings
    bones: Bones
    centre: Tensor

    @property
    def entered(self) -> int:
        """Length of a pose with its class prior."""
        return self.width + self.classes


class Network(nn.Module):
    """A network that continues motion, in normalised poses."""

    def loss(self, past: Tensor, future: Tensor, prior: Tensor, done: float) -> Tensor:
        """What training makes small.

        Args:
            past: [B, P, D].
            future: [B, H, D].
            prior: [B, C] one-hot classes.
            done: share of the budget that is spent.
        """
        raise NotImplementedError

    def extend(self, past: Tensor, prior: Tensor, chance: torch.Generator | None) -> Tensor:
        """[B, H, D] after pasts [B, P, D]; the best guess without a generator."""
        raise NotImplementedError


def with_prior(poses: Tensor, prior: Tensor) -> Tensor:
    """Poses [B, T, D], each with the class prior [B, C] behind it: [B, T, D + C]."""
    return torch.cat([poses, prior[:, None].expand(-1, poses.shape[1], -1)], dim=2)


class Trained:
    """A network as a method: normalised poses, the budget, one thread.

    Args:
        build: makes the network, with weights drawn from torch's generator.
        task: what is given and wanted.
        settings: of network and training.

    Attributes:
        losses: mean of every epoch of the last fit.
        seconds: that it took.
    """

    def __init__(self, build: Callable[[Shape], Network], task: Task, settings: Settings) -> None:
        self._build, self._task, self._settings = build, task, settings
        self._fitted: _Fitted | None = None
        self.losses: tuple[float, ...] = ()
        self.seconds = 0.0

    def fit(self, data: Motions, seed: int) -> None:
        """Train; the same for the same input and seed on one machine, unless seconds end it."""
        rng, settings = np.random.default_rng(seed), self._settings
        windows = windows_of(data, self._task, rng)
        all_poses = np.concatenate([np.asarray(motion, np.float64) for motion in data.poses])
        centre, scale = all_poses.mean(axis=0), max(float(np.sqrt(all_poses.var(axis=0).mean())), 1e-9)
        mean, eye = torch.from_numpy(centre).float(), torch.eye(data.class_count)
        shape = Shape(
            len(centre), data.class_count, self._task.past, self._task.horizon, settings, data.bones, mean / scale
        )  # fmt: skip
        with on_threads(1), torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            network, losses = self._build(shape), []
            training = Training(network, len(windows.classes), settings.budget)
            while not training.over:
                poses, classes = torch.from_numpy(windows.poses), torch.from_numpy(windows.classes)

                def loss(rows: Tensor, poses: Tensor = poses, classes: Tensor = classes) -> Tensor:
                    x = (settings.augment(poses[rows], classes[rows]) - mean) / scale
                    past, future = x[:, : self._task.past], x[:, self._task.past :]
                    return network.loss(past, future, prior_of(classes[rows], eye), training.done)

                losses.append(training.epoch(loss))
                windows = windows_of(data, self._task, rng)
        self._fitted = _Fitted(network.eval(), mean, scale, eye)
        self.losses, self.seconds = tuple(losses), training.seconds

    def predict(self, pasts: Pasts, classes: NDArray[np.int64], rng: np.random.Generator | None = None) -> Float32Array:
        """See `Baseline.predict`.

        Raises:
            RuntimeError: not fitted.
        """
        if self._fitted is None:
            raise RuntimeError("fit before predict")
        network, mean, scale, eye = self._fitted.network, self._fitted.mean, self._fitted.scale, self._fitted.eye
        chance = None if rng is None else torch.Generator().manual_seed(int(rng.integers(2**62)))
        past = (torch.from_numpy(pasts_of(pasts, self._task)) - mean) / scale
        with on_threads(1), torch.no_grad():
            found = network.extend(past, prior_of(torch.from_numpy(classes), eye), chance)
        return np.asarray((found * scale + mean).numpy(), np.float32)


@dataclass(frozen=True)
class _Fitted:
    network: Network
    mean: Tensor
    scale: float
    eye: Tensor


def prior_of(classes: Tensor, eye: Tensor) -> Tensor:
    """One-hot rows [B, C] of classes [B]; of length 0 where there is no prior."""
    return eye[classes] if len(eye) else torch.zeros(len(classes), 0)
