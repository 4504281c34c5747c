"""Deep Motifs' measures of segmentation on a lake with segments (section 6.2)."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from motionlake.arrays import Int32Array
from motionlake.deep_motifs.corpus import Corpus
from motionlake.deep_motifs.segmentation import (
    SegmentationConfig,
    Segmenter,
    TaughtRange,
    taught_windows,
    word_centres,
)
from motionlake.errors import UserError
from motionlake.evaluation.measures.segmentation import SegmentationScores, mean_scores, score_words, word_truth
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.corpus import read_corpus
from motionlake.lake.layout import Lake
from motionlake.retrieval.labelling.segments import mirrored_motifs


@dataclass(frozen=True)
class SegmentationResult:
    """Scores of each clip, and their means."""

    clips: dict[str, SegmentationScores]
    mean: SegmentationScores

    def as_dict(self) -> dict[str, Any]:
        return {**asdict(self.mean), "per_clip": {clip: asdict(each) for clip, each in self.clips.items()}}


def evaluate_segmentation(
    con: Connection,
    lake: Lake,
    *,
    dataset: str | None = None,
    config: SegmentationConfig | None = None,
    mirrored: bool = True,
) -> SegmentationResult:
    """Segment each clip that has segments by those of the other clips (section 6.2).

    Args:
        con: to the lake.
        lake: for the mirrored words.
        dataset: its clips only.
        config: how words are classified.
        mirrored: clips teach their mirror images too.

    Raises:
        UserError: fewer than two clips have segments.
    """
    corpus = read_corpus(con, dataset)
    ranges = segments_of(con, corpus)
    clips = sorted({r.clip for r in ranges})
    if len(clips) < 2:
        raise UserError(
            f"{len(clips)} clips of the lake have segments; leaving one out needs two: "
            "give them in segments.csv beside the clips"
        )
    turned = mirrored_motifs(con, lake, corpus, clips) if mirrored else None
    scores = {}
    for clip in clips:
        taught = [r for r in ranges if r.clip != clip]
        truth = [r for r in ranges if r.clip == clip]
        scores[corpus.clips[clip].clip] = segmentation_scores(corpus, clip, taught, truth, config, turned)
    return SegmentationResult(scores, mean_scores(list(scores.values())))


def segments_of(con: Connection, corpus: Corpus) -> list[TaughtRange]:
    """The segments of a corpus's clips."""
    rows = fetch(con, "taught_segments", {"datasets": None, "clips": None})
    return [
        TaughtRange(corpus.positions[r["clip"]], r["start"], r["stop"], r["label"])
        for r in rows
        if r["clip"] in corpus.positions
    ]


def segmentation_scores(
    corpus: Corpus,
    clip: int,
    taught: list[TaughtRange],
    truth: list[TaughtRange],
    config: SegmentationConfig | None = None,
    mirrored: dict[int, Int32Array] | None = None,
) -> SegmentationScores:
    """Segment one clip by what `taught` (and its mirror images) shows, and score it by `truth`."""
    chosen = config or SegmentationConfig()
    segmenter = Segmenter(taught_windows(corpus, taught, chosen.window, mirrored), corpus.ground, chosen)
    motifs = corpus.motifs[corpus.words_of(clip)]
    judged, forced = segmenter.label_words(motifs, corpus.idf), segmenter.forced_words(motifs, corpus.idf)
    classes = word_truth(word_centres(corpus, clip), [(r.start, r.stop, r.label) for r in truth])
    return score_words(classes, judged.labels.tolist(), forced.labels.tolist(), segmenter.classes.tolist())
