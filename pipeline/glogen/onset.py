"""The onset of a motion: the frames right after a seed clip, predicted from how recorded bodies went on.

Sparse poses say where a motion goes, not how fast, and the first of them lies a fifth of a second ahead. So two thirds
of a second to one and a half after recorded frames are predicted by themselves, then blended into the generated motion.
Kernel regression and a network both predict them, and the mean of the two is taken, which is nearer than either
(docs/synthesis.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import torch
from motionlake.arrays import Float64Array, Progress
from motionlake.glogen.config import OnsetRecipe
from motionlake.glogen.onset_examples import (
    FEATURES,
    FUTURE,
    KNOTS,
    LEVELS,
    ROOT,
    SCALES,
    Examples,
    examples_of,
    joined,
    one_sided,
)
from motionlake.glogen.onset_network import PACES, OnsetNetwork, train_onset_network
from motionlake.glogen.sparse import HEIGHT
from motionlake.glogen.trajectories import BodyMotion
from motionlake.motion.sides import nearest_of_another
from motionlake.training import on_threads
from scipy.interpolate import PchipInterpolator
from scipy.spatial.distance import cdist, pdist
from torch import Tensor, nn

ALONE: Final = 0.5  # share of what is predicted that is not led over to the generated motion yet
LEARNED: Final = 30_000  # examples that the network learns from, likewise
MOST: Final = 5000  # examples that kernels keep, of all classes together, half of them left for right
SOFT: Final = 0.1  # ridge
LINEAR: Final = 0.3  # share of the linear kernel: states unlike the examples are extrapolated
# A state is known that is no further from the nearest example than this times the quantile of the distances of examples
# from the nearest of another clip.
KNOWN: Final = 0.95
FURTHEST: Final = 2.0


class Onset(nn.Module):
    """What follows how a body stands and moves: a kernel for each of C classes, and a network for all.

    A Matern kernel (3/2) plus a linear one, chosen on clips that no metric is reported of (docs/synthesis.md).

    Attributes:
        classes: [n] of the examples.
        states: [n, 245] in `SCALES`.
        coefficients: [n, 896] of what follows, less its mean.
        means: [C, 896].
        widths: [C] of the kernels: the median distance of two examples.
        reaches: [C] how far from the nearest example a state is known.
        frames: [C] how many are predicted; none of a class without examples.
        network: of all classes.
    """

    classes: Tensor
    states: Tensor
    coefficients: Tensor
    means: Tensor
    widths: Tensor
    reaches: Tensor
    frames: Tensor

    def __init__(self, classes: int, network: OnsetNetwork, examples: int = 0) -> None:
        super().__init__()
        self.register_buffer("classes", torch.zeros(examples, dtype=torch.int64))
        self.register_buffer("states", torch.zeros(examples, FEATURES))
        self.register_buffer("coefficients", torch.zeros(examples, FUTURE))
        self.register_buffer("means", torch.zeros(classes, FUTURE))
        self.register_buffer("widths", torch.zeros(classes))
        self.register_buffer("reaches", torch.zeros(classes))
        self.register_buffer("frames", torch.zeros(classes, dtype=torch.int64))
        self.network = network
        self._known: dict[int, _Known] = {}

    def ahead(self, state: Float64Array, target: int, pace: float = 1.0) -> Float64Array | None:
        """[20 to 45, 64] rows of the frames after a state [245], pose and root; None where no recorded body moved so.

        As many frames as these take at another pace.
        """
        frames = int(self.frames[target])
        if not frames:
            return None
        apart, products = self._compared(state, target)
        if apart.min() > FURTHEST * float(self.reaches[target]):
            return None
        future = (self._regressed(apart, products, target) + self.by_network(state, target)) / 2
        return played(state, future, frames, pace)

    def by_kernel(self, state: Float64Array, target: int) -> Float64Array:
        """[14, 64] rows at `KNOTS` less that of the state, by kernel regression."""
        return self._regressed(*self._compared(state, target), target)

    def by_network(self, state: Float64Array, target: int) -> Float64Array:
        """The same by the network."""
        return self.network.follow(state / SCALES, target)

    def _compared(self, state: Float64Array, target: int) -> tuple[Float64Array, Float64Array]:
        """[n] distances of a state from the examples of a class, and its products with them."""
        known, asked = self._examples(target).states, state / SCALES
        return cdist(asked[None], known)[0], known @ asked

    def _regressed(self, apart: Float64Array, products: Float64Array, target: int) -> Float64Array:
        weights = _kernel(apart, products, float(self.widths[target]))
        future: Float64Array = weights @ self._examples(target).coefficients + self.means[target].double().numpy()
        return future.reshape(len(KNOTS), ROOT)

    def _examples(self, target: int) -> _Known:
        if target not in self._known:
            own = self.classes == target
            self._known[target] = _Known(self.states[own].double().numpy(), self.coefficients[own].double().numpy())
        return self._known[target]


class _Known(NamedTuple):
    """States [n, 245] and coefficients [n, 896] of a class in double precision, since single sums differ by machine."""

    states: Float64Array
    coefficients: Float64Array


def played(state: Float64Array, future: Float64Array, frames: int, pace: float = 1.0) -> Float64Array:
    """[round(frames / pace), 64] rows after a state [245], of what follows at `KNOTS`, [14, 64] less the state."""
    count = 1 + int(np.searchsorted(KNOTS, frames, side="right"))
    knots = np.concatenate([np.zeros((1, ROOT)), future])[:count]
    at = np.minimum(np.arange(1, max(1, round(frames / pace)) + 1) * pace, frames)
    rows: Float64Array = state[:ROOT] + PchipInterpolator([0, *KNOTS][:count], knots)(at)
    rows[:, HEIGHT + 1 :] *= pace
    return rows


def fit_onset(
    motions: Sequence[BodyMotion],
    targets: Sequence[int],
    cyclic: Sequence[bool],
    *,
    mirroring: Sequence[bool] = (),
    examples: int = MOST,
    recipe: OnsetRecipe | None = None,
    seed: int = 0,
    checkpoint: Path | None = None,
    progress: Progress | None = None,
) -> tuple[Onset, list[float]]:
    """Fit the kernels of every class, and train the network.

    Args:
        motions: whole clips.
        targets: class of each.
        cyclic: [C] whether each class is cyclic.
        mirroring: [C] whether mirror images of its clips may be of the same class; all by default, but for those that
            are done with one side.
        examples: that kernels keep, of all classes together, at most.
        recipe: of the network.
        seed: of its training.
        checkpoint: a file to save that to and to go on from; it stays.
        progress: called with (epochs done, epochs, mean loss).

    Returns:
        The onset in evaluation mode, and the loss of each epoch of the network.
    """
    count = len(cyclic)
    own = [[motion for motion, of in zip(motions, targets, strict=True) if of == target] for target in range(count)]
    sides = list(mirroring) or [True] * count
    both = [sides[c] and not one_sided(own[c], cyclic[c]) for c in range(count)]

    def of_classes(most: int, pace: float = 1.0) -> list[Examples]:
        return [examples_of(own[c], cyclic[c], max(2, most // count), both=both[c], pace=pace) for c in range(count)]

    learned = [joined(each) for each in zip(*(of_classes(LEARNED // len(PACES), pace) for pace in PACES), strict=True)]
    network, losses = train_onset_network(
        learned, recipe or OnsetRecipe(), seed, checkpoint=checkpoint, progress=progress
    )
    kept = [each if len(each) > 1 else each.of(slice(0)) for each in of_classes(examples)]
    onset, filled = Onset(len(cyclic), network, sum(map(len, kept))), 0
    with on_threads(1):  # sums of threads differ from run to run
        for target, each in enumerate(kept):
            if not len(each):
                continue
            rows = slice(filled, filled := filled + len(each))
            onset.classes[rows], onset.states[rows] = target, torch.from_numpy(each.states)
            width = max(float(np.median(pdist(each.states))), 1e-6)
            coefficients, mean, frames = _fitted(
                each, _kernel(cdist(each.states, each.states), each.states @ each.states.T, width)
            )
            onset.coefficients[rows], onset.means[target] = torch.from_numpy(coefficients), torch.from_numpy(mean)
            onset.widths[target], onset.frames[target] = width, frames
            onset.reaches[target] = _reach(each, width)
    return onset.eval(), losses


def _fitted(examples: Examples, kernel: Float64Array) -> tuple[Float64Array, Float64Array, int]:
    """Coefficients [n, 896], means [896], and how many frames are predicted: those that half of the clips go on for.

    What is far ahead is learned from the examples that go on so long.
    """
    from sklearn.kernel_ridge import KernelRidge

    coefficients, mean, frames = np.zeros((len(examples), FUTURE)), np.zeros(FUTURE), 0
    for level in LEVELS:
        own = examples.lasting >= level
        if own.sum() < 2 or len(np.unique(examples.clips[own])) * 2 < len(np.unique(examples.clips)):
            break
        columns = np.repeat((np.array(KNOTS) > frames) & (np.array(KNOTS) <= level), ROOT)
        wanted = examples.futures[np.ix_(own, columns)]
        mean[columns] = wanted.mean(axis=0)
        solver = KernelRidge(alpha=SOFT, kernel="precomputed")
        coefficients[np.ix_(own, columns)] = solver.fit(kernel[np.ix_(own, own)], wanted - mean[columns]).dual_coef_
        frames = level
    return coefficients, mean, frames


def _reach(examples: Examples, width: float) -> float:
    """How far examples are from the nearest one of another clip; of a single clip, the width of its kernel."""
    near = nearest_of_another(examples.states, examples.clips, examples.states, examples.clips)
    return float(np.quantile(near, KNOWN)) if np.isfinite(near).all() else width


def _kernel(apart: Float64Array, products: Float64Array, width: float) -> Float64Array:
    """Matern's kernel (3/2) of distances, and a share of the linear one of products."""
    far = np.sqrt(3) * apart / width
    kernel: Float64Array = (1 + far) * np.exp(-far) + LINEAR * products / width**2
    return kernel


def with_onset(motion: BodyMotion, ahead: Float64Array | None) -> BodyMotion:
    """A motion that is led over to from what follows recorded frames, [n, 64] of `Onset.ahead`."""
    if ahead is None:
        return motion
    count = min(len(motion), len(ahead))
    rows = motion.rows
    done = np.arange(1, count + 1) / len(ahead)
    share = 0.5 + 0.5 * np.cos(np.pi * np.clip((done - ALONE) / (1 - ALONE), 0, 1))[:, None]
    rows[:count] = share * ahead[:count] + (1 - share) * rows[:count]
    return BodyMotion.of_rows(rows, motion.stands)
