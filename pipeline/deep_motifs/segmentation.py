"""Temporal segmentation (Deep Motifs, section 6.2): every word of a clip gets a class from labelled clips.

Each word has the signature of the window of 2 seconds around it, cut short at the clip's ends (the paper's 9 words of
16 frames, 19 of the default words). The windows of labelled frames, and their mirror images, are the examples. The 5
examples nearest to a window (Earth Mover's Distance) vote for its class; mirror images count as a quarter farther than
they are. In the paper the class goes to the word in the middle; here a window votes for all words up to `reach` from
its middle, so that a moment of another pose does not break a segment.

A window votes "unknown" where it lies farther from the labelled windows than the labelled windows of its class lie
from those of other clips: the threshold of a class is a quantile (by default the largest) of the distances of
its labelled windows from the nearest window of another clip. No other data sets it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import pairwise
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Float64Array, Int64Array, IntArray
from motionlake.deep_motifs.emd_search import SignatureIndex
from motionlake.deep_motifs.signatures import Corpus, range_signatures, range_sums
from motionlake.errors import UserError
from numpy.typing import NDArray

UNKNOWN: Final = "unknown"
# Windows that the threshold is calibrated on, evenly drawn where there are more.
_CALIBRATED: Final = 1000
# Tips a tie of votes to the class that holds the nearest of the voters.
_TIP: Final = 1e-9


@dataclass(frozen=True)
class SegmentationConfig:
    """How words are classified.

    Attributes:
        window: words of a window; 19 default words are 2 seconds.
        k: nearest labelled windows that vote.
        reach: a window votes for the words up to so many from its middle; 0 is the paper's, 12 are a second.
        mirror_factor: by how much farther a window of a mirrored clip counts.
        unknown: quantile of the distances of a class's labelled windows from those of other clips, beyond which a
            window is "unknown"; None gives every word a labelled class.

    Raises:
        UserError: a window or k below 1, a negative reach, a factor below 1, or a quantile outside 0 to 1.
    """

    window: int = 19
    k: int = 5
    reach: int = 12
    mirror_factor: float = 1.25
    unknown: float | None = 1.0

    def __post_init__(self) -> None:
        if self.window < 1 or self.k < 1:
            raise UserError(f"a window of {self.window} words and {self.k} neighbours: both must be at least 1")
        if self.reach < 0 or self.mirror_factor < 1:
            raise UserError(f"a reach of {self.reach} words (at least 0), a factor {self.mirror_factor} (at least 1)")
        if self.unknown is not None and not 0 <= self.unknown <= 1:
            raise UserError(f"the quantile beyond which a word is unknown is {self.unknown}, not between 0 and 1")


@dataclass(frozen=True)
class LabelledRange:
    """Frames [start, stop) of a clip, by its index in a corpus, at its own rate, that show one class."""

    clip: int
    start: int
    stop: int
    label: str


@dataclass(frozen=True)
class Teaching:
    """m labelled windows: signatures [m, K], and of each the class, the clip, and whether it is of a mirror image."""

    signatures: Float32Array
    labels: NDArray[np.str_]
    clips: Int64Array
    mirrored: BoolArray


@dataclass(frozen=True)
class WordLabels:
    """What each of w words of a clip shows.

    Attributes:
        labels: [w] class, or "unknown".
        distances: [w] of the word's own window from the nearest labelled one.
        confidence: [w] share of the votes that the class got.
    """

    labels: NDArray[np.str_]
    distances: Float64Array
    confidence: Float64Array


@dataclass(frozen=True)
class SegmentRange:
    """Frames [start, stop) of a clip, at its own rate, of one class; means of its words."""

    start: int
    stop: int
    label: str
    distance: float
    confidence: float


def centred_signatures(motifs: IntArray, idf: Float64Array, n_words: int) -> Float32Array:
    """[w, K] signature of the window of `n_words` words around each of w words (`motifs`), cut at the clip's ends.

    An even window reaches one word further back than ahead.
    """
    return range_signatures(motifs, idf, *_span(len(motifs), n_words))


def word_centres(corpus: Corpus, clip: int) -> Float64Array:
    """[w] frame at the centre of each word of a clip."""
    words = corpus.words_of(clip)
    return np.asarray((corpus.starts[words] + corpus.stops[words] - 1) / 2, dtype=np.float64)


def labelled_windows(
    corpus: Corpus, ranges: Sequence[LabelledRange], n_words: int, mirrored: Mapping[int, IntArray] | None = None
) -> Teaching:
    """The windows around the words whose centre lies in a labelled range.

    A range too short to hold a centre labels the word whose centre is nearest to its own; a word in ranges of
    several classes has all of them.

    Args:
        corpus: holds the clips of the ranges.
        ranges: what is labelled; `UserError` where there are none.
        n_words: words of a window.
        mirrored: motifs of the words of clips mirrored left to right, by the clip's index: their windows teach
            the same classes.
    """
    if not ranges:
        raise UserError(
            "there is nothing to learn classes from: give clips with rows in segments.csv, or clips with labels"
        )

    @cache
    def windows(clip: int) -> list[Float32Array]:
        sides: list[IntArray] = [corpus.motifs[corpus.words_of(clip)]]
        if mirrored is not None:
            sides.append(mirrored[clip])
        return [centred_signatures(side, corpus.idf, n_words) for side in sides]

    signatures: list[Float32Array] = []
    about: list[tuple[str, int, bool]] = []
    for taught in ranges:
        inside = words_in(word_centres(corpus, taught.clip), taught)
        for side, side_windows in enumerate(windows(taught.clip)):
            signatures.append(side_windows[inside])
            about.extend([(taught.label, taught.clip, side == 1)] * len(inside))
    labels, clips, turned = zip(*about, strict=True)
    return Teaching(np.concatenate(signatures), np.array(labels), np.array(clips, dtype=np.int64), np.array(turned))


def words_in(centres: Float64Array, taught: LabelledRange) -> Int64Array:
    """The words whose centre lies in a range, or that whose centre is nearest to the middle of the range."""
    inside = np.flatnonzero((centres >= taught.start) & (centres < taught.stop))
    if len(inside):
        return inside
    return np.array([np.argmin(np.abs(centres - (taught.start + taught.stop - 1) / 2))])


class _Side:
    """Taught windows, equal ones kept once: those of the clips, or those of their mirror images."""

    def __init__(self, teaching: Teaching, rows: Int64Array, ground: Float64Array, factor: float) -> None:
        unique, first, where = np.unique(teaching.signatures[rows], axis=0, return_index=True, return_inverse=True)
        order = np.argsort(first)  # the given one, which settles ties
        self._rows = rows
        self._kinds = np.argsort(order)[where.ravel()]  # [rows] which of the different windows each has
        by_kind = rows[np.argsort(self._kinds, kind="stable")]
        self._members = np.split(by_kind, np.cumsum(np.bincount(self._kinds))[:-1])
        self._index = SignatureIndex.build(unique[order], ground)
        self._factor = factor

    def nearest(self, window: Float32Array, k: int, among: Int64Array | None = None) -> list[tuple[float, int]]:
        """(distance, row of teaching) of at least the k nearest of the rows, equal windows all together."""
        found = self._index.nearest(window, k, among)
        return [
            (distance * self._factor, row)
            for kind, distance in zip(found.indices.tolist(), found.distances.tolist(), strict=True)
            for row in self._members[kind].tolist()
        ]

    def kinds(self, kept: BoolArray) -> Int64Array:
        """Which different windows the taught rows that are kept ([m]) have."""
        return np.unique(self._kinds[kept[self._rows]])


class Segmenter:
    """Classifies words by labelled windows; see the module."""

    def __init__(self, teaching: Teaching, ground: Float64Array, config: SegmentationConfig | None = None) -> None:
        """Prepare `teaching` over motifs at `ground` distances [K, K]."""
        self.config = config or SegmentationConfig()
        self.teaching = teaching
        self.classes, self._codes = np.unique(teaching.labels, return_inverse=True)
        sides = ((~teaching.mirrored, 1.0), (teaching.mirrored, self.config.mirror_factor))
        self._sides = [_Side(teaching, np.flatnonzero(rows), ground, factor) for rows, factor in sides if rows.any()]

    def label_words(self, motifs: IntArray, idf: Float64Array, *, forced: bool = False) -> WordLabels:
        """The class of each of w words of a clip (`motifs` [w]), or "unknown"; `forced`: always a class."""
        votes, distances = self._votes(centred_signatures(motifs, idf, self.config.window))
        if self.config.unknown is not None and not forced:
            far = distances > self.thresholds[votes.argmax(axis=1)]
            votes = np.column_stack([votes * ~far[:, None], far])
        first, last = _span(len(votes), 2 * self.config.reach + 1)
        votes = range_sums(votes, first, last) / (last - first)[:, None]
        labels = np.append(self.classes, UNKNOWN)[votes.argmax(axis=1)]
        return WordLabels(labels, distances, votes.max(axis=1) / votes.sum(axis=1))

    @cached_property
    def thresholds(self) -> Float64Array:
        """[classes] distance from the nearest labelled window beyond which a window of that class is unknown.

        The quantile over the class's labelled windows of their distance from the nearest window of another clip.
        A class with examples in one clip only has that of all other classes together; where every class is such a
        one, nothing tells what is far, and the thresholds are infinite.
        """
        quantile = self.config.unknown
        taken = self._calibrated()
        if quantile is None or not len(taken):
            return np.full(len(self.classes), np.inf)
        distances = np.array([self._nearest(int(row)) for row in taken])
        thresholds = np.full(len(self.classes), np.quantile(distances, quantile))
        for code in np.unique(self._codes[taken]):
            thresholds[code] = np.quantile(distances[self._codes[taken] == code], quantile)
        return thresholds

    def _calibrated(self) -> Int64Array:
        """Rows of teaching whose class other clips show too, evenly drawn; no mirror images."""
        pairs = np.unique(np.column_stack([self._codes, self.teaching.clips]), axis=0)
        several = np.bincount(pairs[:, 0], minlength=len(self.classes)) > 1
        rows = np.flatnonzero(several[self._codes] & ~self.teaching.mirrored)
        step = max(1, -(-len(rows) // _CALIBRATED))
        return np.asarray(rows[::step], dtype=np.int64)

    def _nearest(self, row: int) -> float:
        """Distance of a labelled window from the nearest of another clip."""
        others = self.teaching.clips != self.teaching.clips[row]
        window = self.teaching.signatures[row]
        return min(
            distance
            for side in self._sides
            if len(among := side.kinds(others))
            for distance, _ in side.nearest(window, 1, among)
        )

    def _votes(self, windows: Float32Array) -> tuple[Float64Array, Float64Array]:
        """[w, classes] shares of the votes of the k nearest labelled windows, and [w] the nearest's distance.

        Where the k-th and others are at one distance, those given first vote. A tie goes to the class that
        holds the nearest of the voters.
        """
        unique, back = np.unique(windows, axis=0, return_inverse=True)
        votes = np.zeros((len(unique), len(self.classes)))
        distances = np.zeros(len(unique))
        for i, window in enumerate(unique):
            rows = sorted(found for side in self._sides for found in side.nearest(window, self.config.k))
            voters = [row for _, row in rows[: self.config.k]]
            np.add.at(votes[i], self._codes[voters], 1 / len(voters))
            seen, first = np.unique(self._codes[voters], return_index=True)
            votes[i, seen] += _TIP / (1 + first)
            distances[i] = rows[0][0]
        return votes[back.ravel()], distances[back.ravel()]


def bands(found: WordLabels, centres: Float64Array, frames: int) -> list[SegmentRange]:
    """Runs of one class along a clip; they cover its frames [0, `frames`) without gaps.

    Each frame belongs to the word whose centre ([w], ascending, see `word_centres`) is nearest.
    """
    starts = np.flatnonzero(np.concatenate([[True], found.labels[1:] != found.labels[:-1]]))
    # Frame f belongs to the later word once it is past the middle of both centres.
    edges = np.ceil((centres[starts[1:] - 1] + centres[starts[1:]]) / 2).astype(np.int64)
    words, limits = [*starts.tolist(), len(found.labels)], [0, *edges.tolist(), frames]
    return [
        SegmentRange(
            start, stop, str(found.labels[a]), float(found.distances[a:b].mean()), float(found.confidence[a:b].mean())
        )
        for (start, stop), (a, b) in zip(pairwise(limits), pairwise(words), strict=True)
    ]


def _span(w: int, n_words: int) -> tuple[Int64Array, Int64Array]:
    """Half-open ranges of words, [w] each, that the window around each of w words holds."""
    first = np.arange(w) - n_words // 2
    return np.clip(first, 0, w), np.clip(first + n_words, 0, w)
