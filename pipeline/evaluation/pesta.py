"""PESTA's measures on a labelled lake: whole clips by their strings (section 8.3.1), sub-queries (section 8.3.3).

Sub-queries: each take is a long query in turn, the other takes are the repository. Windows of 3s symbols, s apart, are
its sub-queries: those of whose frames at least 60 % are of one class. A match is of the class of most of its frames,
and right where that is the sub-query's.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import numpy as np
from motionlake.arrays import FloatArray
from motionlake.deep_motifs.emd import emd_matrix
from motionlake.errors import UserError
from motionlake.evaluation.clips import LabelledOptions
from motionlake.evaluation.dtw import dtw_baseline
from motionlake.evaluation.ranking import (
    by_class,
    confusion,
    others,
    precision_recall,
    ranked_relevance,
    relatives,
    score_rankings,
)
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import Lake
from motionlake.lake.models import check_served
from motionlake.lake.settings import served_config
from motionlake.lake.strings import LakeStrings, read_strings
from motionlake.pesta.config import METHODS, AlignmentConfig
from motionlake.pesta.long_query import LongQuery
from motionlake.pesta.matches import Match, best_matches
from motionlake.pesta.scan import symmetric_costs
from motionlake.pesta.strings import Distances, Repository, SymbolDistances
from motionlake.pesta.symbols import SymbolString
from motionlake.retrieval.labelled_clips import SignedClips, lake_ground

# The paper's strides: whole clips, sub-queries.
WHOLE_STRIDE: Final = 3
SUB_QUERY_STRIDE: Final = 2
ROUNDS: Final = 5
SLIDE: Final = 4  # s
SHARE: Final = 0.6
HITS: Final = 10
Segments = Sequence[tuple[int, int, str]]
# The best matches of symbols [first, last) of a long query.
Search = Callable[[int, int], list[Match]]


def evaluate_pesta(
    con: Connection, lake: Lake, options: LabelledOptions, *, stride: int | None = None
) -> dict[str, Any]:
    """Retrieval by the lake's strings: whole clips where they have labels, sub-queries where they have segments.

    Each labelled clip queries all others; costs are those of both ways, the greater. References are signatures and
    whole-clip DTW of frames.

    Args:
        con, lake: the lake.
        options: which clips.
        stride: w of "sta"; the paper's if not given: 3 for whole clips, 2 for sub-queries.

    Returns:
        By method ("sta", "dtw", "sw", "signatures" and "dtw_frames", which may be None): map, p_at_2, p_at_5, p_at_10,
        p_at_15, p_at_20, nn, n (queries), curve (precision-recall: recall, precision, by_class) and confusion (of the
        first 20 hits: classes, counts). No methods where no two clips share a label. "sub_queries" (None without
        segments in two clips): pesta and pesta_lq with what `score_sub_queries` gives and seconds; share_of_time of
        pesta_lq.

    Raises:
        UserError: no such column, no strings, or neither labels nor segments to measure by.
    """
    check_served(con, lake, "signature", "alignment")
    strings, signed = read_strings(con), options.signed(con)
    signed = signed.chosen([clip.clip in strings.positions for clip in signed.clips])
    labelled = signed.labelled()
    config = served_config(lake).alignment
    result: dict[str, Any] = {}
    if len(set(labelled.labels)) < len(labelled.labels):
        result = _whole(con, lake, strings, labelled, options, replace(config, stride=stride or WHOLE_STRIDE))
    config = replace(config, method="sta", stride=stride or SUB_QUERY_STRIDE)
    found = _sub_queries(con, strings, signed, config)
    if not result and found is None:
        raise UserError(
            f"no two of the {len(labelled.labels)} clips with a {options.column} share one, and no two clips have "
            "segments of one class: there is nothing to measure; --label-column names another column of labels.csv"
        )
    return {**result, "sub_queries": found}


def _whole(
    con: Connection,
    lake: Lake,
    strings: LakeStrings,
    signed: SignedClips,
    options: LabelledOptions,
    config: AlignmentConfig,
) -> dict[str, Any]:
    labels, n = signed.labels, len(signed.labels)
    options.notice(f"{n} clips of {len(set(labels))} classes: {n * (n - 1)} alignments a method")
    own = [strings.repository.string(strings.positions[clip.clip]) for clip in signed.clips]
    result: dict[str, Any] = {
        method: _scores(symmetric_costs(own, strings.distances, replace(config, method=method)), labels)
        for method in METHODS
    }
    result["signatures"] = _scores(emd_matrix(signed.signatures, lake_ground(con)), labels)
    by_frames = dtw_baseline(lake, signed.clips, options.dtw, options.notice)
    result["dtw_frames"] = None if by_frames is None else _scores(by_frames, labels)
    return result


def _scores(distances: FloatArray, labels: Sequence[str]) -> dict[str, Any]:
    candidates = others(len(labels))
    rankings = ranked_relevance(distances, relatives(labels), candidates)
    of_classes = {label: precision_recall(hits)["precision"] for label, hits in by_class(rankings, labels).items()}
    return {
        **asdict(score_rankings(rankings)),
        "curve": precision_recall(rankings) | {"by_class": of_classes},
        "confusion": confusion(distances, labels, labels, candidates),
    }


@dataclass(frozen=True)
class Take:
    """A clip with its string, and what its frames [start, stop) show: (start, stop, label)."""

    string: SymbolString
    segments: tuple[tuple[int, int, str], ...]


@dataclass(frozen=True)
class SubQuery:
    """Symbols [first, last) of a take, most of whose frames are of one class."""

    first: int
    last: int
    label: str


@dataclass(frozen=True)
class LongQuestion:
    """One take with its sub-queries, and the takes that are searched, with their strings as a repository."""

    take: Take
    asked: list[SubQuery]
    elsewhere: list[Take]
    repository: Repository


SearchOf = Callable[[LongQuestion, SymbolDistances, AlignmentConfig], Search]


def class_of(start: int, stop: int, segments: Segments) -> tuple[str, float]:
    """The class of most of the frames [start, stop), and its share of them; ("", 0) where none has one.

    A frame may be of several classes. Of classes with equally many frames the first by name.
    """
    found: dict[str, np.ndarray] = {}
    for begin, end, label in segments:
        mask = found.setdefault(label, np.zeros(max(0, stop - start), dtype=np.bool_))
        mask[max(begin - start, 0) : max(end - start, 0)] = True
    counts = {label: int(mask.sum()) for label, mask in sorted(found.items())}
    best = max(counts, key=lambda label: counts[label], default="")
    return (best, counts[best] / (stop - start)) if best and counts[best] else ("", 0.0)


def sub_queries(take: Take, share: float = SHARE) -> list[SubQuery]:
    """The windows of a take that are of one class, in order."""
    found = []
    for first in range(0, len(take.string) - 3 * SLIDE + 1, SLIDE):
        last = first + 3 * SLIDE
        start, stop = int(take.string.starts[first]), int(take.string.stops[last - 1])
        label, of_it = class_of(start, stop, take.segments)
        if label and of_it >= share:
            found.append(SubQuery(first, last, label))
    return found


def long_questions(takes: Sequence[Take]) -> list[LongQuestion]:
    """Each take in turn against the others."""
    found = []
    for i, take in enumerate(takes):
        elsewhere = [*takes[:i], *takes[i + 1 :]]
        repository = Repository.of([other.string.symbols for other in elsewhere])
        found.append(LongQuestion(take, sub_queries(take), elsewhere, repository))
    return found


def fresh_search(question: LongQuestion, distances: SymbolDistances, config: AlignmentConfig) -> Search:
    """Each sub-query is a query of its own (PESTA)."""
    symbols = question.take.string.symbols
    return lambda first, last: best_matches(symbols[first:last], question.repository, distances, HITS, config)


def shared_search(question: LongQuestion, distances: SymbolDistances, config: AlignmentConfig) -> Search:
    """Sub-queries share the segments of the long query (PESTA-LQ)."""
    query = LongQuery(question.take.string.symbols, question.repository, distances, config)
    return lambda first, last: query.best_matches(first, last, HITS)


def ask_all(
    questions: Sequence[LongQuestion], distances: Distances, config: AlignmentConfig, search: SearchOf
) -> Iterator[tuple[LongQuestion, SubQuery, list[Match]]]:
    """The best matches of every sub-query."""
    ground = SymbolDistances.of(distances)
    for question in questions:
        ask = search(question, ground, config)
        for query in question.asked:
            yield question, query, ask(query.first, query.last)


def score_sub_queries(
    questions: Sequence[LongQuestion], distances: Distances, config: AlignmentConfig, search: SearchOf
) -> dict[str, float]:
    """Ask every sub-query, and judge its matches; one that was not found is not right.

    Returns:
        p_at_2, p_at_5, p_at_10: share of right matches among the first so many, means over the n sub-queries whose
        class another take shows; n; all_p_at_2, ... all_n: the same of all sub-queries (others have 0).

    Raises:
        ValueError: no sub-query has a class that another take shows.
    """
    right, shown = [], []
    for question, query, matches in ask_all(questions, distances, config, search):
        hits = [_class(question.elsewhere[match.clip], match) == query.label for match in matches]
        right.append([sum(hits[:n]) / n for n in (2, 5, 10)])
        shown.append(any(query.label == label for other in question.elsewhere for _, _, label in other.segments))
    if not any(shown):
        raise ValueError("no sub-query has a class that another take shows: nothing to retrieve")
    found: dict[str, float] = {}
    for name, rows in (("", np.array(right)[shown]), ("all_", np.array(right))):
        found |= {f"{name}p_at_{n}": float(mean) for n, mean in zip((2, 5, 10), rows.mean(axis=0), strict=True)}
        found[f"{name}n"] = len(rows)
    return found


def _class(take: Take, match: Match) -> str:
    start, stop = int(take.string.starts[match.start]), int(take.string.stops[match.stop - 1])
    return class_of(start, stop, take.segments)[0]


def _sub_queries(
    con: Connection, strings: LakeStrings, signed: SignedClips, config: AlignmentConfig
) -> dict[str, Any] | None:
    """Table 4; None where no two clips have segments of one class."""
    segments: dict[str, list[tuple[int, int, str]]] = {}
    for row in fetch(con, "taught_segments", {"datasets": None, "clips": [clip.clip for clip in signed.clips]}):
        segments.setdefault(row["clip"], []).append((row["start"], row["stop"], row["label"]))
    questions = long_questions(
        [Take(strings.string_of(strings.positions[clip]), tuple(rows)) for clip, rows in sorted(segments.items())]
    )
    searches: dict[str, SearchOf] = {"pesta": fresh_search, "pesta_lq": shared_search}
    try:
        result: dict[str, Any] = {
            name: score_sub_queries(questions, strings.distances, config, search) for name, search in searches.items()
        }
    except ValueError:
        return None
    times: dict[str, list[float]] = {name: [] for name in searches}
    for _ in range(ROUNDS):  # each search in turn; they have run before
        for name, search in searches.items():
            start = time.perf_counter()
            list(ask_all(questions, strings.distances, config, search))
            times[name].append(time.perf_counter() - start)
    for name, seconds in times.items():
        result[name]["seconds"] = statistics.median(seconds)
    return {**result, "share_of_time": result["pesta_lq"]["seconds"] / result["pesta"]["seconds"]}
