"""Motion volumes of Sun, Junejo and Foroosh (2011): self-similarity of joints, as sums of a few outer products.

The distances of a joint from itself at all pairs of instants are a matrix; those of all joints side by side are a
volume of order 3, which stays the same however the body is turned. A clip is brought to `INSTANTS` instants, so
volumes are of one size. The volume, scaled to norm 1, is taken apart into `PARTS` outer products of a vector over
time, the same vector again (the matrices are symmetric) and one over joints, one after the other, by power
iterations. Deep Motifs says that volumes are compared by cross-correlation or by DTW of what they are taken apart
into; how many parts there are, and how they are weighed, we did not find: a pair of parts counts by the product of
its weights.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.kernels import njit

from bench.comparators.seen import Seen

INSTANTS: Final = 48
PARTS: Final = 4
ITERATIONS: Final = 30
STILL: Final = 1e-6


@dataclass(frozen=True)
class Parts:
    """What a volume is the sum of: weights [R], unit vectors over time [R, N] and over joints [R, J]."""

    weights: Float64Array
    times: Float64Array
    joints: Float64Array


def volume(clip: Seen) -> Float64Array:
    """[N, N, J] distances of each joint from where it is at another instant, of norm 1 (of a still clip 0)."""
    at = np.linspace(0.0, len(clip.joints) - 1, INSTANTS)
    flat = clip.joints.reshape(len(clip.joints), -1)
    sampled = np.column_stack([np.interp(at, np.arange(len(flat)), column) for column in flat.T])
    places = sampled.reshape(INSTANTS, -1, 3)
    found = np.linalg.norm(places[:, None] - places[None], axis=-1)
    return np.asarray(found / max(float(np.linalg.norm(found)), 1e-12))


def taken_apart(tensor: Float64Array, count: int = PARTS) -> Parts:
    """The outer products that a volume [N, N, J], symmetric in its first two axes, is nearly the sum of."""
    rest = tensor.copy()
    weights, times, joints = [], [], []
    for _ in range(count):
        over = np.linalg.eigh(np.einsum("ijk,ijl->kl", rest, rest))[1][:, -1]
        for _ in range(ITERATIONS):
            values, vectors = np.linalg.eigh(rest @ over)
            time = vectors[:, np.argmax(np.abs(values))]
            across = np.einsum("ijk,i,j->k", rest, time, time)
            before, over = over, across / max(float(np.linalg.norm(across)), 1e-12)
            if np.abs(before - over).max() < STILL:
                break
        weight = float(np.einsum("ijk,i,j,k", rest, time, time, over))
        rest -= weight * np.einsum("i,j,k->ijk", time, time, over)
        weights.append(weight)
        times.append(time)
        joints.append(over)
    return Parts(np.array(weights), np.array(times), np.array(joints))


def distances(clips: Sequence[Seen], *, warped: bool) -> Float64Array:
    """[n, n] between clips, by dynamic time warping of the vectors over time, or by their cross-correlation."""
    parts = [taken_apart(volume(clip)) for clip in clips]
    weights, times, joints = (
        np.stack([getattr(each, name) for each in parts]) for name in ("weights", "times", "joints")
    )
    found: Float64Array = _distances(weights, times, joints, warped)
    return found


@njit(cache=True)
def _distances(weights: Float64Array, times: Float64Array, joints: Float64Array, warped: bool) -> Float64Array:
    n, count = weights.shape
    found = np.zeros((n, n))
    for a in range(n):
        for b in range(a):
            total, alike = 1e-12, 0.0
            for r in range(count):
                weight = weights[a, r] * weights[b, r]
                over = abs((joints[a, r] * joints[b, r]).sum())
                if warped:
                    near = min(_warped(times[a, r], times[b, r]), _warped(times[a, r], -times[b, r]))
                    alike += weight * over / (1.0 + near)
                else:
                    alike += weight * over * _correlated(times[a, r], times[b, r])
                total += weight
            found[a, b] = found[b, a] = 1.0 - alike / total
    return found


@njit(cache=True)
def _correlated(a: Float64Array, b: Float64Array) -> Any:
    """The largest absolute inner product of a [N] with b [N] shifted, zeros beyond its ends."""
    n, best = len(a), 0.0
    for lag in range(-n + 1, n):
        total = 0.0
        for i in range(max(0, lag), min(n, n + lag)):
            total += a[i] * b[i - lag]
        best = max(best, abs(total))
    return best


@njit(cache=True)
def _warped(a: Float64Array, b: Float64Array) -> Any:
    """Dynamic time warping of vectors [N], absolute differences summed along the path."""
    n = len(a)
    before = np.full(n + 1, np.inf)
    row = np.empty(n + 1)
    before[0] = 0.0
    for i in range(n):
        row[0] = np.inf
        for j in range(n):
            row[j + 1] = min(before[j], before[j + 1], row[j]) + abs(a[i] - b[j])
        before[:] = row
    return before[n]
