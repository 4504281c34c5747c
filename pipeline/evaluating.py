"""The paper's measures on a labelled lake: whole clips (tables 1 and 2) and segmentation (section 6.2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pipeline import frames
from pipeline.applications.classification import classify_one_vs_all
from pipeline.applications.segmentation import (
    SegmentationConfig,
    Segmenter,
    TaughtRange,
    taught_windows,
    word_centres,
)
from pipeline.corpus import Corpus, read_corpus
from pipeline.emd import emd_matrix
from pipeline.errors import UserError
from pipeline.evaluation.classification import folded_accuracy
from pipeline.evaluation.dtw import CELLS_PER_SECOND, baseline_features, dtw_matrix, frame_pairs
from pipeline.evaluation.retrieval import leave_one_out
from pipeline.evaluation.segmentation import SegmentationScores, mean_scores, score_words, word_truth
from pipeline.labelling.segments import mirrored_motifs
from pipeline.labelling.signed import SignedClips, lake_ground, signed_clips
from pipeline.lake.catalog import Connection, fetch
from pipeline.lake.layout import Lake

Float64Array = NDArray[np.float64]
Notice = Callable[[str], None]

# Whole-clip DTW is left out by default where it would take longer.
PATIENCE: Final = 300.0
# Parts of the clips that are left out in turn where there are more clips than `LEAVE_ONE_OUT`.
FOLDS: Final = 5
LEAVE_ONE_OUT: Final = 100


def evaluate_signatures(
    con: Connection,
    lake: Lake,
    *,
    dataset: str | None = None,
    column: str = "label",
    only: tuple[str, str] | None = None,
    dtw: bool | None = None,
    notice: Notice = lambda line: None,
) -> dict[str, Any]:
    """Leave-one-out retrieval and one-vs-all classification by signatures, whole-clip DTW beside it.

    Args:
        con: to the lake.
        lake: for the frames that DTW compares.
        dataset: its clips only.
        column: what says their class.
        only: a column and the value that a clip must have in it.
        dtw: compute the baseline; None: where it takes less than `PATIENCE` seconds.
        notice: hears what takes long or is left out.

    Returns:
        nn, top5, first_tier, second_tier, map, cross_subject_nn (None without subjects), n (queries), clips,
        classes, classification {accuracy, protocol}, and dtw with the same measures, or None.

    Raises:
        UserError: no such column, or no two clips with one label.
    """
    signed = signed_clips(con, dataset, column, only).labelled()
    labels = signed.labels
    if len(set(labels)) == len(labels):
        raise UserError(
            f"no two of the {len(labels)} clips with a {column} share one: there is nothing to measure; "
            "--label-column names another column of labels.csv"
        )
    pairs = len(labels) * (len(labels) - 1) // 2
    notice(f"{len(labels)} clips of {len(set(labels))} classes: {pairs} distances")
    ground = lake_ground(con)
    result = _measures(emd_matrix(signed.signatures, ground), labels, signed, column)
    features = clip_features(con, lake, signed) if dtw is not False else []
    seconds = frame_pairs([len(f) for f in features]) / CELLS_PER_SECOND
    if dtw is None and seconds > PATIENCE:
        notice(
            f"whole-clip DTW is left out: it would take about {seconds / 60:.0f} minutes; --baseline dtw computes it"
        )
        dtw = False
    result["dtw"] = None
    if dtw is not False:
        notice(f"whole-clip DTW: about {seconds:.0f} s")
        result["dtw"] = _measures(dtw_matrix(features), labels, signed, column)
    return result


def dtw_distances(con: Connection, lake: Lake, signed: SignedClips) -> Float64Array:
    """[n, n] whole-clip DTW between clips of a lake."""
    return dtw_matrix(clip_features(con, lake, signed))


def _measures(distances: Float64Array, labels: list[str], signed: SignedClips, column: str) -> dict[str, Any]:
    names = [clip.subject or "" for clip in signed.clips]
    subjects = None if column == "subject" or len(set(names) - {""}) < 2 else names
    scores = asdict(leave_one_out(distances, labels, subjects))
    scores["n"] = scores.pop("queries")
    return {
        **scores,
        "clips": len(labels),
        "classes": len(set(labels)),
        "classification": _one_vs_all(distances, labels),
    }


def _one_vs_all(distances: Float64Array, labels: list[str]) -> dict[str, Any] | None:
    if len(set(labels)) < 2:
        return None
    folds = len(labels) if len(labels) <= LEAVE_ONE_OUT else FOLDS

    def classify(queries: Float64Array, known: Float64Array, names: list[str]) -> list[str]:
        if len(set(names)) < 2:
            return names[:1] * len(queries)
        return [verdict.label for verdict in classify_one_vs_all(queries, known, names)]

    protocol = "leave one out" if folds == len(labels) else f"{folds} folds"
    return {"accuracy": folded_accuracy(distances, labels, folds, classify), "protocol": protocol}


def clip_features(con: Connection, lake: Lake, signed: SignedClips) -> list[NDArray[np.float32]]:
    """What DTW compares, of every clip; each frames part is read once."""
    rates = {clip.clip: clip.fps for clip in signed.clips}
    found: dict[str, NDArray[np.float32]] = {}
    for dataset, part in sorted({(clip.dataset, clip.part) for clip in signed.clips}):
        for clip in frames.read_part(lake.path(lake.frames_part(dataset, part))):
            if clip.clip in rates:
                found[clip.clip] = baseline_features(clip.positions.astype(np.float64), rates[clip.clip])
    return [found[clip.clip] for clip in signed.clips]


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
    rows = fetch(con, "queries/taught_segments.sql", {"datasets": None, "clips": None})
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
    mirrored: dict[int, NDArray[np.int32]] | None = None,
) -> SegmentationScores:
    """Segment one clip by what `taught` (and its mirror images) shows, and score it by `truth`."""
    chosen = config or SegmentationConfig()
    segmenter = Segmenter(taught_windows(corpus, taught, chosen.window, mirrored), corpus.ground, chosen)
    motifs = corpus.motifs[corpus.words_of(clip)]
    judged, forced = segmenter.label_words(motifs, corpus.idf), segmenter.forced_words(motifs, corpus.idf)
    classes = word_truth(word_centres(corpus, clip), [(r.start, r.stop, r.label) for r in truth])
    return score_words(classes, judged.labels.tolist(), forced.labels.tolist(), segmenter.classes.tolist())
