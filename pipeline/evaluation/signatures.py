"""Deep Motifs' measures of whole clips on a labelled lake (section 5.3; tables 1 and 2)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.deep_motifs.classification import classify_one_vs_all
from motionlake.deep_motifs.emd import emd_matrix
from motionlake.errors import UserError
from motionlake.evaluation.clips import LEAVE_ONE_OUT, LabelledOptions
from motionlake.evaluation.dtw import dtw_baseline
from motionlake.evaluation.ranking import leave_one_out
from motionlake.lake.catalog import Connection
from motionlake.lake.layout import Lake
from motionlake.lake.models import check_served
from motionlake.retrieval.labelled_clips import SignedClips, lake_ground

# Parts of the clips that are left out in turn, where there are more clips than `MOST_LEFT_OUT`.
FOLDS: Final = 5
MOST_LEFT_OUT: Final = 100
# Distances [q, n] of clips from n labelled ones, distances [n, n] of these, their labels [n] -> q classes.
Classifier = Callable[[Float64Array, Float64Array, list[str]], list[str]]


def evaluate_signatures(con: Connection, lake: Lake, options: LabelledOptions) -> dict[str, Any]:
    """Leave-one-out retrieval and one-vs-all classification by signatures, whole-clip DTW beside it.

    Returns:
        nn, top5, first_tier, second_tier, map, cross_subject_nn (None without subjects), n (queries), clips,
        classes, classification {accuracy, protocol}, and dtw with the same measures, or None.

    Raises:
        UserError: no such column, or no two clips with one label.
    """
    check_served(lake, "signature")
    signed = options.signed(con).labelled()
    labels = signed.labels
    if len(set(labels)) == len(labels):
        raise UserError(
            f"no two of the {len(labels)} clips with a {options.column} share one: there is nothing to measure; "
            "--label-column names another column of labels.csv"
        )
    pairs = len(labels) * (len(labels) - 1) // 2
    options.notice(f"{len(labels)} clips of {len(set(labels))} classes: {pairs} distances")
    result = _measures(emd_matrix(signed.signatures, lake_ground(con)), signed, options.column)
    by_frames = dtw_baseline(lake, signed.clips, options.dtw, options.notice)
    result["dtw"] = None if by_frames is None else _measures(by_frames, signed, options.column)
    return result


def _measures(distances: Float64Array, signed: SignedClips, column: str) -> dict[str, Any]:
    labels, names = signed.labels, [clip.subject or "" for clip in signed.clips]
    subjects = None if column == "subject" or len(set(names) - {""}) < 2 else names
    return {
        **asdict(leave_one_out(distances, labels, subjects)),
        "clips": len(labels),
        "classes": len(set(labels)),
        "classification": _one_vs_all(distances, labels),
    }


def _one_vs_all(distances: Float64Array, labels: list[str]) -> dict[str, Any] | None:
    if len(set(labels)) < 2:
        return None
    folds = len(labels) if len(labels) <= MOST_LEFT_OUT else FOLDS

    def classify(queries: Float64Array, known: Float64Array, names: list[str]) -> list[str]:
        if len(set(names)) < 2:
            return names[:1] * len(queries)
        return [prediction.label for prediction in classify_one_vs_all(queries, known, names)]

    protocol = LEAVE_ONE_OUT if folds == len(labels) else f"{folds} folds"
    return {"accuracy": folded_accuracy(distances, labels, folds, classify), "protocol": protocol}


def folded_accuracy(distances: Float64Array, labels: Sequence[str], folds: int, classify: Classifier) -> float:
    """Share of clips that get their own class while they, and the others of their part, are left out.

    Each class is dealt evenly over `folds` parts; n parts of n clips leave one out. Clips whose class nobody
    else holds then are left out of the share.

    Args:
        distances: [n, n], row i from clip i.
        labels: [n].
        folds: how many parts.
        classify: a method.

    Raises:
        ValueError: no clip with another of its class.
    """
    names = np.asarray(labels)
    part = np.empty(len(names), dtype=np.int64)
    part[np.argsort(names, kind="stable")] = np.arange(len(names)) % folds
    right: list[bool] = []
    for fold in range(folds):
        test, known = np.flatnonzero(part == fold), np.flatnonzero(part != fold)
        test = test[np.isin(names[test], names[known])]
        if len(test):
            found = classify(distances[np.ix_(test, known)], distances[np.ix_(known, known)], names[known].tolist())
            right += (np.asarray(found) == names[test]).tolist()
    if not right:
        raise ValueError("no clip has another of its class: nothing to learn from")
    return sum(right) / len(right)
