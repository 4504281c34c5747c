"""How many words of a segmented clip have the right class (Deep Motifs, section 6.2)."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from motionlake.arrays import FloatArray


@dataclass(frozen=True)
class SegmentationScores:
    """Shares of words, from 0 to 1; None where there are no such words.

    Attributes:
        accuracy: of all labelled words, with the verdict "unknown", which is right for a class never taught
            and wrong for one that was.
        accuracy_known: of the words whose class was taught, each given a taught class.
        accuracy_known_or_unknown: of the same words, with the verdict "unknown", which is wrong for all of them.
        n: labelled words.
        n_known: of these, words whose class was taught.
    """

    accuracy: float | None
    accuracy_known: float | None
    accuracy_known_or_unknown: float | None
    n: int
    n_known: int


def word_truth(centres: FloatArray, segments: Sequence[tuple[int, int, str]]) -> list[frozenset[str]]:
    """The classes of each of w words: those of the segments (start, stop, label) that hold its centre ([w])."""
    return [frozenset(label for start, stop, label in segments if start <= centre < stop) for centre in centres]


def score_words(
    truth: Sequence[Collection[str]],
    judged: Sequence[str],
    forced: Sequence[str],
    taught: Collection[str],
    unknown: str = "unknown",
) -> SegmentationScores:
    """Score the words of a clip.

    Args:
        truth: [w] classes of each word; a word without one is left out, one with several is right with any.
        judged: [w] class given, or `unknown`.
        forced: [w] class given where every word gets a taught one.
        taught: classes that were learned.
        unknown: the verdict.
    """
    labelled = [i for i, classes in enumerate(truth) if classes]
    known = [i for i in labelled if any(c in taught for c in truth[i])]
    never = set(labelled) - set(known)
    right = [judged[i] in truth[i] for i in known] + [judged[i] == unknown for i in never]
    return SegmentationScores(
        _mean(right),
        _mean([forced[i] in truth[i] for i in known]),
        _mean([judged[i] in truth[i] for i in known]),
        len(labelled),
        len(known),
    )


def mean_scores(clips: Sequence[SegmentationScores]) -> SegmentationScores:
    """Means over clips, each of the clips that have the measure; sums of the counts."""

    def mean(name: str) -> float | None:
        return _mean([getattr(each, name) for each in clips if getattr(each, name) is not None])

    return SegmentationScores(
        mean("accuracy"),
        mean("accuracy_known"),
        mean("accuracy_known_or_unknown"),
        sum(each.n for each in clips),
        sum(each.n_known for each in clips),
    )


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if len(values) else None
