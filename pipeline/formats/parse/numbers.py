"""Bytes to float64 in one pass, correctly rounded, for the number blocks of text formats.

A token is read as mantissa * 10^exponent. Small ones are exact in one multiplication or division; the others
go through the 128-bit product of D. Lemire, "Number Parsing at a Gigabyte per Second" (2021), section 5; what
that leaves undecided (subnormal numbers, more than 19 digits) goes to Python's `float`.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, Int64Array
from motionlake.errors import ClipError
from motionlake.formats.parse.lines import line_of, token_at
from motionlake.kernels import njit
from numpy.typing import NDArray

# UNDECIDED: a number that `scan_number` leaves to Python's `float`.
OK, BAD_NUMBER, SHORT_ROW, LONG_ROW, EXTRA_ROW, UNDECIDED, ABSURD = range(7)
# Python's `float` takes quadratic time: no endless digits.
MAX_DIGITS: Final = 800

_NEWLINE: Final = 10
# Unsigned indices spare the check for negative ones.
ONE: Final = np.uint64(1)
_EXACT_POWERS: Final = np.array([10.0**i for i in range(23)])
_MIN_POWER: Final = -342
_MAX_POWER: Final = 308


def _powers_of_five() -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
    """High and low halves of 5^q for q in [-342, 308], scaled to 128 significant bits (Lemire, section 5)."""
    high, low = [], []
    for q in range(_MIN_POWER, _MAX_POWER + 1):
        power = 5 ** abs(q)
        bits = (power - 1).bit_length()
        scaled = power if q >= 0 else (1 << (bits + 127 if q >= -27 else 2 * bits + 128)) // power + 1
        excess = scaled.bit_length() - 128
        scaled = scaled >> excess if excess >= 0 else scaled << -excess
        high.append(scaled >> 64)
        low.append(scaled & (2**64 - 1))
    return np.array(high, np.uint64), np.array(low, np.uint64)


_FIVE_HIGH, _FIVE_LOW = _powers_of_five()


@njit(cache=True)
def _multiply_wide(a, b):  # type: ignore[no-untyped-def]
    """High and low halves of the 128-bit product of two uint64."""
    mask = np.uint64(0xFFFFFFFF)
    half = np.uint64(32)
    a_high, a_low, b_high, b_low = a >> half, a & mask, b >> half, b & mask
    low = a_low * b_low
    first = a_high * b_low + (low >> half)
    second = a_low * b_high + (first & mask)
    high = a_high * b_high + (first >> half) + (second >> half)
    return high, (second << half) | (low & mask)


@njit(cache=True)
def _decimal_to_float(mantissa, exponent):  # type: ignore[no-untyped-def]
    """(True, value) of mantissa * 10^exponent correctly rounded, or (False, 0.0) where undecided."""
    if exponent < _MIN_POWER or exponent > _MAX_POWER:
        return False, 0.0
    zeros = 0
    scaled = mantissa
    while scaled >> np.uint64(56) == 0:
        scaled <<= np.uint64(8)
        zeros += 8
    while scaled >> np.uint64(63) == 0:
        scaled <<= np.uint64(1)
        zeros += 1
    high, low = _multiply_wide(scaled, _FIVE_HIGH[exponent - _MIN_POWER])
    if high & np.uint64(0x1FF) == np.uint64(0x1FF):
        carry, _ = _multiply_wide(scaled, _FIVE_LOW[exponent - _MIN_POWER])
        low += carry
        if low < carry:
            high += np.uint64(1)
    if low == np.uint64(0xFFFFFFFFFFFFFFFF) and (exponent < -27 or exponent > 55):
        return False, 0.0
    upper = high >> np.uint64(63)
    shift = upper + np.uint64(9)
    binary = high >> shift
    power = ((217706 * exponent) >> 16) + 63 + np.int64(upper) - zeros
    if power < -1021 or power > 1022:
        return False, 0.0
    tie = low <= np.uint64(1) and -4 <= exponent <= 23 and binary & np.uint64(3) == np.uint64(1)
    if tie and binary << shift == high:
        binary -= np.uint64(1)
    binary = (binary + (binary & np.uint64(1))) >> np.uint64(1)
    return True, math.ldexp(np.float64(binary), power - 52)


@njit(cache=True)
def scan_number(data, begin, end, parted_by=32):  # type: ignore[no-untyped-def]
    """Read the number that starts at byte `begin` of `data` (uint8 [n]) and runs up to white space or `end`.

    It may also run up to the byte `parted_by`.

    Returns:
        (status, value, next): OK, BAD_NUMBER or UNDECIDED; the value where OK; the index after the token.
    """
    i, end = np.uint64(begin), np.uint64(end)
    negative = False
    if data[i] == 45 or data[i] == 43:
        negative = data[i] == 45
        i += ONE
    mantissa = np.uint64(0)
    first_digit = i
    while i < end:
        digit = data[i] - np.uint8(48)
        if digit > 9:
            break
        mantissa = mantissa * np.uint64(10) + np.uint64(digit)
        i += ONE
    digits = np.int64(i - first_digit)
    exponent = np.int64(0)
    if i < end and data[i] == 46:
        i += ONE
        first_fraction = i
        while i < end:
            digit = data[i] - np.uint8(48)
            if digit > 9:
                break
            mantissa = mantissa * np.uint64(10) + np.uint64(digit)
            i += ONE
        exponent = -np.int64(i - first_fraction)
        digits -= exponent
    if digits == 0 or digits > MAX_DIGITS:
        return BAD_NUMBER, 0.0, np.int64(i)
    if i < end and (data[i] == 101 or data[i] == 69):
        i += ONE
        negative_exponent = False
        if i < end and (data[i] == 45 or data[i] == 43):
            negative_exponent = data[i] == 45
            i += ONE
        first_exponent = i
        written = np.int64(0)
        while i < end:
            digit = data[i] - np.uint8(48)
            if digit > 9:
                break
            if written < 100_000:
                written = written * 10 + np.int64(digit)
            i += ONE
        if i == first_exponent or np.int64(i - first_exponent) > MAX_DIGITS // 2:
            return BAD_NUMBER, 0.0, np.int64(i)
        exponent += -written if negative_exponent else written
    if i < end and not (data[i] == 32 or 9 <= data[i] <= 13 or data[i] == parted_by):
        return BAD_NUMBER, 0.0, np.int64(i)
    if digits > 19:
        return UNDECIDED, 0.0, np.int64(i)
    if mantissa == 0:
        value = 0.0
    elif mantissa <= np.uint64(9007199254740992) and -22 <= exponent <= 22:
        value = np.float64(mantissa)
        value = value / _EXACT_POWERS[-exponent] if exponent < 0 else value * _EXACT_POWERS[exponent]
    else:
        decided, value = _decimal_to_float(mantissa, exponent)
        if not decided:
            return UNDECIDED, 0.0, np.int64(i)
    return OK, -value if negative else value, np.int64(i)


@njit(cache=True)
def skip_blanks(data, begin, end):  # type: ignore[no-untyped-def]
    """Index of the first byte from `begin` on that is a newline or no white space, or `end`."""
    i, last = np.uint64(begin), np.uint64(end)
    while i < last and (data[i] == 32 or (9 <= data[i] <= 13 and data[i] != _NEWLINE)):
        i += ONE
    return np.int64(i)


@njit(cache=True)
def _scan_table(data, start, table, most, undecided):  # type: ignore[no-untyped-def]
    """Fill `table`, float64 [rows, columns], from the text lines of `data`, uint8 [n]; blank lines are skipped.

    `most`, [columns], are the largest numbers that are no damage. `undecided`, int64 [rows * columns, 2], receives
    (flat index, first byte) of numbers for Python.

    Returns:
        (status, byte where it stopped, rows filled, numbers undecided, values in the last row).
    """
    rows, columns = table.shape
    end = len(data)
    i = start
    row = column = left = 0
    while True:
        i = skip_blanks(data, i, end)
        if i >= end or data[i] == _NEWLINE:
            if column == columns:
                row += 1
            elif column:
                return SHORT_ROW, i, row, left, column
            column = 0
            if i >= end:
                return OK, i, row, left, 0
            i += 1
            continue
        if row == rows:
            return EXTRA_ROW, i, row, left, 0
        if column == columns:
            return LONG_ROW, i, row, left, column
        status, value, stop = scan_number(data, i, end)
        if status == BAD_NUMBER:
            return BAD_NUMBER, i, row, left, column
        if status == UNDECIDED:
            undecided[left, 0] = row * columns + column
            undecided[left, 1] = i
            left += 1
        elif abs(value) > most[column]:
            return ABSURD, i, row, left, column
        table[row, column] = value
        column += 1
        i = stop


def not_finite(data: bytes, offset: int) -> ClipError:
    return ClipError(f"{token_at(data, offset)!r} is not a finite number", line_of(data, offset))


def absurd(data: bytes, offset: int) -> ClipError:
    return ClipError(f"{token_at(data, offset)!r} is absurdly large", line_of(data, offset))


def settle(data: bytes, values: Float64Array, undecided: Int64Array, most: Float64Array | None = None) -> None:
    """Let Python's `float` read the undecided numbers, [n, 2] flat index and first byte, into `values` in place.

    Raises:
        ClipError: a number beyond float64's range, or beyond `most` [values.shape[1]], of its column.
    """
    flat = values.reshape(-1)
    for index, offset in undecided.tolist():
        value = float(data[offset : offset + 2 * MAX_DIGITS].split(maxsplit=1)[0])
        if not math.isfinite(value):
            raise not_finite(data, offset)
        if most is not None and abs(value) > most[index % len(most)]:
            raise absurd(data, offset)
        flat[index] = value


def parse_table(data: bytes, start: int, rows: int, columns: int, most: Float64Array | None = None) -> Float64Array:
    """The `rows` x `columns` numbers that follow byte `start`, one row a line, blank lines aside.

    `most` [columns] are the largest that are no damage.

    Raises:
        ClipError: with the line of a token that is no finite number or an absurd one, or of a row with too few or too
            many values, or where the number of rows is not `rows`.
    """
    most = np.full(columns, np.finfo(float).max) if most is None else most
    # A value takes two bytes with its separator, so a header's wild promise costs no memory.
    capacity = min(rows, (len(data) - start) // (2 * columns) + 1)
    table = np.empty((capacity, columns))
    undecided = np.empty((capacity * columns, 2), np.int64)
    buffer = np.frombuffer(data, np.uint8)
    status, offset, filled, left, values = _scan_table(buffer, start, table, most, undecided)
    if status == BAD_NUMBER:
        raise not_finite(data, offset)
    if status == ABSURD:
        raise absurd(data, offset)
    if status == SHORT_ROW:
        raise ClipError(f"the row has {values} values, not {columns}", line_of(data, offset))
    if status == LONG_ROW:
        raise ClipError(f"the row has more than {columns} values", line_of(data, offset))
    if status == EXTRA_ROW and capacity == rows:
        raise ClipError(f"more rows than the {rows} declared", line_of(data, offset))
    if filled != rows:
        raise ClipError(f"{rows} rows declared, {filled} found: the file is cut short")
    settle(data, table, undecided[:left], most)
    return table
