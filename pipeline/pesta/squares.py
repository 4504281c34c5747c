"""Reading a string from left to right without squares: an online reduction of tandem repeats in O(n log n).

Whenever the string kept so far ends in a square xx, its second half goes. The kept string is free of squares before
each symbol, therefore at most one square can end with that symbol and there is nothing to choose.

Squares with a period below 32 are read from masks: bit p of the first mask of a symbol says that the symbol p places
before it is the same, bit p of mask k that this holds for 2^k symbols in a row.

Longer ones go by levels: periods from P to 2P - 1, P = 32, 64, …, and blocks of P / 4 symbols at multiples of P / 4.
The second half of such a square holds a block that ends more than P / 4 symbols before the square does, and whose copy
lies one period before it. Once P / 4 symbols have been kept after a block, its copies in reach are listed by the last
places of its first eight symbols; each tells the one length of the kept string at which its square would be complete,
where the square is tested. A string free of squares has at most n / l copies of a piece of l symbols within n symbols,
so that a level costs a few comparisons a symbol.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Int32Array, UInt32Array
from motionlake.kernels import njit

MASKS: Final = 5
FIRST_PERIOD: Final = 1 << MASKS
BLOCK: Final = FIRST_PERIOD // 4
KEY_BITS: Final = 11
MODULUS: Final = np.uint64((1 << 31) - 1)
BASE: Final = np.uint64(1_103_515_245)
KEY_FACTOR: Final = np.uint64(0x9E3779B97F4A7C15)
POWERS: Final = np.array([pow(int(BASE), BLOCK << level, int(MODULUS)) for level in range(28)], dtype=np.uint64)
PERIODS: Final = np.array((0x2, 0xC, 0xF0, 0xFF00, 0xFFFF0000), dtype=np.uint32)


@njit(cache=True)
def square_free(text: Int32Array, alphabet: int) -> tuple[Int32Array, int]:
    """Which symbols stay.

    Args:
        text: int32 [n], symbols from 0 to `alphabet` - 1.
        alphabet: how many symbols there may be.

    Returns:
        int32 [k] places in `text`, ascending, and how many pairs of symbols were compared.
    """
    n = len(text)
    kept, word = np.empty(n, np.int32), np.empty(n, np.int32)
    last, before = np.full(alphabet, -1, np.int32), np.empty(n, np.int32)
    masks = np.zeros((n, MASKS), np.uint32)
    long = n >= 2 * FIRST_PERIOD
    last_gram = np.full(1 << KEY_BITS if long else 0, -1, np.int32)
    gram_before = np.empty(n if long else 0, np.int32)
    sums = np.zeros(n + 1 if long else 0, np.uint32)
    due = np.full(n + 1 if long else 0, -1, np.int32)
    events = np.empty((64, 4), np.int32)  # period, length since when and at which it is due, the event before
    n_due = 0
    done = np.zeros(32, np.int32)
    length = 0
    compared = 0
    for place in range(n):
        symbol = text[place]
        kept[length], word[length], before[length] = place, symbol, last[symbol]
        gone = _short_square(masks, length, length - last[symbol] if last[symbol] >= 0 else FIRST_PERIOD)
        compared += 1
        last[symbol] = length
        length += 1

        if long:
            sums[length] = _modulo(np.uint64(sums[length - 1]) * BASE + np.uint64(symbol))
        if long and length >= BLOCK:
            start = length - BLOCK
            key = _key(sums, start)
            gram_before[start] = last_gram[key]
            last_gram[key] = start
            event = due[length] if gone == 0 else -1
            while event >= 0:
                period = events[event, 0]
                same = 0
                while same < period and word[length - 1 - same] == word[length - 1 - same - period]:
                    same += 1
                compared += same + 1
                if same == period:
                    gone = period
                    break
                event = events[event, 3]

        if gone:
            for position in range(length - 1, length - gone - 1, -1):
                last[word[position]] = before[position]
            if long:
                for start in range(length - BLOCK, max(length - gone - BLOCK, -1), -1):
                    last_gram[_key(sums, start)] = gram_before[start]
                length -= gone
                while n_due and events[n_due - 1, 1] > length:
                    n_due -= 1
                    due[events[n_due, 2]] = events[n_due, 3]
                level = 0
                while level < 32 and done[level]:
                    done[level] = min(done[level], length // (BLOCK << level))
                    level += 1
            else:
                length -= gone
            continue

        level, block = 0, BLOCK
        while long and length % block == 0 and length >= 2 * block:
            start = length - 2 * block
            shortest = 4 * block
            if start // block >= done[level]:
                done[level] = start // block + 1
                fingerprint = _fingerprint(sums, start, level)
                earlier = gram_before[start]
                while earlier >= 0 and start - earlier < 2 * shortest:
                    period = start - earlier
                    compared += 1
                    if period >= shortest and _fingerprint(sums, earlier, level) == fingerprint:
                        left = 0
                        while left < block and left < earlier and word[start - 1 - left] == word[earlier - 1 - left]:
                            left += 1
                        compared += left + 1
                        complete = start - left + period
                        if complete <= n and left < block:
                            if n_due == len(events):
                                events = np.concatenate((events, np.empty_like(events)))
                            events[n_due, 0], events[n_due, 1] = period, start + block
                            events[n_due, 2], events[n_due, 3] = complete, due[complete]
                            due[complete] = n_due
                            n_due += 1
                    earlier = gram_before[earlier]
            level += 1
            block *= 2
    return kept[:length].copy(), compared


@njit(cache=True)
def _short_square(masks: UInt32Array, at: int, distance: int) -> int:
    """The period below 32 of the square that ends with the symbol `at`, or 0.

    Sets the masks of that symbol, whose last place lies `distance` before it.
    """
    mask = np.uint32(0)
    if distance < FIRST_PERIOD:
        mask = np.uint32((masks[at - distance, 0] | np.uint32(1)) << np.uint32(distance))
    masks[at, 0] = mask
    found = np.uint32(mask & PERIODS[0])
    for power in range(1, MASKS):
        step = 1 << (power - 1)
        mask = np.uint32(mask & masks[at - step, power - 1]) if at >= step else np.uint32(0)
        masks[at, power] = mask
        found |= np.uint32(mask & PERIODS[power])
    if found:
        for power in range(MASKS):
            for period in range(1 << power, 2 << power):
                bit = np.uint32(1) << np.uint32(period)
                if found & bit and masks[at - period + (1 << power), power] & bit:
                    return period
    return 0


@njit(cache=True)
def _modulo(number: np.uint64) -> np.uint64:
    """A number (uint64) below 2^62 modulo 2^31 - 1."""
    number = (number & MODULUS) + (number >> np.uint64(31))
    number = (number & MODULUS) + (number >> np.uint64(31))
    return number if number < MODULUS else number - MODULUS


@njit(cache=True)
def _fingerprint(sums: UInt32Array, start: int, level: int) -> np.uint64:
    """Of the block of a level that starts there: equal blocks have the same."""
    left_out = np.uint64(sums[start]) * POWERS[level]
    return np.uint64(_modulo(np.uint64(sums[start + (BLOCK << level)]) + (MODULUS << np.uint64(31)) - left_out))


@njit(cache=True)
def _key(sums: UInt32Array, start: int) -> np.int64:
    """The bucket of the eight symbols from `start` on."""
    return np.int64((_fingerprint(sums, start, 0) * KEY_FACTOR) >> np.uint64(64 - KEY_BITS))
