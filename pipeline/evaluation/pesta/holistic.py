"""Sub-sequences by holistic queries (section 8.3.2, Fig. 7): segments of clips are looked for in the other clips.

An answer is of the class of most of its frames, and right where that is the query's. Answers are those of `motionlake
align`, until there are `MOST` or no more. The clip that a query is cut from is not searched.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import partial
from typing import Any, Final

import numpy as np
from motionlake.arrays import BoolArray
from motionlake.deep_motifs.signatures import CorpusClip
from motionlake.evaluation.pesta.measuring import PART_STRIDE, Asked, Measuring, class_of
from motionlake.evaluation.ranking import average_precision, by_class, precision_recall
from motionlake.pesta.config import METHODS, Method
from motionlake.retrieval.alignment import AlignmentRangeSearcher

FIRST: Final = (2, 5, 10)
MOST: Final = 200  # answers to a query
LATE: Final = 100_000  # answers after which a missing one comes
CONFUSED: Final = 10  # answers whose class is counted
NO_CLASS: Final = "none"  # of an answer most of whose frames show nothing known


def measure_holistic(measuring: Measuring) -> dict[str, Any]:
    """By method: p_at_2, p_at_5, p_at_10 (an answer that is missing is not right), map, n, curve, confusion; all_p_at_…
    and all_n count the queries that are one symbol, which `align` refuses, as not answered.

    The whole of recall is the most right answers that any method has to a query; those that a method lacks come last.

    Raises:
        UserError: no class is shown by two clips.
    """
    asked = measuring.asked
    labels = [each.label for each, _ in asked.queries]
    answers = {method: _classes(measuring, asked, method) for method in METHODS}
    right = {method: _right(found, labels) for method, found in answers.items()}
    most = [max(int(row.sum()) for row in rows) for rows in zip(*right.values(), strict=True)]
    return {method: _scores(right[method], most, answers[method], labels, asked.refused) for method in METHODS}


def _classes(measuring: Measuring, asked: Asked, method: Method) -> list[list[str]]:
    """The classes of the answers to each query, nearest first."""
    found: list[list[str]] = []
    searchers: dict[str, AlignmentRangeSearcher] = {}
    config = measuring.alignment(method, PART_STRIDE)
    for each, query in asked.queries:
        if each.clip not in searchers:
            others = {clip for clip in measuring.segments if clip != each.clip}
            elsewhere = measuring.strings.among(partial(_is_one, others))
            searchers[each.clip] = AlignmentRangeSearcher(
                measuring.lake, method=method, stride=config.stride, gaps=config.gaps, strings=elsewhere
            )
        hits = searchers[each.clip].matched(query, MOST)
        found.append([_class(measuring, hit.clip, hit.start or 0, hit.stop or 0) for hit in hits])
    return found


def _is_one(names: set[str], clip: CorpusClip) -> bool:
    return clip.clip in names


def _class(measuring: Measuring, clip: str, start: int, stop: int) -> str:
    return class_of(start, stop, measuring.segments[clip])[0] or NO_CLASS


def _right(answers: Sequence[Sequence[str]], labels: Sequence[str]) -> list[BoolArray]:
    return [
        np.array([name == label for name in names], dtype=np.bool_)
        for names, label in zip(answers, labels, strict=True)
    ]


def _scores(
    right: Sequence[BoolArray],
    most: Sequence[int],
    answers: Sequence[Sequence[str]],
    labels: Sequence[str],
    refused: int,
) -> dict[str, Any]:
    n = len(labels)
    found: dict[str, Any] = {}
    for k in FIRST:
        total = sum(float(row[:k].sum()) / k for row in right)
        found |= {f"p_at_{k}": total / n, f"all_p_at_{k}": total / (n + refused)}
    rows = [_complete(row, count) for row, count in zip(right, most, strict=True) if count]
    known = [label for label, count in zip(labels, most, strict=True) if count]
    found["map"] = sum(map(average_precision, rows)) / n
    curve: dict[str, Any] = {"recall": [], "precision": []} if not rows else precision_recall(rows)
    of_classes = {label: precision_recall(hits)["precision"] for label, hits in by_class(rows, known).items()}
    return {
        **found, "n": n, "all_n": n + refused, "curve": curve | {"by_class": of_classes},
        "confusion": _confusion(answers, labels),
    }  # fmt: skip


def _complete(row: BoolArray, count: int) -> BoolArray:
    """A ranking that has so many right answers; those that were missing come last, after many that are wrong."""
    return np.concatenate([row, np.repeat([False, True], [LATE, count - int(row.sum())])])


def _confusion(answers: Sequence[Sequence[str]], labels: Sequence[str]) -> dict[str, Any]:
    """As `ranking.confusion`, of ranges."""
    counted = Counter((label, name) for names, label in zip(answers, labels, strict=True) for name in names[:CONFUSED])
    classes = sorted({name for pair in counted for name in pair} | set(labels))
    return {"classes": classes, "counts": [[counted[row, column] for column in classes] for row in classes]}
