"""The onset of a motion: the frames right after a seed clip, predicted from how recorded bodies went on.

Sparse poses say where a motion goes, not how fast. So the first one and a half seconds after recorded frames are
predicted by kernel regression on recorded bodies that stood and moved alike, then blended into the generated motion.
This is for classes of cyclic motion, such as walking.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import torch
from motionlake.arrays import Float64Array
from motionlake.glogen.sparse import HEIGHT
from motionlake.glogen.trajectories import FPS, BodyMotion, mirrored
from motionlake.motion.resampling import interpolated
from motionlake.training import on_threads
from scipy.interpolate import PchipInterpolator
from torch import Tensor, nn

FRAMES: Final = 45  # of the lead-in
ALONE: Final = 10  # of these, that are not led over to the generated motion yet
KNOTS: Final = (1, 2, 3, 4, 6, 8, 10, 13, 16, 20, 25, 30, 37, 45)  # frames that are predicted; smooth curves in between
# Spans before a frame, of which it is seen how the joints moved: frames, from the nearer to the further end.
RECENT: Final = ((0, 1), (0, 3), (3, 8))
EARLIEST: Final = 3  # frame of a clip that is an example
ROOT: Final = HEIGHT + 4  # joints, height, velocity, turning
FEATURES: Final = ROOT + len(RECENT) * HEIGHT
FUTURE: Final = len(KNOTS) * ROOT
MOST: Final = 5000  # examples, of all classes together, half of them left for right
SOFT: Final = 0.3  # ridge
LINEAR: Final = 0.3  # share of the linear kernel: states unlike the examples are extrapolated
FURTHEST: Final = 2.0  # widths from the nearest example; beyond, nothing is predicted
# What counts alike: joints and height in body lengths, velocity and turning a second, and speeds of joints. How joints
# move says more than where they are.
SCALES: Final = np.concatenate([np.full(HEIGHT, 0.2), [0.1], [0.6, 0.6], [2.0], np.full(FEATURES - ROOT, 0.6)])


def state_at(motion: BodyMotion, places: Float64Array) -> Float64Array:
    """[n, 244] how a body stands and moves at fractional frames, from these and those before alone."""
    rows = motion.rows
    now = interpolated(rows, places)
    # Velocity and turning are towards the next frame: those of the frame before are known.
    now[:, HEIGHT + 1 :] = interpolated(rows[:, HEIGHT + 1 :], np.maximum(places - 1, 0))
    moved = []
    for near, far in RECENT:
        later, before = np.maximum(places - near, 0), np.maximum(places - far, 0)
        gone = (later - before)[:, None]
        change = interpolated(rows[:, :HEIGHT], later) - interpolated(rows[:, :HEIGHT], before)
        moved.append(change / np.maximum(gone, 1e-9) * FPS * (gone > 1e-6))
    return np.concatenate([now, *moved], axis=1)


class Onset(nn.Module):
    """Kernel regression from how a body stands and moves to its next frames, one kernel for each of C classes.

    A Matern kernel (3/2) plus a linear one, chosen on clips that no metric is reported of (docs/synthesis.md).

    Attributes:
        classes: [n] of the examples.
        states: [n, 244] scaled.
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

    def ahead(self, state: Float64Array, target: int, pace: float = 1.0) -> Float64Array | None:
        """[45, 64] rows of the frames after a state [244], pose and root; None where no recorded body moved so.

        As many frames as these take at another pace.

        None: the class has no examples, or the nearest is `FURTHEST` times further away than they are from one another.
        """
        width = float(self.widths[target])
        own = (self.classes == target).numpy()
        if not own.any():
            return None
        known, asked = self.states.numpy()[own].astype(float), state[None] / SCALES
        if _squares(asked, known).min() > (FURTHEST * width) ** 2:
            return None
        weights = _kernel(asked, known, width)[0]
        future = weights @ self.coefficients.numpy()[own].astype(float) + self.means[target].double().numpy()
        knots = np.concatenate([np.zeros((1, ROOT)), future.reshape(len(KNOTS), ROOT)])
        at = np.minimum(np.arange(1, max(1, round(FRAMES / pace)) + 1) * pace, FRAMES)
        rows: Float64Array = state[:ROOT] + PchipInterpolator([0, *KNOTS], knots)(at)
        rows[:, HEIGHT + 1 :] *= pace
        return rows


