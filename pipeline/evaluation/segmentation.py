"""How many words of segmented clips have the right class, on a lake with segments (Deep Motifs, section 6.2)."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from motionlake.arrays import FloatArray
from motionlake.deep_motifs.segmentation import LabelledRange, word_centres
from motionlake.deep_motifs.signatures import Corpus
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.corpus import read_corpus
from motionlake.lake.layout import Lake
from motionlake.lake.models import check_served
from motionlake.lake.verdicts import good_rows
from motionlake.retrieval.segment_methods import Config, SegmentMethod, segment_method


@dataclass(frozen=True)
class SegmentationScores:
    """Shares of words, from 0 to 1; None where there are no such words.

    Attributes:
        accuracy: of all labelled words, "unknown" being right for a class without examples
            and wrong for one that was.
        accuracy_known: of the words whose class has examples, each given such a class.
        accuracy_known_or_unknown: of the same words, "unknown" being wrong for all of them.
        n: labelled words.
        n_known: of these, words whose class has examples.
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
        forced: [w] class given where every word gets one with examples.
        taught: classes that were learned.
        unknown: the label of no class.
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
        mean("accuracy"), mean("accuracy_known"), mean("accuracy_known_or_unknown"),
        sum(each.n for each in clips), sum(each.n_known for each in clips),
    )  # fmt: skip


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if len(values) else None


def evaluate_segmentation(
    con: Connection,
    lake: Lake,
    *,
    dataset: str | None = None,
    config: Config | None = None,
    mirrored: bool = True,
    min_quality: str | None = None,
) -> dict[str, Any]:
    """Segment each clip that has segments by those of the other clips (section 6.2).

    Args:
        con, lake: the lake.
        dataset: its clips only.
        config: how words are classified; it tells the method.
        mirrored: mirrored clips are examples too.
        min_quality: the worst verdict of stage "quality" that a clip may have; None: any.

    Returns:
        `SegmentationScores` of each clip in `per_clip`, and their means.

    Raises:
        UserError: fewer than two clips have segments.
    """
    check_served(lake, "signature")
    corpus = read_corpus(con, dataset)
    ranges = segments_of(con, corpus, min_quality)
    clips = sorted({r.clip for r in ranges})
    if len(clips) < 2:
        raise UserError(
            f"{len(clips)} clips of the lake have segments; leaving one out needs two: "
            "give them in segments.csv beside the clips"
        )
    method = segment_method(con, lake, corpus, config, mirrored=mirrored)
    method.read(clips)
    scores = {}
    for clip in clips:
        taught = [r for r in ranges if r.clip != clip]
        truth = [r for r in ranges if r.clip == clip]
        scores[corpus.clips[clip].clip] = segmentation_scores(method, clip, taught, truth)
    means = asdict(mean_scores(list(scores.values())))
    return {**means, "per_clip": {clip: asdict(each) for clip, each in scores.items()}}


def segments_of(con: Connection, corpus: Corpus, min_quality: str | None = None) -> list[LabelledRange]:
    """The segments of a corpus's clips that are at least so good. Raises `UserError` as `good_rows`."""
    every = fetch(con, "taught_segments", {"datasets": None, "clips": None})
    rows = good_rows(con, every, min_quality, "segments")
    return [
        LabelledRange(corpus.positions[r["clip"]], r["start"], r["stop"], r["label"])
        for r in rows
        if r["clip"] in corpus.positions
    ]


def segmentation_scores(
    method: SegmentMethod, clip: int, taught: list[LabelledRange], truth: list[LabelledRange]
) -> SegmentationScores:
    """Segment one clip by what `taught` (and its mirror images) shows, and score it by `truth`; all have been read."""
    label, seen = method.taught(taught), method.of_clip(clip)
    judged, forced = label(seen, False), label(seen, True)
    classes = word_truth(word_centres(method.corpus, clip), [(r.start, r.stop, r.label) for r in truth])
    return score_words(classes, judged.labels.tolist(), forced.labels.tolist(), {r.label for r in taught})
