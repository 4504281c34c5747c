"""Tandem repeats of any period to one instance (PESTA, section 5.3), in three steps.

1. Of a run of one symbol one symbol stays.
2. The maximal repetitions of the string (`repetitions`) are taken by period, the shortest first, and
   those of one period from left to right. One that overlaps none taken before is reduced: of a repetition of length L
   and period p its first p symbols and its last L mod p stay.
3. What is left, or brought together by step 2, is read from left to right: whenever the string kept so far ends in a
   square xx, its second half goes (`motionlake.pesta.symbols.squares`).

The result holds no square. It is canonical: it depends on which symbols are equal, not on what they are called, and
reducing it again changes nothing.

Examples (what stays):
    abcabcab -> abcab: the first instance and the part of one that is left over.
    aabaab -> ab: nested repeats; abab is left of the runs.
    abacabacd -> abacd, and ababcababc -> abc: inner repeats of shorter period go first (abcabc), then the outer one.
    abcbabcbc -> abcbabc: the overlapping bcbc at the end has a shorter period than abcbabcb at the beginning; after
        it nothing is repeated.

Steps 1 and 2 cost a suffix array (pydivsufsort) and linear time, step 3 O(n log n).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from motionlake.arrays import Int32Array, Int64Array
from motionlake.pesta.symbols.alphabet import ranks
from motionlake.pesta.symbols.repetitions import SHORT, by_period, by_suffixes, suffix_order
from motionlake.pesta.symbols.squares import square_free
from numba import njit
from numpy.typing import NDArray


def reduce_repeats(symbols: NDArray[Any]) -> Int64Array:
    """Which symbols stay when every tandem repeat is reduced to one instance.

    Args:
        symbols: int [n], n may be 0.

    Returns:
        int64 [k] places of the kept symbols, ascending; the first is 0 where n > 0.
    """
    text, alphabet = ranks(symbols)
    if len(text) <= SHORT:
        return np.asarray(_reduced_short(text, alphabet), np.int64)
    runs = first_of_runs(text)
    text = text[runs]
    starts, stops, periods, _ = by_suffixes(text, suffix_order(text, alphabet))
    return np.asarray(runs[_reduced(text, alphabet, starts, stops, periods)], np.int64)


@njit(cache=True)  # type: ignore[untyped-decorator]
def first_of_runs(text: Int32Array) -> Int64Array:
    """Step 1: [k] places that begin a run of one symbol."""
    places = np.empty(len(text), np.int64)
    count = 0
    for place in range(len(text)):
        if place == 0 or text[place] != text[place - 1]:
            places[count] = place
            count += 1
    return places[:count]


@njit(cache=True)  # type: ignore[untyped-decorator]
def without_repetitions(n: int, starts: Int32Array, stops: Int32Array, periods: Int32Array) -> Int32Array:
    """Step 2: [k] places that stay of n. Repetitions come by period, then start."""
    taken = np.zeros(n // 64 + 1, np.uint64)
    every = ~np.uint64(0)
    stays = np.ones(n, np.bool_)
    for each in range(len(starts)):
        start, stop, period = starts[each], stops[each], periods[each]
        first, final = start >> 6, (stop - 1) >> 6
        head = every << np.uint64(start & 63)
        tail = every >> np.uint64(63 - ((stop - 1) & 63))
        if first == final:
            head = tail = head & tail
        free = not (taken[first] & head) and not (taken[final] & tail)
        word = first + 1
        while free and word < final:
            free = taken[word] == 0
            word += 1
        if free:
            taken[first] |= head
            taken[final] |= tail
            taken[first + 1 : final] = every
            stays[start + period : stop - (stop - start) % period] = False
    return np.flatnonzero(stays).astype(np.int32)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _reduced(text: Int32Array, alphabet: int, starts: Int32Array, stops: Int32Array, periods: Int32Array) -> Int64Array:
    if len(starts) == 0:
        return np.arange(len(text))
    first = without_repetitions(len(text), starts, stops, periods)
    second, _ = square_free(text[first], alphabet)
    return np.asarray(first[second], np.int64)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _reduced_short(text: Int32Array, alphabet: int) -> Int64Array:
    runs = first_of_runs(text)
    text = text[runs]
    starts, stops, periods, _ = by_period(text)
    return np.asarray(runs[_reduced(text, alphabet, starts, stops, periods)], np.int64)