def fit_onset(
    motions: Sequence[BodyMotion], targets: Sequence[int], cyclic: Sequence[bool], examples: int = MOST
) -> Onset:
    """Fit the kernels of every cyclic class.

    Args:
        motions: whole clips.
        targets: class of each.
        cyclic: [C] whether each class is cyclic.
        examples: of all classes together, at most.
    """
    most = max(2, examples // max(1, sum(cyclic)))
    found = [_examples(motions, targets, target, most) if on else None for target, on in enumerate(cyclic)]
    lead = Onset(len(cyclic), sum(len(one[0]) for one in found if one))
    filled = 0
    with on_threads(1):  # sums of threads differ from run to run
        for target, one in enumerate(found):
            if one is None:
                continue
            states, futures = one
            rows = slice(filled, filled := filled + len(states))
            apart = _squares(states, states)
            width = max(float(np.sqrt(np.median(apart[np.triu_indices(len(states), 1)]))), 1e-6)
            mean = futures.mean(axis=0)
            lead.classes[rows], lead.states[rows] = target, torch.from_numpy(states)
            lead.coefficients[rows] = torch.from_numpy(_solved(_kernel(states, states, width), futures - mean))
            lead.means[target], lead.widths[target] = torch.from_numpy(mean), width
    return lead


def _solved(kernel: Float64Array, wanted: Float64Array) -> Float64Array:
    from sklearn.kernel_ridge import KernelRidge

    coefficients: Float64Array = KernelRidge(alpha=SOFT, kernel="precomputed").fit(kernel, wanted).dual_coef_
    return coefficients


def _examples(
    motions: Sequence[BodyMotion], targets: Sequence[int], target: int, most: int
) -> tuple[Float64Array, Float64Array] | None:
    """Scaled states [n, 244] of frames that enough others follow, evenly chosen, and what follows them [n, 896]."""
    own = [
        each for motion, of in zip(motions, targets, strict=True) if of == target for each in (motion, mirrored(motion))
    ]
    places = [(i, place) for i, motion in enumerate(own) for place in range(EARLIEST, len(motion) - FRAMES)]
    places = places[:: -(-len(places) // most)] if len(places) > most else places
    if len(places) < 2:
        return None
    states, futures = [], []
    for i, motion in enumerate(own):
        at = np.array([place for of, place in places if of == i])
        if not len(at):
            continue
        known, rows = state_at(motion, at.astype(float)), motion.rows
        states.append(known / SCALES)
        # Velocity and turning of a frame are towards the next one.
        later = rows[at[:, None] + np.array(KNOTS)]
        futures.append((later - known[:, None, :ROOT]).reshape(len(at), FUTURE))
    return np.concatenate(states), np.concatenate(futures)


def _kernel(some: Float64Array, others: Float64Array, width: float) -> Float64Array:
    """[n, m] Matern's kernel (3/2) and a share of the linear one."""
    apart = np.sqrt(3 * _squares(some, others)) / width
    kernel: Float64Array = (1 + apart) * np.exp(-apart) + LINEAR * (some @ others.T) / width**2
    return kernel


def _squares(some: Float64Array, others: Float64Array) -> Float64Array:
    """[n, m] squared distances."""
    squares: Float64Array = (some**2).sum(axis=1)[:, None] + (others**2).sum(axis=1) - 2 * some @ others.T
    return np.maximum(squares, 0)


def with_onset(motion: BodyMotion, ahead: Float64Array | None) -> BodyMotion:
    """A motion that is led over to from what follows recorded frames, [n, 64] of `Onset.ahead`."""
    if ahead is None:
        return motion
    count = min(len(motion), len(ahead))
    rows = motion.rows
    done = np.arange(1, count + 1) / len(ahead)
    share = 0.5 + 0.5 * np.cos(np.pi * np.clip((done - ALONE / FRAMES) / (1 - ALONE / FRAMES), 0, 1))[:, None]
    rows[:count] = share * ahead[:count] + (1 - share) * rows[:count]
    return BodyMotion.of_rows(rows, motion.stands)
