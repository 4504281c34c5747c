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
CONFUSED: Final = 10  # answers whose class is counted
NO_CLASS: Final = "none"  # of an answer most of whose frames show nothing known


def measure_holistic(measuring: Measuring) -> dict[str, Any]:
    """By method: p_at_2, p_at_5, p_at_10 (an answer that is missing is not right), map, n, curve, confusion; all_p_at_…
    and all_n count the queries that are one symbol, which `align` refuses, as not answered.

    Of precision and recall the whole is what right answers there are among the first 200.

    Raises:
        UserError: no class is shown by two clips.
    """
    asked = measuring.asked
    return {method: _scores(_classes(measuring, asked, method), asked) for method in METHODS}


def _classes(measuring: Measuring, asked: Asked, method: Method) -> list[list[str]]:
    """The classes of the answers to each query, nearest first."""
    found: list[list[str]] = []
    searchers: dict[str, AlignmentRangeSearcher] = {}
    stride = measuring.alignment(method, PART_STRIDE).stride
    for each, query in asked.queries:
        if each.clip not in searchers:
            others = {clip for clip in measuring.segments if clip != each.clip}
            elsewhere = measuring.strings.among(partial(_is_one, others))
            searchers[each.clip] = AlignmentRangeSearcher(
                measuring.lake, method=method, stride=stride, strings=elsewhere
            )
        hits = searchers[each.clip].matched(query, MOST)
        found.append([_class(measuring, hit.clip, hit.start or 0, hit.stop or 0) for hit in hits])
    return found


def _is_one(names: set[str], clip: CorpusClip) -> bool:
    return clip.clip in names


def _class(measuring: Measuring, clip: str, start: int, stop: int) -> str:
    return class_of(start, stop, measuring.segments[clip])[0] or NO_CLASS


def _scores(answers: Sequence[Sequence[str]], asked: Asked) -> dict[str, Any]:
    labels = [each.label for each, _ in asked.queries]
    right = [
        np.array([name == label for name in names], dtype=np.bool_)
        for names, label in zip(answers, labels, strict=True)
    ]
    n, every = len(labels), len(labels) + asked.refused
    found: dict[str, Any] = {}
    for k in FIRST:
        total = sum(float(row[:k].sum()) / k for row in right)
        found |= {f"p_at_{k}": total / n if n else 0.0, f"all_p_at_{k}": total / every}
    found["map"] = float(np.mean([average_precision(row) if row.any() else 0.0 for row in right])) if n else 0.0
    return {**found, "n": n, "all_n": every, "curve": _curves(right, labels), "confusion": _confusion(answers, labels)}


def _curves(right: Sequence[BoolArray], labels: Sequence[str]) -> dict[str, Any]:
    """Of queries that have a right answer."""
    answered = [row for row in right if row.any()]
    if not answered:
        return {"recall": [], "precision": [], "by_class": {}}
    classes = {label: precision_recall(rows)["precision"] for label, rows in by_class(right, labels).items()}
    return precision_recall(answered) | {"by_class": classes}


def _confusion(answers: Sequence[Sequence[str]], labels: Sequence[str]) -> dict[str, Any]:
    """As `ranking.confusion`, of ranges."""
    counted = Counter((label, name) for names, label in zip(answers, labels, strict=True) for name in names[:CONFUSED])
    classes = sorted({name for pair in counted for name in pair} | set(labels))
    return {"classes": classes, "counts": [[counted[row, column] for column in classes] for row in classes]}
