"""The maximal repetitions of a string, from its suffix array, in linear time.

A repetition is a range of a string with period p that is at least 2p long; it is maximal when one symbol more on
either side breaks the period, and p is its smallest period. By the runs theorem (Bannai et al., SIAM Journal on
Computing 46(5), 2017) a string of n symbols has fewer than n of them, and each holds, for one of the two orders of
the alphabet (smallest or largest symbol first), a longest Lyndon word as long as its period. The longest Lyndon word
that starts at i ends where the next suffix smaller than suffix i starts: a next smaller value of the inverse suffix
array. The end of the string counts as a sentinel, the smallest symbol in the first order and the largest in the
second, so that the second order of the suffixes is the first one reversed and one suffix array serves both.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from motionlake.arrays import Int32Array, UInt8Array
from motionlake.pesta.symbols.alphabet import ranks
from numba import njit
from numpy.typing import NDArray
from pydivsufsort import divsufsort

SHORT: Final = 800
ONE_BYTE: Final = 256


class Repetitions(NamedTuple):
    """Maximal repetitions [starts, stops) with their periods, int32 [r] each, by period and then start.

    `compared` counts the pairs of symbols that were compared to find them.
    """

    starts: Int32Array
    stops: Int32Array
    periods: Int32Array
    compared: int


def maximal_repetitions(symbols: NDArray[Any]) -> Repetitions:
    """All maximal repetitions of a string.

    Args:
        symbols: int [n], n may be 0.

    Returns:
        Each of them once. Renaming the symbols changes nothing.
    """
    text, alphabet = ranks(symbols)
    return Repetitions(*(by_period(text) if len(text) <= SHORT else by_suffixes(text, suffix_order(text, alphabet))))


def suffix_order(text: Int32Array, alphabet: int) -> Int32Array:
    """The inverse suffix array, int32 [n], of `text` (int32 [n], n >= 1, symbols from 0 to `alphabet` - 1).

    The end of the string counts as the smallest symbol. The suffix array is that of bytes: one for each of the most
    frequent symbols, two for the others, so that a string over hundreds of symbols stays short. Any order of the
    alphabet serves; this one is that of the codes.
    """
    if alphabet <= ONE_BYTE:
        return np.asarray(_inverse(divsufsort(text.astype(np.uint8))), np.int32)
    singles = ONE_BYTE - -(-(alphabet - ONE_BYTE) // (ONE_BYTE - 1))
    if singles < 0:
        return np.asarray(_inverse(divsufsort(text)), np.int32)
    by_count = np.argsort(-np.bincount(text, minlength=alphabet), kind="stable")
    names = np.empty(alphabet, np.int32)
    names[by_count] = np.arange(alphabet, dtype=np.int32)
    coded, begins = _in_bytes(text, names, singles)
    return np.asarray(_inverse_of_begins(divsufsort(coded), begins, len(text)), np.int32)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _in_bytes(text: Int32Array, names: Int32Array, singles: int) -> tuple[UInt8Array, Int32Array]:
    """The codes one after another, and for each byte the place of the symbol that begins there, or -1."""
    coded, begins = np.empty(2 * len(text), np.uint8), np.empty(2 * len(text), np.int32)
    size = 0
    for place in range(len(text)):
        name = names[text[place]]
        begins[size] = place
        if name < singles:
            coded[size] = name
            size += 1
        else:
            begins[size + 1] = -1
            coded[size] = singles + ((name - singles) >> 8)
            coded[size + 1] = (name - singles) & 255
            size += 2
    return coded[:size], begins[:size]


@njit(cache=True)  # type: ignore[untyped-decorator]
def _inverse(suffixes: Int32Array) -> Int32Array:
    order = np.empty(len(suffixes), np.int32)
    for rank in range(len(suffixes)):
        order[suffixes[rank]] = rank
    return order


@njit(cache=True)  # type: ignore[untyped-decorator]
def _inverse_of_begins(suffixes: Int32Array, begins: Int32Array, n: int) -> Int32Array:
    order = np.empty(n, np.int32)
    rank = 0
    for suffix in suffixes:
        if begins[suffix] >= 0:
            order[begins[suffix]] = rank
            rank += 1
    return order


@njit(cache=True)  # type: ignore[untyped-decorator]
def by_period(text: Int32Array) -> tuple[Int32Array, Int32Array, Int32Array, int]:
    """The same by trying every period, O(n^2): quicker for the strings of short clips."""
    n = len(text)
    starts, stops, periods = np.empty(n, np.int32), np.empty(n, np.int32), np.empty(n, np.int32)
    count = 0
    longest = np.zeros(n, np.int32)
    for period in range(1, n // 2 + 1):
        start = 0
        for place in range(period, n + 1):
            if place < n and text[place] == text[place - period]:
                continue
            if place - start >= 2 * period and longest[start] < place:
                starts[count], stops[count], periods[count] = start, place, period
                longest[start] = place
                count += 1
            start = place - period + 1
    compared = n * (n // 2)
    return starts[:count].copy(), stops[:count].copy(), periods[:count].copy(), compared


@njit(cache=True)  # type: ignore[untyped-decorator]
def by_suffixes(text: Int32Array, order: Int32Array) -> tuple[Int32Array, Int32Array, Int32Array, int]:
    """The maximal repetitions of `text` from its inverse suffix array `order`, both [n]; see the module's docstring.

    Positions are taken from right to left, so that the next smaller and greater values of the inverse suffix array
    are at hand. Of the repetitions with one period only the last found is remembered: a Lyndon word inside it
    belongs to it and needs no comparing.
    """
    n = len(text)
    smaller, greater = np.empty(n, np.int32), np.empty(n, np.int32)
    first = np.full(n // 2 + 1, n, np.int32)
    counts = np.zeros(n // 2 + 2, np.int32)
    starts, stops, periods = np.empty(n, np.int32), np.empty(n, np.int32), np.empty(n, np.int32)
    count = 0
    compared = 0
    for place in range(n - 1, -1, -1):
        mine = order[place]
        below = place + 1
        while below < n and order[below] > mine:
            below = smaller[below]
        smaller[place] = below
        above = place + 1
        while above < n and order[above] < mine:
            above = greater[above]
        greater[place] = above
        for end in (below, above):
            period = end - place
            if end >= n or 2 * period > n or place >= first[period]:
                continue
            stop = end
            while stop < n and text[stop] == text[stop - period]:
                stop += 1
            compared += stop - end + 1
            need = stop - 2 * period
            start = place
            while start > 0 and text[start - 1] == text[start - 1 + period]:
                start -= 1
            compared += place - start + 1
            if start <= need:
                starts[count], stops[count], periods[count] = start, stop, period
                count += 1
                first[period] = start
                counts[period + 1] += 1
    for period in range(1, len(counts)):
        counts[period] += counts[period - 1]
    sorted_starts, sorted_stops = np.empty(count, np.int32), np.empty(count, np.int32)
    sorted_periods = np.empty(count, np.int32)
    for found in range(count - 1, -1, -1):
        period = periods[found]
        into = counts[period]
        counts[period] += 1
        sorted_starts[into], sorted_stops[into], sorted_periods[into] = starts[found], stops[found], period
    return sorted_starts, sorted_stops, sorted_periods, compared
