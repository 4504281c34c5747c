"""Which class each word of a clip shows, by the nearest words of labelled segments.

A word costs a class its distance from the nearest word that a segment of that class holds. Along the clip the cheapest
sequence of classes is taken (Viterbi), where every change of class costs something: less where the body rests, for one
exercise ends and the next begins with a rest or at a turn, and more where the labelled segments last long.

"unknown" is a class as well. It costs what lies as far as a word of another class does, which the labelled segments of
other clips tell, and never more than a middling class does: a rest, which all classes hold, is no sign of any of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Float64Array, Int64Array
from motionlake.deep_motifs.segmentation import UNKNOWN, LabelledRange, WordLabels, words_in
from motionlake.errors import UserError

# Words that the verdict is calibrated on, and segments they are drawn from, evenly where there are more.
_CALIBRATED: Final = 4000
_LONGEST: Final = 60  # words: no segment counts as lasting longer
_ROWS: Final = 4096  # taught words that a clip is compared with at a time
_LEAST: Final = 1e-12


@dataclass(frozen=True)
class WordSegmentation:
    """How words are classified; chosen on other sets than are reported (`docs/applications.md`).

    Attributes:
        mirror_factor: by how much farther a word of a mirrored clip counts.
        border: what a change of class costs, in words of ordinary distance for each word that a labelled segment lasts.
        rest: how much that depends on how fast the body moves; 0: not at all.
        unknown: whether a word may be "unknown".

    Raises:
        UserError: a factor below 1, or a negative cost.
    """

    mirror_factor: float = 1.25
    border: float = 0.2
    rest: float = 3.0
    unknown: bool = True

    def __post_init__(self) -> None:
        if self.mirror_factor < 1 or self.border < 0 or self.rest < 0:
            raise UserError(
                f"a factor {self.mirror_factor} (at least 1), a border {self.border} and rest {self.rest} (at least 0)"
            )


@dataclass(frozen=True)
class ClipWords:
    """The w words of a clip: vectors [w, d]; of the mirrored clip, or None; how fast the body moves in each [w]."""

    vectors: Float32Array
    mirrored: Float32Array | None
    pace: Float64Array


@dataclass(frozen=True)
class TaughtWords:
    """The n words of a labelled segment: its class, its clip, vectors [n, d], and of the mirrored clip, or None."""

    label: str
    clip: int
    vectors: Float32Array
    mirrored: Float32Array | None


def taught_words(ranges: Sequence[tuple[LabelledRange, ClipWords, Float64Array]]) -> list[TaughtWords]:
    """The words of each labelled range, of its clip's words and the frames at their centres ([w])."""
    found = []
    for taught, words, centres in ranges:
        inside = words_in(centres, taught)
        turned = None if words.mirrored is None else words.mirrored[inside]
        found.append(TaughtWords(taught.label, taught.clip, words.vectors[inside], turned))
    return found


