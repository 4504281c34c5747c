"""Kernel of `delimited`: numbers between delimiters, one pass; what is unusual it leaves to Arrow's reader."""

from __future__ import annotations

import math

import numpy as np
from motionlake.formats.parse.numbers import OK, ONE, scan_number
from motionlake.kernels import njit

UNUSUAL = -1


@njit(cache=True)
def scan_fields(data, begin, parted_by, columns, table):  # type: ignore[no-untyped-def]
    """Fill `table`, float64 [capacity, C], from the lines of `data`, uint8 [n], from byte `begin` on.

    A blank field is NaN; blank lines are left out.

    Args:
        parted_by: the byte between fields.
        columns: [width] for each field the column of `table` that it goes to, or -1.

    Returns:
        How many rows there are, or UNUSUAL: a row of another width, what is no plain number, a quotation mark.
    """
    width, capacity = len(columns), len(table)
    i, end = np.uint64(begin), np.uint64(len(data))
    row = 0
    while i < end:
        if data[i] == 10:
            i += ONE
            continue
        if data[i] == 13 and i + ONE < end and data[i + ONE] == 10:
            i += np.uint64(2)
            continue
        if row == capacity:
            return UNUSUAL
        for field in range(width):
            column = columns[field]
            if column < 0:
                while i < end and data[i] != parted_by and data[i] != 10 and data[i] != 13:
                    if data[i] == 34:
                        return UNUSUAL
                    i += ONE
            else:
                first = i
                while i < end and data[i] == 32:
                    i += ONE
                if i >= end or data[i] == parted_by or data[i] == 10 or data[i] == 13:
                    if i > first:
                        return UNUSUAL
                    table[row, column] = math.nan
                else:
                    status, value, stop = scan_number(data, i, end, parted_by)
                    if status != OK:
                        return UNUSUAL
                    table[row, column] = value
                    i = np.uint64(stop)
                    while i < end and data[i] == 32:
                        i += ONE
            if field < width - 1:
                if i >= end or data[i] != parted_by:
                    return UNUSUAL
                i += ONE
        if i < end and data[i] == 13:
            i += ONE
            if i >= end or data[i] != 10:
                return UNUSUAL
        if i < end:
            if data[i] != 10:
                return UNUSUAL
            i += ONE
        row += 1
    return np.int64(row)
