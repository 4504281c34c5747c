"""Deep Motifs' measures of whole clips on a labelled lake (tables 1 and 2)."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Final

from motionlake.arrays import Float64Array
from motionlake.deep_motifs.classification import classify_one_vs_all
from motionlake.deep_motifs.emd import emd_matrix
from motionlake.errors import UserError
from motionlake.evaluation.classification import folded_accuracy
from motionlake.evaluation.clips import Notice, dtw_baseline
from motionlake.evaluation.ranking import leave_one_out
from motionlake.lake.catalog import Connection
from motionlake.lake.layout import Lake
from motionlake.retrieval.labelling.labelled_clips import SignedClips, lake_ground, signed_clips
from motionlake.retrieval.protocol import Scope

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
    signed = signed_clips(con, Scope(dataset, recorded_only=True), column, only).labelled()
    labels = signed.labels
    if len(set(labels)) == len(labels):
        raise UserError(
            f"no two of the {len(labels)} clips with a {column} share one: there is nothing to measure; "
            "--label-column names another column of labels.csv"
        )
    pairs = len(labels) * (len(labels) - 1) // 2
    notice(f"{len(labels)} clips of {len(set(labels))} classes: {pairs} distances")
    result = _measures(emd_matrix(signed.signatures, lake_ground(con)), labels, signed, column)
    by_frames = dtw_baseline(lake, signed.clips, dtw, notice)
    result["dtw"] = None if by_frames is None else _measures(by_frames, labels, signed, column)
    return result


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
        return [prediction.label for prediction in classify_one_vs_all(queries, known, names)]

    protocol = "leave one out" if folds == len(labels) else f"{folds} folds"
    return {"accuracy": folded_accuracy(distances, labels, folds, classify), "protocol": protocol}