class WordSegmenter:
    """Classifies words by those of labelled segments; see the module."""

    def __init__(self, taught: Sequence[TaughtWords], config: WordSegmentation | None = None) -> None:
        """Raises `UserError` where nothing is taught."""
        if not taught:
            raise UserError(
                "there is nothing to learn classes from: give clips with rows in segments.csv, or clips with labels"
            )
        self.config = config or WordSegmentation()
        self.classes, self._codes = np.unique([each.label for each in taught], return_inverse=True)
        self._clips = np.array([each.clip for each in taught], dtype=np.int64)
        self._taught = list(taught)
        lengths = np.array([len(each.vectors) for each in taught], dtype=np.int64)
        self._starts = np.concatenate([[0], np.cumsum(lengths)[:-1]]).astype(np.int64)
        self._sides = [(_Rows.of([each.vectors for each in taught]), 1.0)]
        if any(each.mirrored is not None for each in taught):
            turned = [each.vectors if each.mirrored is None else each.mirrored for each in taught]
            self._sides.append((_Rows.of(turned), self.config.mirror_factor))
        self._penalty = self.config.border * min(_LONGEST, float(np.median(lengths)))

    def label_words(self, words: ClipWords, *, forced: bool = False) -> WordLabels:
        """The class of each of w words of a clip, or "unknown"; `forced`: always a class.

        The confidence of a word is the distance of the nearest other class as a share of that and its own.
        """
        costs = self._by_class(self._from_segments(words.vectors))
        distances = costs.min(axis=1)
        if self.config.unknown and not forced and np.isfinite(self.threshold):
            costs = np.column_stack([costs, np.minimum(self.threshold, np.median(costs, axis=1))])
        unit = self._unit if self._unit is not None else float(np.median(distances))
        pace = np.concatenate([words.pace[:1], (words.pace[1:] + words.pace[:-1]) / 2])
        pace /= max(float(np.median(pace)), _LEAST)
        changes = self._penalty * (1 + self.config.rest * pace) / (1 + self.config.rest)
        found = cheapest_path(costs / max(unit, _LEAST), changes)
        return WordLabels(np.append(self.classes, UNKNOWN)[found], distances, _confidence(costs, found))

    @property
    def threshold(self) -> float:
        """The distance at which a word is unknown; infinite where the labelled segments do not tell.

        The median distance of labelled segments from those of other classes in other clips, but no less than
        that of the farthest from what its own clip does not teach.
        """
        known, _, other = self._calibration
        if not len(known):
            return np.inf
        return float(max(np.median(other) if len(other) else 0.0, known.max()))

    @property
    def _unit(self) -> float | None:
        """An ordinary distance of a word from the nearest of another clip that shows its class too."""
        _, words, _ = self._calibration
        return float(np.median(words)) if len(words) else None

    @cached_property
    def _calibration(self) -> tuple[Float64Array, Float64Array, Float64Array]:
        """Mean distances of segments, whose class other clips show too, from the nearest words of other clips; those
        of their words; and mean distances of segments from words of other classes in other clips."""
        known: list[float] = []
        words: list[Float64Array] = []
        other: list[float] = []
        for row in self._calibrated():
            apart = self._clips != self._clips[row]
            alike = self._codes == self._codes[row]
            from_each = self._from_segments(self._taught[row].vectors)
            if (apart & alike).any():
                nearest = from_each[:, apart].min(axis=1)
                known.append(float(nearest.mean()))
                words.append(nearest)
            if (apart & ~alike).any():
                other.append(float(from_each[:, apart & ~alike].min(axis=1).mean()))
        return np.array(known), np.concatenate([*words, np.zeros(0)]), np.array(other)

    def _calibrated(self) -> list[int]:
        """Labelled segments, evenly drawn where they hold too many words."""
        step = max(1, -(-sum(len(each.vectors) for each in self._taught) // _CALIBRATED))
        return list(range(0, len(self._taught), step))

    def _from_segments(self, vectors: Float32Array) -> Float64Array:
        """[w, segments] distances of w words from the nearest word of each segment or its mirror image."""
        sides = [factor * rows.nearest(vectors, self._starts) for rows, factor in self._sides]
        return np.asarray(np.minimum.reduce(sides))

    def _by_class(self, from_segments: Float64Array) -> Float64Array:
        """[w, classes] the least of [w, segments]."""
        found = np.full((len(from_segments), len(self.classes)), np.inf)
        for code in range(len(self.classes)):
            found[:, code] = from_segments[:, self._codes == code].min(axis=1)
        return found


@dataclass(frozen=True)
class _Rows:
    """Vectors [n, d] of many segments, one after the other, and their squared lengths [n]."""

    vectors: Float64Array
    squares: Float64Array

    @staticmethod
    def of(segments: Sequence[Float32Array]) -> _Rows:
        vectors = np.concatenate(segments).astype(np.float64)
        return _Rows(vectors, np.einsum("nd,nd->n", vectors, vectors))

    def nearest(self, queries: Float32Array, starts: Int64Array) -> Float64Array:
        """[w, segments] distances of queries [w, d] from the nearest vector of the segments that begin at `starts`."""
        exact = queries.astype(np.float64)
        squares = np.einsum("wd,wd->w", exact, exact)[:, None]
        found = np.full((len(exact), len(starts)), np.inf)
        for first in range(0, len(self.vectors), _ROWS):
            rows = slice(first, min(first + _ROWS, len(self.vectors)))
            apart = squares + self.squares[rows] - 2 * exact @ self.vectors[rows].T
            a, b = np.searchsorted(starts, [rows.start, rows.stop - 1], side="right") - 1
            edges = np.maximum(starts[a : b + 1] - first, 0)
            found[:, a : b + 1] = np.minimum(found[:, a : b + 1], np.minimum.reduceat(apart, edges, axis=1))
        return np.asarray(np.sqrt(np.maximum(found, 0)))


def cheapest_path(costs: Float64Array, changes: Float64Array) -> Int64Array:
    """[w] the state of each step in the cheapest sequence.

    Args:
        costs: [w, states] of being in a state, finite for one of them at least.
        changes: [w] of another state than the step before; of the first step it is not asked.
    """
    total = costs[0]
    kept = np.ones(costs.shape, dtype=bool)
    best = np.zeros(len(costs), dtype=np.int64)  # where a step that changes comes from
    for step in range(1, len(costs)):
        best[step] = total.argmin()
        changed = total[best[step]] + changes[step]
        kept[step] = total <= changed
        total = np.minimum(total, changed) + costs[step]
    return _followed(kept, best, int(total.argmin()))


def _followed(kept: BoolArray, best: Int64Array, last: int) -> Int64Array:
    path = np.empty(len(kept), dtype=np.int64)
    for step in range(len(kept) - 1, -1, -1):
        path[step] = last
        if not kept[step, last]:
            last = int(best[step])
    return path


def _confidence(costs: Float64Array, found: Int64Array) -> Float64Array:
    """[w] of the state found for each word, of [w, states]; 1 where there is no other."""
    steps = np.arange(len(costs))
    own = costs[steps, found]
    others = costs.copy()
    others[steps, found] = np.inf
    nearest = others.min(axis=1)
    finite = np.isfinite(nearest)
    shares = np.where(finite, nearest, 1.0) / np.maximum(np.where(finite, own + nearest, 1.0), _LEAST)
    return np.asarray(np.where(finite & (own + nearest <= _LEAST), 0.5, shares))
