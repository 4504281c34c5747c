"""What first follows recorded poses: as bodies that stood and moved so went on (kernel regression).

Sparse poses say where a motion goes, not how fast it is going there. What follows recorded frames begins as these move,
and is led over to the generated motion within one and a half seconds. It is for classes that go on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from torch import Tensor, nn

from pipeline.clip import FloatArray
from pipeline.threads import on_threads
from pipeline.trajectories.motion import FPS, BodyMotion, interpolated
from pipeline.trajectories.sparse import HEIGHT

FRAMES: Final = 45  # of the lead-in
ALONE: Final = 10  # of these, that are not led over to the generated motion yet
KNOTS: Final = (1, 2, 3, 4, 6, 8, 10, 13, 16, 20, 25, 30, 37, 45)  # frames that are predicted; smooth curves in between
RECENT: Final = (1, 3)  # frames, over which it is seen how the joints move
ROOT: Final = HEIGHT + 4  # joints, height, velocity, turning
FEATURES: Final = ROOT + len(RECENT) * HEIGHT
FUTURE: Final = len(KNOTS) * ROOT
MOST: Final = 3000  # examples, of all classes together
SOFT: Final = 0.3  # ridge
# What counts alike: joints and height in body lengths, velocity and turning a second, and speeds of joints.
SCALES: Final = np.concatenate([np.full(HEIGHT, 0.1), [0.1], [0.6, 0.6], [2.0], np.full(FEATURES - ROOT, 0.6)])


def rows_of(motion: BodyMotion) -> FloatArray:
    """[T, 64] joints, height, velocity and turning."""
    joints = motion.joints.reshape(len(motion), HEIGHT)
    return np.concatenate([joints, motion.height[:, None], motion.velocity, motion.turn[:, None]], axis=1)


def state_at(motion: BodyMotion, places: FloatArray) -> FloatArray:
    """[n, 184] how a body stands and moves at fractional frames, from these and those before alone."""
    rows = rows_of(motion)
    now = interpolated(rows, places)
    # Velocity and turning are towards the next frame: those of the frame before are known.
    now[:, HEIGHT + 1 :] = interpolated(rows[:, HEIGHT + 1 :], np.maximum(places - 1, 0))
    moved = []
    for frames in RECENT:
        gone = np.minimum(places, frames)[:, None]
        before = interpolated(rows[:, :HEIGHT], places - gone[:, 0])
        moved.append((now[:, :HEIGHT] - before) / np.maximum(gone, 1e-9) * FPS * (gone > 1e-6))
    return np.concatenate([now, *moved], axis=1)


class LeadIn(nn.Module):
    """Gaussian kernels over how recorded bodies of the same class stood and moved, one for each of C classes.

    Attributes:
        classes: [n] of the examples.
        states: [n, 184] scaled.
        coefficients: [n, 896] of what follows, less its mean.
        means: [C, 896].
        widths: [C] of the kernels: the median distance of two examples; 0 where a class has none.
    """

    classes: Tensor
    states: Tensor
    coefficients: Tensor
    means: Tensor
    widths: Tensor

    def __init__(self, classes: int, examples: int = 0) -> None:
        super().__init__()
        self.register_buffer("classes", torch.zeros(examples, dtype=torch.int64))
        self.register_buffer("states", torch.zeros(examples, FEATURES))
        self.register_buffer("coefficients", torch.zeros(examples, FUTURE))
        self.register_buffer("means", torch.zeros(classes, FUTURE))
        self.register_buffer("widths", torch.zeros(classes))

    def ahead(self, state: FloatArray, target: int, pace: float = 1.0) -> FloatArray | None:
        """[45, 64] rows of the frames after a state [184], pose and root; None where no recorded body moved so.

        As many frames as these take at another pace.

        None: the class has no examples, or the nearest is further away than examples are from one another.
        """
        width = float(self.widths[target])
        own = (self.classes == target).numpy()
        if not own.any():
            return None
        apart = _squares(state[None] / SCALES, self.states.numpy()[own].astype(float))[0]
        if apart.min() > width**2:
            return None
        weights = np.exp(-apart / (2 * width**2))
        future = weights @ self.coefficients.numpy()[own].astype(float) + self.means[target].double().numpy()
        knots = np.concatenate([np.zeros((1, ROOT)), future.reshape(len(KNOTS), ROOT)])
        at = np.minimum(np.arange(1, max(1, round(FRAMES / pace)) + 1) * pace, FRAMES)
        rows: FloatArray = state[:ROOT] + PchipInterpolator([0, *KNOTS], knots)(at)
        rows[:, HEIGHT + 1 :] *= pace
        return rows


def fit_lead_in(motions: Sequence[BodyMotion], targets: Sequence[int], going: Sequence[bool]) -> LeadIn:
    """Learn how the motion of every class that goes on does so.

    Args:
        motions: whole clips.
        targets: class of each.
        going: [C] whether each class goes on.
    """
    with on_threads(1):  # sums of threads differ from run to run
        return _fitted(motions, targets, going)


def _fitted(motions: Sequence[BodyMotion], targets: Sequence[int], going: Sequence[bool]) -> LeadIn:
    most = max(2, MOST // max(1, sum(going)))
    found = [_examples(motions, targets, target, most) if on else None for target, on in enumerate(going)]
    lead = LeadIn(len(going), sum(len(one[0]) for one in found if one))
    filled = 0
    for target, one in enumerate(found):
        if one is None:
            continue
        states, futures = one
        rows = slice(filled, filled := filled + len(states))
        apart = _squares(states, states)
        width = float(np.sqrt(np.median(apart[np.triu_indices(len(states), 1)])))
        kernel = np.exp(-apart / (2 * max(width, 1e-6) ** 2))
        mean = futures.mean(axis=0)
        lead.classes[rows], lead.states[rows] = target, torch.from_numpy(states)
        lead.coefficients[rows] = torch.from_numpy(_solved(kernel, futures - mean))
        lead.means[target], lead.widths[target] = torch.from_numpy(mean), max(width, 1e-6)
    return lead


def _solved(kernel: NDArray[np.float64], wanted: NDArray[np.float64]) -> NDArray[np.float64]:
    from sklearn.kernel_ridge import KernelRidge

    coefficients: NDArray[np.float64] = KernelRidge(alpha=SOFT, kernel="precomputed").fit(kernel, wanted).dual_coef_
    return coefficients


def _examples(
    motions: Sequence[BodyMotion], targets: Sequence[int], target: int, most: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Scaled states [n, 184] of frames that enough others follow, evenly chosen, and what follows them [n, 896]."""
    own = [motion for motion, of in zip(motions, targets, strict=True) if of == target]
    places = [(i, place) for i, motion in enumerate(own) for place in range(max(RECENT), len(motion) - FRAMES)]
    places = places[:: -(-len(places) // most)] if len(places) > most else places
    if len(places) < 2:
        return None
    states, futures = [], []
    for i, motion in enumerate(own):
        at = np.array([place for of, place in places if of == i])
        if not len(at):
            continue
        known, rows = state_at(motion, at.astype(float)), rows_of(motion)
        states.append(known / SCALES)
        # Velocity and turning of a frame are towards the next one.
        later = rows[at[:, None] + np.array(KNOTS)]
        futures.append((later - known[:, None, :ROOT]).reshape(len(at), FUTURE))
    return np.concatenate(states), np.concatenate(futures)


def _squares(some: FloatArray, others: FloatArray) -> NDArray[np.float64]:
    """[n, m] squared distances."""
    squares: FloatArray = (some**2).sum(axis=1)[:, None] + (others**2).sum(axis=1) - 2 * some @ others.T
    return np.maximum(squares, 0)


def led_in(motion: BodyMotion, ahead: FloatArray | None) -> BodyMotion:
    """A motion that is led over to from what follows recorded frames, [n, 64] of `LeadIn.ahead`."""
    if ahead is None:
        return motion
    count = min(len(motion), len(ahead))
    rows = rows_of(motion)
    done = np.arange(1, count + 1) / len(ahead)
    share = 0.5 + 0.5 * np.cos(np.pi * np.clip((done - ALONE / FRAMES) / (1 - ALONE / FRAMES), 0, 1))[:, None]
    rows[:count] = share * ahead[:count] + (1 - share) * rows[:count]
    joints = rows[:, :HEIGHT].reshape(motion.joints.shape)
    return replace(
        motion,
        joints=joints,
        height=rows[:, HEIGHT],
        velocity=rows[:, HEIGHT + 1 : HEIGHT + 3],
        turn=rows[:, HEIGHT + 3],
    )
