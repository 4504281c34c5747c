"""The symbols of clips that pictures of alignments show, and which of them a path in frames leads through."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Int64Array, IntArray
from motionlake.lake.strings import LakeStrings
from motionlake.retrieval.hits import Hit
from motionlake.retrieval.string_queries import StringQuery

CONTEXT: Final = 3  # symbols before and after a match
MOST_WHOLE: Final = 30  # symbols of a clip that is shown whole


@dataclass(frozen=True)
class Columns:
    """Symbols, with their frames, and where the next clip begins."""

    symbols: IntArray
    starts: IntArray
    stops: IntArray
    cuts: list[int]

    def part(self, first: int, last: int) -> Columns:
        shown = slice(first, last)
        cuts = [cut - first for cut in self.cuts if first < cut < last]
        return Columns(self.symbols[shown], self.starts[shown], self.stops[shown], cuts)


def of_string(strings: LakeStrings, columns: slice) -> Columns:
    """Symbols of all strings, repeats folded."""
    cuts = [int(cut) - columns.start for cut in strings.repository.offsets if columns.start < cut < columns.stop]
    symbols = strings.repository.symbols[columns]
    return Columns(symbols, strings.starts[columns], strings.stops[columns], cuts)


def path_indices(columns: Columns, query: StringQuery, hit: Hit) -> Int64Array:
    """[L, 2] (symbol of the query, column) of a hit's path, which is in frames.

    Raises:
        ValueError: a hit without its path.
    """
    if not hit.path:
        raise ValueError(f"{hit.clip}: the hit has no path; ask for it")
    rows = _places(query.string.starts, query.string.stops, [step.query for step in hit.path])
    return np.stack([rows, _places(columns.starts, columns.stops, [step.clip for step in hit.path])], axis=1)


def _places(starts: IntArray, stops: IntArray, wanted: Sequence[tuple[int, int]]) -> Int64Array:
    """Where ranges of frames stand, each not before the last: a path never goes back.

    A range that covers further cycles stands where it begins.
    """
    found, place = [], 0
    for start, stop in wanted:
        here = place + np.flatnonzero(starts[place:] == start)
        exact = here[stops[here] == stop]
        place = int(exact[0] if len(exact) else here[-1])
        found.append(place)
    return np.array(found, dtype=np.int64)


def shown(first: int, last: int, columns: Columns) -> tuple[int, int]:
    """Symbols to show around a match [first, last) of a clip: the clip, or some before and after."""
    count = len(columns.symbols)
    if not columns.cuts and count <= MOST_WHOLE:
        return 0, count
    return max(0, first - CONTEXT), max(last, min(count, last + CONTEXT))
