"""Motion templates of Müller and Röder (2006): what the clips of a class have in common, and what may vary.

A template is a matrix of relational features, 0 to 1, learned from labelled clips. Each of some clips is a reference:
all clips are warped onto it (dynamic time warping, absolute differences) and averaged, columns that several share
count in parts, and the columns are then merged and stretched until each weighs one. The templates of the references
are warped onto one another in the same way until they stay as they are. What lies between 0.1 and 0.9 is masked out;
a clip costs a template the mean difference of what is left, of the piece of the clip that fits best.

The paper has every clip of the class as a reference. Here there are at most `REFERENCES`, evenly drawn in the order
of their lengths, since the template is learned once for each clip that is left out. Of the templates that remain,
which the paper calls all alike, the one that is nearest to the others is taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Final

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Float64Array
from motionlake.kernels import njit
from numpy.typing import NDArray

from bench.comparators.relational import packed

REFERENCES: Final = 5
ROUNDS: Final = 5
STILL: Final = 0.01  # mean change of a template, below which it is learned
VARIES: Final = 0.1
Bits = NDArray[np.uint64]


@dataclass(frozen=True)
class Template:
    """K columns of features as bits: what each is to be, and which count."""

    values: Bits
    counts: Bits

    @classmethod
    def of(cls, matrix: Float64Array) -> Template:
        """From a matrix [K, n] of 0 to 1."""
        return cls(packed(matrix >= 0.5), packed((matrix <= VARIES) | (matrix >= 1 - VARIES)))


def learned(clips: Sequence[BoolArray]) -> Template:
    """The template of a class.

    Args:
        clips: [T, n] features of each of its clips, one at least.
    """
    by_length = sorted((clip.astype(np.float64) for clip in clips), key=len)
    chosen = np.unique(np.linspace(0, len(by_length) - 1, min(REFERENCES, len(by_length))).round().astype(int))
    found = [averaged(by_length[i], by_length) for i in chosen]
    for _ in range(ROUNDS):
        before, found = found, [averaged(reference, found) for reference in found]
        if all(_change(a, b) < STILL for a, b in zip(before, found, strict=True)):
            break
    apart = [sum(_cost(a, b) for b in found) for a in found]
    return Template.of(found[int(np.argmin(apart))])


def _change(before: Float64Array, after: Float64Array) -> float:
    return float(np.abs(before - after).mean()) if before.shape == after.shape else np.inf


def _cost(a: Float64Array, b: Float64Array) -> float:
    path = warping(differences(a, b))
    return float(np.abs(a[path[:, 0]] - b[path[:, 1]]).mean())


def averaged(reference: Float64Array, clips: Sequence[Float64Array]) -> Float64Array:
    """[K', n] mean of matrices warped onto `reference` [K, n], its columns weighing one each.

    K' is the mean length of the matrices, rounded.
    """
    total, weights = np.zeros_like(reference), np.zeros(len(reference))
    for clip in clips:
        path = warping(differences(reference, clip))
        part = 1.0 / np.bincount(path[:, 1], minlength=len(clip))[path[:, 1]]
        np.add.at(total, path[:, 0], part[:, None] * clip[path[:, 1]])
        np.add.at(weights, path[:, 0], part)
    return evened(total / weights[:, None], weights / len(clips))


def evened(columns: Float64Array, weights: Float64Array) -> Float64Array:
    """[round(sum of weights), n] columns [K, n] merged and stretched so that each weighs the same."""
    ends = np.cumsum(weights)
    count = max(1, round(float(ends[-1])))
    edges = np.linspace(0.0, ends[-1], count + 1)
    low = np.maximum(edges[:-1, None], (ends - weights)[None])
    shared = np.maximum(np.minimum(edges[1:, None], ends[None]) - low, 0.0)
    return np.asarray(shared @ columns / shared.sum(axis=1, keepdims=True))


def differences(a: Float64Array, b: Float64Array) -> Float32Array:
    """[K, L] sums of absolute differences of columns [K, n] and [L, n]."""
    found: Float32Array = _differences(a.astype(np.float32), b.astype(np.float32))
    return found


@njit(cache=True)
def _differences(a: Float32Array, b: Float32Array) -> Float32Array:
    found = np.empty((len(a), len(b)), dtype=np.float32)
    for i in range(len(a)):
        for j in range(len(b)):
            total = np.float32(0)
            for k in range(a.shape[1]):
                total += abs(a[i, k] - b[j, k])
            found[i, j] = total
    return found


@njit(cache=True)
def warping(costs: Float32Array) -> NDArray[np.int64]:
    """[P, 2] the cheapest path through costs [K, L], from first to last; of equal steps the diagonal one."""
    n, m = costs.shape
    sums = np.empty((n, m))
    for i in range(n):
        for j in range(m):
            best = 0.0
            if i and j:
                best = min(sums[i - 1, j - 1], sums[i - 1, j], sums[i, j - 1])
            elif i:
                best = sums[i - 1, j]
            elif j:
                best = sums[i, j - 1]
            sums[i, j] = best + costs[i, j]
    path = np.empty((n + m, 2), dtype=np.int64)
    i, j, count = n - 1, m - 1, 0
    while True:
        path[count, 0], path[count, 1] = i, j
        count += 1
        if i == 0 and j == 0:
            return path[:count][::-1].copy()
        if i == 0:
            j -= 1
        elif j == 0:
            i -= 1
        elif sums[i - 1, j - 1] <= min(sums[i - 1, j], sums[i, j - 1]):
            i -= 1
            j -= 1
        elif sums[i - 1, j] <= sums[i, j - 1]:
            i -= 1
        else:
            j -= 1


@njit(cache=True)
def _ones(bits: np.uint64) -> int:
    count = 0
    while bits:
        bits &= bits - np.uint64(1)
        count += 1
    return count


@njit(cache=True)
def fit(values: Bits, counts: Bits, clip: Bits) -> Any:
    """Mean difference of a template [K] and the piece of a clip [L] that fits it best, over K columns."""
    size, length = len(values), len(clip)
    before = np.zeros(length)
    row = np.empty(length)
    for i in range(size):
        counted = _ones(counts[i])
        for j in range(length):
            cost = _ones((values[i] ^ clip[j]) & counts[i]) / counted if counted else 0.0
            best = 0.0
            if i:
                best = before[j]
                if j:
                    best = min(best, before[j - 1], row[j - 1])
            row[j] = best + cost
        before[:] = row
    return before.min() / size


@njit(cache=True)
def apart(a: Bits, b: Bits, features: int) -> Any:
    """Dynamic time warping of the features of whole clips [n] and [m]: share that differs, summed, over n + m."""
    n, m = len(a), len(b)
    before = np.full(m + 1, np.inf)
    row = np.empty(m + 1)
    before[0] = 0.0
    for i in range(n):
        row[0] = np.inf
        for j in range(m):
            row[j + 1] = min(before[j], before[j + 1], row[j]) + _ones(a[i] ^ b[j])
        before[:] = row
    return before[m] / features / (n + m)


def fits(clips: Sequence[BoolArray], labels: Sequence[str]) -> tuple[list[str], Float64Array]:
    """Classes [C] by name, and [n, C] what each clip costs the template of each class, learned without that clip.

    A class whose only clip is left out has no template: it costs 1, more than any other.
    """
    classes, bits = sorted(set(labels)), [packed(clip) for clip in clips]
    costs = np.ones((len(clips), len(classes)))
    for column, name in enumerate(classes):
        own = [i for i, label in enumerate(labels) if label == name]
        whole = learned([clips[i] for i in own])
        for i in range(len(clips)):
            template: Template | None = whole
            if i in own:
                rest = [clips[k] for k in own if k != i]
                template = learned(rest) if rest else None
            if template is not None:
                costs[i, column] = fit(template.values, template.counts, bits[i])
    return classes, costs


def distances(clips: Sequence[BoolArray]) -> Float64Array:
    """[n, n] `apart` between clips."""
    bits, found = [packed(clip) for clip in clips], np.zeros((len(clips), len(clips)))
    for i, j in combinations(range(len(clips)), 2):
        found[i, j] = found[j, i] = apart(bits[i], bits[j], clips[i].shape[1])
    return found
