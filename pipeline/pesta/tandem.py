"""Tandem repeats of a string of symbols, reduced to one instance (PESTA, section 5.3).

They are reduced in three steps:

1. Of a run of one symbol one symbol stays.
2. The maximal repetitions of the string are taken by period, the shortest first, and those of one period from left to
   right. One that overlaps none taken before is reduced: of a repetition of length L and period p its first p symbols
   and its last L mod p stay.
3. The result, in which step 2 may have brought other repeats together, is read from left to right: whenever the string
   kept so far ends in a square xx, its second half goes (`motionlake.pesta.squares`).

The result holds no square. It is canonical: it depends on which symbols are equal, not on what they are called, and
reducing it again changes nothing.

Examples (what stays):
    abcabcab -> abcab: the first instance and the part of one that is left over.
    aabaab -> ab: nested repeats; the runs make it abab.
    abacabacd -> abacd, and ababcababc -> abc: inner repeats of shorter period go first (abcabc), then the outer one.
    abcbabcbc -> abcbabc: the overlapping bcbc at the end has a shorter period than abcbabcb at the beginning; after
        it nothing is repeated.

Steps 1 and 2 cost a suffix array (pydivsufsort) and linear time, step 3 O(n log n).

A repetition is a range of a string with period p that is at least 2p long; it is maximal when one symbol more on
either side breaks the period, and p is its smallest period. By the runs theorem (Bannai et al., SIAM Journal on
Computing 46(5), 2017) a string of n symbols has fewer than n of them, and each holds, for one of the two orders of
the alphabet (smallest or largest symbol first), a longest Lyndon word as long as its period. The longest Lyndon word
that starts at i ends where the next suffix smaller than suffix i starts: a next smaller value of the inverse suffix
array. The end of the string counts as a sentinel, the smallest symbol in the first order and the largest in the
second, so that the second order of the suffixes is the first one reversed and one suffix array serves both.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Int32Array, Int64Array, IntArray, UInt8Array
from motionlake.kernels import njit
from motionlake.pesta.squares import square_free

SHORT: Final = 800  # symbols, up to which trying every period is quicker
ONE_BYTE: Final = 256
LARGEST_TABLE: Final = 1 << 16


def suffix_order(text: Int32Array, alphabet: int) -> Int32Array:
    """The inverse suffix array, int32 [n], of `text` (int32 [n], n >= 1, symbols from 0 to `alphabet` - 1).

    The end of the string counts as the smallest symbol. The suffix array is that of bytes: one for each of the most
    frequent symbols, two for the others, so that a string over hundreds of symbols stays short. Any order of the
    alphabet serves; this one is that of the codes.
    """
    if alphabet <= ONE_BYTE:
        return np.asarray(_inverse(_suffix_array(text.astype(np.uint8))), np.int32)
    singles = ONE_BYTE - -(-(alphabet - ONE_BYTE) // (ONE_BYTE - 1))
    if singles < 0:
        return np.asarray(_inverse(_suffix_array(text)), np.int32)
    by_count = np.argsort(-np.bincount(text, minlength=alphabet), kind="stable")
    names = np.empty(alphabet, np.int32)
    names[by_count] = np.arange(alphabet, dtype=np.int32)
    coded, begins = _in_bytes(text, names, singles)
    return np.asarray(_inverse_of_begins(_suffix_array(coded), begins, len(text)), np.int32)


def _suffix_array(text: Int32Array | UInt8Array) -> Int32Array:
    from pydivsufsort import divsufsort  # it takes a moment to import

    return np.asarray(divsufsort(text))


@njit(cache=True)
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


@njit(cache=True)
def _inverse(suffixes: Int32Array) -> Int32Array:
    order = np.empty(len(suffixes), np.int32)
    for rank in range(len(suffixes)):
        order[suffixes[rank]] = rank
    return order


@njit(cache=True)
def _inverse_of_begins(suffixes: Int32Array, begins: Int32Array, n: int) -> Int32Array:
    order = np.empty(n, np.int32)
    rank = 0
    for suffix in suffixes:
        if begins[suffix] >= 0:
            order[begins[suffix]] = rank
            rank += 1
    return order


@njit(cache=True)
def by_period(text: Int32Array) -> tuple[Int32Array, Int32Array, Int32Array, int]:
    """Starts, stops and periods, int32 [r] each, of the maximal repetitions of `text`, by period and then start.

    Tries every period, O(n^2). The last number counts the pairs of symbols that were compared.
    """
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


@njit(cache=True)
def by_suffixes(text: Int32Array, order: Int32Array) -> tuple[Int32Array, Int32Array, Int32Array, int]:
    """As `by_period`, from the inverse suffix array `order` [n] of `text` [n]; see the module's docstring.

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


def reduce_repeats(symbols: IntArray) -> Int64Array:
    """Which symbols stay when every tandem repeat is reduced to one instance.

    Args:
        symbols: int [n], n may be 0.

    Returns:
        int64 [k] places of the kept symbols, ascending; the first is 0 where n > 0.
    """
    text, alphabet = ranks(symbols)
    if len(text) <= SHORT:
        return np.asarray(_reduced_short(text, alphabet), np.int64)
    runs = reduce_runs(text)
    text = text[runs]
    starts, stops, periods, _ = by_suffixes(text, suffix_order(text, alphabet))
    return np.asarray(runs[_reduced(text, alphabet, starts, stops, periods)], np.int64)


@njit(cache=True)
def reduce_runs(symbols: IntArray) -> Int64Array:
    """Step 1: int64 [k] places of the first symbols of all runs of `symbols` (int [n]), ascending."""
    places = np.empty(len(symbols), np.int64)
    count = 0
    for place in range(len(symbols)):
        if place == 0 or symbols[place] != symbols[place - 1]:
            places[count] = place
            count += 1
    return places[:count]


@njit(cache=True)
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


@njit(cache=True)
def _reduced(text: Int32Array, alphabet: int, starts: Int32Array, stops: Int32Array, periods: Int32Array) -> Int64Array:
    if len(starts) == 0:
        return np.arange(len(text))
    first = without_repetitions(len(text), starts, stops, periods)
    second, _ = square_free(text[first], alphabet)
    return np.asarray(first[second], np.int64)


@njit(cache=True)
def _reduced_short(text: Int32Array, alphabet: int) -> Int64Array:
    runs = reduce_runs(text)
    text = text[runs]
    starts, stops, periods, _ = by_period(text)
    return np.asarray(runs[_reduced(text, alphabet, starts, stops, periods)], np.int64)


def ranks(symbols: IntArray) -> tuple[Int32Array, int]:
    """A string over small symbols: int32 [n] from 0 on, in the order of the old symbols, and how many there may be.

    Symbols that are already small and not negative are left as they are.
    """
    if len(symbols) == 0:
        return np.empty(0, np.int32), 0
    low, high = int(symbols.min()), int(symbols.max())
    if low >= 0 and high < 256:
        return np.ascontiguousarray(symbols, dtype=np.int32), high + 1
    if high - low < max(LARGEST_TABLE, 2 * len(symbols)):
        if low >= 0 and high < LARGEST_TABLE and len(symbols) < 1024:
            return np.ascontiguousarray(symbols, dtype=np.int32), high + 1
        shifted = np.asarray(symbols - low)
        present = np.zeros(high - low + 1, dtype=np.bool_)
        present[shifted] = True
        names = np.cumsum(present, dtype=np.int32) - np.int32(1)
        return np.asarray(names[shifted], dtype=np.int32), int(names[-1]) + 1
    values, inverse = np.unique(symbols, return_inverse=True)
    return inverse.astype(np.int32), len(values)
