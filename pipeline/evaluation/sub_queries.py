"""Retrieval by the sub-queries of long queries (PESTA, section 8.3.3 and Table 4).

Each take is a long query in turn, the other takes are the repository. Windows of 3s symbols, s apart, are its
sub-queries: those of whose frames at least 60 % are of one class. A match is of the class of most of its frames, and
right where that is the sub-query's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.pesta.alignment.long_query import LongQuery
from motionlake.pesta.alignment.matches import Match, best_matches
from motionlake.pesta.alignment.strings import Distances, Repository, SymbolDistances
from motionlake.pesta.config import AlignmentConfig
from motionlake.pesta.symbols import SymbolString

SLIDE: Final = 4  # s
SHARE: Final = 0.6
HITS: Final = 10
Segments = Sequence[tuple[int, int, str]]
# The best matches of symbols [first, last) of a long query.
Search = Callable[[int, int], list[Match]]


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
class SubQueryScores:
    """Share of right matches among the first 2, 5 and 10; a match that was not found is not right.

    Attributes:
        p_at_2, p_at_5, p_at_10: means over the n sub-queries whose class another take shows.
        n: how many these are.
        all_p_at_2, all_p_at_5, all_p_at_10: means over all sub-queries; those of a class that no other take shows
            have 0.
        all_n: how many these are.
    """

    p_at_2: float
    p_at_5: float
    p_at_10: float
    n: int
    all_p_at_2: float
    all_p_at_5: float
    all_p_at_10: float
    all_n: int


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


def sub_queries(take: Take, slide: int = SLIDE, share: float = SHARE) -> list[SubQuery]:
    """The windows of a take that are of one class, in order."""
    found = []
    for first in range(0, len(take.string) - 3 * slide + 1, slide):
        last = first + 3 * slide
        start, stop = int(take.string.starts[first]), int(take.string.stops[last - 1])
        label, of_it = class_of(start, stop, take.segments)
        if label and of_it >= share:
            found.append(SubQuery(first, last, label))
    return found


def fresh_search(
    take: Take, repository: Repository, distances: Distances, config: AlignmentConfig, k: int = HITS
) -> Search:
    """Each sub-query is a query of its own (PESTA)."""
    return lambda first, last: best_matches(take.string.symbols[first:last], repository, distances, k, config)


def shared_search(
    take: Take, repository: Repository, distances: Distances, config: AlignmentConfig, k: int = HITS
) -> Search:
    """Sub-queries share the segments of the long query (PESTA-LQ)."""
    query = LongQuery(take.string.symbols, repository, distances, config)
    return lambda first, last: query.best_matches(first, last, k)


SearchOf = Callable[[Take, Repository, Distances, AlignmentConfig], Search]


@dataclass(frozen=True)
class LongQuestion:
    """One take with its sub-queries, and the takes that are searched, with their strings as a repository."""

    take: Take
    asked: list[SubQuery]
    elsewhere: list[Take]
    repository: Repository


def long_questions(takes: Sequence[Take]) -> list[LongQuestion]:
    """Each take in turn against the others."""
    found = []
    for i, take in enumerate(takes):
        elsewhere = [other for j, other in enumerate(takes) if j != i]
        repository = Repository.of([other.string.symbols for other in elsewhere])
        found.append(LongQuestion(take, sub_queries(take), elsewhere, repository))
    return found


def score_sub_queries(
    questions: Sequence[LongQuestion], distances: Distances, config: AlignmentConfig, search: SearchOf
) -> SubQueryScores:
    """Ask every sub-query, and judge its matches.

    Raises:
        ValueError: no sub-query has a class that another take shows.
    """
    ground, right, shown = SymbolDistances.of(distances), [], []
    for question in questions:
        known = {label for other in question.elsewhere for _, _, label in other.segments}
        ask = search(question.take, question.repository, ground, config)
        for query in question.asked:
            hits = np.zeros(HITS)
            for rank, match in enumerate(ask(query.first, query.last)[:HITS]):
                hits[rank] = _class(question.elsewhere[match.clip], match) == query.label
            right.append([hits[:n].mean() for n in (2, 5, 10)])
            shown.append(query.label in known)
    if not any(shown):
        raise ValueError("no sub-query has a class that another take shows: nothing to retrieve")
    precisions = np.array(right)
    (two, five, ten), (all_two, all_five, all_ten) = precisions[shown].mean(axis=0), precisions.mean(axis=0)
    return SubQueryScores(
        float(two), float(five), float(ten), sum(shown), float(all_two), float(all_five), float(all_ten), len(shown)
    )


def ask_all(questions: Sequence[LongQuestion], distances: Distances, config: AlignmentConfig, search: SearchOf) -> int:
    """Ask every sub-query and forget the answers: what is timed. Returns how many matches there were."""
    ground, found = SymbolDistances.of(distances), 0
    for question in questions:
        ask = search(question.take, question.repository, ground, config)
        found += sum(len(ask(query.first, query.last)) for query in question.asked)
    return found


def _class(take: Take, match: Match) -> str:
    start, stop = int(take.string.starts[match.start]), int(take.string.stops[match.stop - 1])
    return class_of(start, stop, take.segments)[0]
