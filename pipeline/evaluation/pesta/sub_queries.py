"""Sub-queries of long queries (section 8.3.3, Table 4).

Each take is a long query in turn, the other takes are the repository. Windows of 3s symbols, s apart, are its
sub-queries: those of whose frames at least 60 % are of one class. A match is of the class of most of its frames, and
right where that is the sub-query's.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from motionlake.evaluation.pesta.measuring import PART_STRIDE, Measuring, Take, class_of
from motionlake.pesta.config import AlignmentConfig
from motionlake.pesta.long_query import LongQuery
from motionlake.pesta.matches import Match, best_matches
from motionlake.pesta.strings import Distances, Repository, SymbolDistances

ROUNDS: Final = 5
SLIDE: Final = 4  # s
SHARE: Final = 0.6
HITS: Final = 10
# The best matches of symbols [first, last) of a long query.
Search = Callable[[int, int], list[Match]]


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
    query.align([(asked.first, asked.last) for asked in question.asked], HITS)
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


def measure_sub_queries(measuring: Measuring) -> dict[str, Any] | None:
    """pesta and pesta_lq: what `score_sub_queries` gives, and seconds; share_of_time of pesta_lq. None where no two
    clips have segments of one class."""
    strings, config = measuring.strings, replace(measuring.alignment("sta", PART_STRIDE), gaps=False)
    questions = long_questions(list(measuring.takes.values()))
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
