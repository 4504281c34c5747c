"""Whole clips by their strings (section 8.3.1, Fig. 6, Table 5): each labelled clip queries all others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float32Array, FloatArray
from motionlake.deep_motifs.emd import emd_matrix
from motionlake.evaluation.dtw import dtw_baseline
from motionlake.evaluation.pesta.measuring import WHOLE_STRIDE, Measuring
from motionlake.evaluation.ranking import (
    by_class,
    confusion,
    others,
    precision_recall,
    ranked_relevance,
    relatives,
    score_rankings,
)
from motionlake.lake.models import check_served
from motionlake.pesta.config import METHODS
from motionlake.pesta.nearest import Both, symmetric_costs
from motionlake.retrieval.labelled_clips import CodedClips, lake_ground

ONE_WAY: Final = "_one_way"
WAYS: Final[tuple[Both, ...]] = ("max", "query")


def measure_whole(measuring: Measuring) -> dict[str, Any] | None:
    """Scores by method; costs are those of both ways, the greater, or of the query in the clip alone ("one way", the
    paper's). References are signatures, None where a clip lacks one, and whole-clip DTW of frames. None where no two
    clips share a label."""
    chosen, strings = measuring.chosen.labelled(), measuring.strings
    labels, n = chosen.labels, len(chosen.labels)
    if len(set(labels)) == n:
        return None
    measuring.options.notice(f"{n} clips of {len(set(labels))} classes: {n * (n - 1)} alignments a method")
    signed = _signatures(measuring, chosen)
    own = [strings.repository.string(strings.positions[clip.clip]) for clip in chosen.clips]
    result: dict[str, Any] = {}
    for both in WAYS:
        for method in METHODS:
            config = measuring.alignment(method, WHOLE_STRIDE)
            name = method if both == "max" else f"{method}{ONE_WAY}"
            result[name] = scores(symmetric_costs(own, strings.distances, config, both=both), labels)
    result["signatures"] = None if signed is None else scores(emd_matrix(signed, lake_ground(measuring.con)), labels)
    by_frames = dtw_baseline(measuring.lake, chosen.clips, measuring.options.dtw, measuring.options.notice)
    result["dtw_frames"] = None if by_frames is None else scores(by_frames, labels)
    return result


def _signatures(measuring: Measuring, chosen: CodedClips) -> Float32Array | None:
    """[n, K]; None where a clip has none, as in a lake without stage "signatures"."""
    lacking = chosen.signatures.count(None)
    if lacking:
        measuring.options.notice(f"signatures: left out, as {lacking} of {len(chosen.clips)} clips have none")
        return None
    check_served(measuring.lake, "signature")
    return np.array(chosen.signatures, dtype=np.float32)


def scores(distances: FloatArray, labels: Sequence[str]) -> dict[str, Any]:
    """Of [n, n] distances: the means, precision-recall curves, the classes of the first 20 hits."""
    candidates = others(len(labels))
    rankings = ranked_relevance(distances, relatives(labels), candidates)
    of_classes = {label: precision_recall(hits)["precision"] for label, hits in by_class(rankings, labels).items()}
    return {
        **asdict(score_rankings(rankings)),
        "curve": precision_recall(rankings) | {"by_class": of_classes},
        "confusion": confusion(distances, labels, labels, candidates),
    }
