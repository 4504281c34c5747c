"""PESTA's measures on a labelled lake: whole clips by their strings (section 8.3.1), sub-queries (section 8.3.3)."""

from __future__ import annotations

import statistics
import time
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any, Final

from motionlake.arrays import FloatArray
from motionlake.deep_motifs.emd import emd_matrix
from motionlake.errors import UserError
from motionlake.evaluation.classification import confusion
from motionlake.evaluation.clips import Notice, dtw_baseline
from motionlake.evaluation.ranking import (
    others,
    precision_recall,
    precision_recall_classes,
    ranked_relevance,
    relatives,
    score_rankings,
)
from motionlake.evaluation.sub_queries import (
    LongQuestion,
    SearchOf,
    Take,
    ask_all,
    fresh_search,
    long_questions,
    score_sub_queries,
    shared_search,
)
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.config import load_config
from motionlake.lake.layout import Lake
from motionlake.pesta.alignment.scan import symmetric_costs
from motionlake.pesta.config import METHODS, AlignmentConfig
from motionlake.retrieval.labelling.labelled_clips import SignedClips, lake_ground, signed_clips
from motionlake.retrieval.protocol import Scope
from motionlake.retrieval.symbol_strings import LakeStrings, read_strings

# The paper's strides: whole clips, sub-queries.
WHOLE_STRIDE: Final = 3
SUB_QUERY_STRIDE: Final = 2
ROUNDS: Final = 5


def evaluate_pesta(
    con: Connection,
    lake: Lake,
    *,
    dataset: str | None = None,
    column: str = "label",
    only: tuple[str, str] | None = None,
    dtw: bool | None = None,
    stride: int | None = None,
    notice: Notice = lambda line: None,
) -> dict[str, Any]:
    """Retrieval by the lake's strings: whole clips where they have labels, sub-queries where they have segments.

    Each labelled clip queries all others; costs are those of both ways, the greater. References are signatures and
    whole-clip DTW of frames.

    Args:
        con: to the lake.
        lake: for the frames that DTW compares.
        dataset: its clips only.
        column: what says their class.
        only: a column and the value that a clip must have in it.
        dtw: compare frames as well; None: where it takes less than `PATIENCE` seconds.
        stride: w of "sta"; the paper's if not given: 3 for whole clips, 2 for sub-queries.
        notice: hears what takes long or is left out.

    Returns:
        By method ("sta", "dtw", "sw", "signatures" and "dtw_frames", which may be None): map, p_at_2, p_at_5, p_at_10,
        p_at_15, p_at_20, nn, n (queries), curve (precision-recall: recall, precision, by_class) and confusion (of the
        first 20 hits: classes, counts). No methods where no two clips share a label. "sub_queries" (None without
        segments in two clips): pesta and pesta_lq with p_at_2, p_at_5, p_at_10, n, the same of all sub-queries
        (all_...) and seconds; share_of_time of pesta_lq.

    Raises:
        UserError: no such column, no strings, or neither labels nor segments to measure by.
    """
    strings, signed = read_strings(con), signed_clips(con, Scope(dataset, recorded_only=True), column, only)
    labelled = _with_strings(signed.labelled(), strings)
    config = load_config(lake.config_file).alignment
    result: dict[str, Any] = {}
    if len(set(labelled.labels)) < len(labelled.labels):
        result = _whole(con, lake, strings, labelled, dtw, replace(config, stride=stride or WHOLE_STRIDE), notice)
    config = replace(config, method="sta", stride=stride or SUB_QUERY_STRIDE)
    found = _sub_queries(con, strings, signed, config)
    if not result and found is None:
        raise UserError(
            f"no two of the {len(labelled.labels)} clips with a {column} share one, and no two clips have segments of "
            "one class: there is nothing to measure; --label-column names another column of labels.csv"
        )
    return {**result, "sub_queries": found}


def _with_strings(signed: SignedClips, strings: LakeStrings) -> SignedClips:
    at = [i for i, clip in enumerate(signed.clips) if clip.clip in strings.positions]
    return SignedClips([signed.clips[i] for i in at], signed.signatures[at])


def _whole(
    con: Connection,
    lake: Lake,
    strings: LakeStrings,
    signed: SignedClips,
    dtw: bool | None,
    config: AlignmentConfig,
    notice: Notice,
) -> dict[str, Any]:
    labels = signed.labels
    notice(f"{len(labels)} clips of {len(set(labels))} classes: {len(labels) * (len(labels) - 1)} alignments a method")
    own = [strings.repository.string(strings.positions[clip.clip]) for clip in signed.clips]
    result: dict[str, Any] = {
        method: _scores(symmetric_costs(own, strings.distances, replace(config, method=method)), labels)
        for method in METHODS
    }
    result["signatures"] = _scores(emd_matrix(signed.signatures, lake_ground(con)), labels)
    by_frames = dtw_baseline(lake, signed.clips, dtw, notice)
    result["dtw_frames"] = None if by_frames is None else _scores(by_frames, labels)
    return result


def _scores(distances: FloatArray, labels: Sequence[str]) -> dict[str, Any]:
    candidates = others(len(labels))
    rankings = ranked_relevance(distances, relatives(labels), candidates)
    return {
        **asdict(score_rankings(rankings)),
        "curve": precision_recall(rankings) | {"by_class": precision_recall_classes(rankings, labels)},
        "confusion": confusion(distances, labels, labels, candidates).as_dict(),
    }


def _sub_queries(
    con: Connection, strings: LakeStrings, signed: SignedClips, config: AlignmentConfig
) -> dict[str, Any] | None:
    """Table 4; None where no two clips have segments of one class."""
    questions = long_questions(_takes(con, strings, signed))
    searches: dict[str, SearchOf] = {"pesta": fresh_search, "pesta_lq": shared_search}
    try:
        result: dict[str, Any] = {
            name: asdict(score_sub_queries(questions, strings.distances, config, search))
            for name, search in searches.items()
        }
    except ValueError:
        return None
    seconds = _seconds(questions, strings, config, searches)
    for name, each in seconds.items():
        result[name]["seconds"] = each
    return {**result, "share_of_time": seconds["pesta_lq"] / seconds["pesta"]}


def _takes(con: Connection, strings: LakeStrings, signed: SignedClips) -> list[Take]:
    """The clips that have segments, by name."""
    segments: dict[str, list[tuple[int, int, str]]] = {}
    chosen = [clip.clip for clip in signed.clips if clip.clip in strings.positions]
    for row in fetch(con, "taught_segments", {"datasets": None, "clips": chosen}):
        segments.setdefault(row["clip"], []).append((row["start"], row["stop"], row["label"]))
    return [Take(strings.string_of(strings.positions[clip]), tuple(rows)) for clip, rows in sorted(segments.items())]


def _seconds(
    questions: Sequence[LongQuestion], strings: LakeStrings, config: AlignmentConfig, searches: dict[str, SearchOf]
) -> dict[str, float]:
    """Median seconds for all sub-queries, each search in turn; they have run before."""
    found: dict[str, list[float]] = {name: [] for name in searches}
    for _ in range(ROUNDS):
        for name, search in searches.items():
            start = time.perf_counter()
            ask_all(questions, strings.distances, config, search)
            found[name].append(time.perf_counter() - start)
    return {name: statistics.median(seconds) for name, seconds in found.items()}
