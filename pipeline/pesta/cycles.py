"""Where a stretch of a clip's string occurs in the clip: in every cycle of a repeat that was folded (section 5.3).

Strings are aligned with their repeats folded, so that one symbol may stand for many cycles. Where a stretch of the
string occurs is read from the string before folding:

- wherever its symbols stand one after the other, in whichever cycle;
- where a repeat lies inside the stretch, from its first symbol to its last over all cycles between them. It begins as
  late as it can: of a repeat that it begins in, only the last cycle belongs to it.

A repeat at the end of an occurrence may go on: as many further cycles belong to it as the query has itself, so that an
occurrence is as long as what was asked for, where the clip repeats it as often. Occurrences do not overlap, and are
found from left to right.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from motionlake.arrays import BoolArray, Int64Array, IntArray
from motionlake.pesta.symbols import UnfoldedString


@dataclass(frozen=True)
class Occurrence:
    """Symbols [start, stop) of an unfolded string, which stand for a stretch of the folded one.

    Attributes:
        places: int64 [n] where the n symbols of the stretch stand, the first at `start`.
        stop: symbol after the last.
        cycles: how often what repeats in it stands there; 1 where nothing does.
    """

    places: Int64Array
    stop: int
    cycles: int

    @property
    def start(self) -> int:
        return int(self.places[0])

    def frames(self, string: UnfoldedString) -> tuple[int, int]:
        """The frames [start, stop) of the clip."""
        return int(string.starts[self.start]), int(string.stops[self.stop - 1])

    def steps(self, string: UnfoldedString) -> list[tuple[int, int]]:
        """The frames of each symbol of the stretch; those of further cycles belong to the symbol before them."""
        starts = string.starts[self.places]
        stops = np.append(starts[1:], string.stops[self.stop - 1])
        return list(zip(starts.tolist(), stops.tolist(), strict=True))

    def once(self, string: UnfoldedString) -> int:
        """How many frames its symbols have, each counted once: those of one cycle."""
        return int((string.stops[self.places] - string.starts[self.places]).sum())


def occurrences(string: UnfoldedString, first: int, last: int, further: int = 0) -> list[Occurrence]:
    """Where symbols [first, last) of the folded string occur.

    Args:
        string: of the clip.
        first, last: the stretch, one symbol at least.
        further: how many cycles more than one an occurrence may have at its end.

    Returns:
        At least one, from left to right.
    """
    wanted = string.symbols[string.kept[first:last]]
    found = list(_one_after_the_other(string.symbols, wanted, further))
    own = _own(string, first, last)
    if all(own.stop <= other.start or other.stop <= own.start for other in found):
        found.append(own)
    return sorted(found, key=lambda each: each.start)


def whole(string: UnfoldedString) -> Occurrence:
    """The occurrence of the whole folded string that has the most cycles: what a query is."""
    found = occurrences(string, 0, len(string.kept), len(string.symbols))
    return max(found, key=lambda each: each.cycles)


def repeated(string: UnfoldedString) -> BoolArray:
    """[n] which symbols of the folded string stand for further cycles too."""
    found = np.zeros(len(string.symbols), dtype=np.bool_)
    for start, stop in _folded(string):
        found[start - _period(string.symbols, start, stop) : start] = True
    return np.asarray(found[string.kept])


def _one_after_the_other(symbols: IntArray, wanted: IntArray, further: int) -> Iterator[Occurrence]:
    size, stop = len(wanted), 0
    for start in np.flatnonzero(symbols[: len(symbols) - size + 1] == wanted[0]).tolist():
        if start < stop or not np.array_equal(symbols[start : start + size], wanted):
            continue
        stop, cycles = _continued(symbols, start, start + size, further)
        yield Occurrence(np.arange(start, start + size), stop, cycles)


def _continued(symbols: IntArray, start: int, stop: int, further: int) -> tuple[int, int]:
    """The end of [start, stop) with at most so many further cycles, and how many cycles it has then."""
    for period in range(1, stop - start + 1) if further else ():
        cycles = 1
        while cycles <= further and np.array_equal(symbols[stop : stop + period], symbols[stop - period : stop]):
            stop, cycles = stop + period, cycles + 1
        if cycles > 1:
            return stop, cycles
    return stop, 1


def _own(string: UnfoldedString, first: int, last: int) -> Occurrence:
    """The occurrence that the stretch itself stands for, with the repeats that lie inside it."""
    places = string.kept[first:last].copy()
    cycles = 1
    for at in np.flatnonzero(np.diff(places) > 1).tolist():
        start, stop = int(places[at]) + 1, int(places[at + 1])
        later = np.arange(stop - at - 1, stop)
        if later[0] >= 0 and np.array_equal(string.symbols[later], string.symbols[places[: at + 1]]):
            places[: at + 1], cycles = later, 1
        else:
            cycles = max(cycles, 1 + -(-(stop - start) // _period(string.symbols, start, stop)))
    return Occurrence(places, int(places[-1]) + 1, cycles)


def _folded(string: UnfoldedString) -> Iterator[tuple[int, int]]:
    """[start, stop) of the symbols that were folded, each stretch of them."""
    gone = np.diff(string.kept, append=len(string.symbols))
    for at in np.flatnonzero(gone > 1).tolist():
        yield int(string.kept[at]) + 1, int(string.kept[at] + gone[at])


def _period(symbols: IntArray, start: int, stop: int) -> int:
    """How far before them symbols [start, stop), which repeat what stands there, stand first."""
    for period in range(1, start + 1):
        if np.array_equal(symbols[start:stop], symbols[start - period : stop - period]):
            return period
    return start
