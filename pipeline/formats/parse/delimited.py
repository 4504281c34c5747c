"""Numbers of a table of text whose fields a character parts, some of which may be blank.

Plain numbers are scanned by a kernel; a table with anything else in it is Arrow's, which also says what is wrong.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.names import printable

_ROW: Final = re.compile(r"Row #(\d+): ")
_FIELDS: Final = re.compile(r"Expected (\d+) columns, got (\d+)")
_WORD: Final = re.compile(r"invalid value '([^\n]*)'")
_LONGEST: Final = 80  # characters of a file that are told
_BLOCK_BYTES: Final = 1 << 18  # stays in the processor's cache
_FIELD_BYTES: Final = 64  # a row of so much a field fits a block


def read_columns(
    data: bytes,
    begin: int,
    width: int,
    wanted: Sequence[int],
    *,
    parted_by: str = ",",
    lines_before: int = 0,
    blanks: Sequence[str] = ("",),
    decimal_point: str = ".",
    quoted: bool = False,
) -> Float64Array:
    """[F, C] the numbers of some columns; NaN where a field is blank. Blank lines are left out.

    Args:
        data: of the file.
        begin: the byte at which rows begin.
        width: fields of every row.
        wanted: places of C of them.
        parted_by: what stands between fields.
        lines_before: lines of the file before `begin`, for the line of an error.
        blanks: what a field may hold that is blank; each more than one makes it twice as slow.
        decimal_point: of numbers.
        quoted: whether fields may stand in quotation marks.

    Raises:
        ClipError: with the line, a row that has more or fewer fields, or a wanted one that is no number.
    """
    if decimal_point == "." and (table := _usual_columns(data, begin, width, wanted, parted_by)) is not None:
        return table
    import pyarrow as pa
    from pyarrow import csv

    names = [str(place) for place in range(width)]
    chosen = [names[place] for place in wanted]
    block = max(_BLOCK_BYTES, _FIELD_BYTES * width)
    try:
        table = csv.read_csv(
            pa.BufferReader(memoryview(data)[begin:]),
            read_options=csv.ReadOptions(use_threads=False, column_names=names, block_size=block),
            parse_options=csv.ParseOptions(delimiter=parted_by, quote_char='"' if quoted else False),
            convert_options=csv.ConvertOptions(
                column_types=dict.fromkeys(chosen, pa.float64()),
                include_columns=chosen,
                null_values=list(blanks),
                decimal_point=decimal_point,
            ),
            memory_pool=pa.system_memory_pool(),  # Arrow's own gives pages back at once, which takes as long as reading
        )
    except pa.ArrowInvalid as error:
        raise _told(str(error), lines_before) from error
    return np.column_stack([column.to_numpy() for column in table.columns])


def _usual_columns(data: bytes, begin: int, width: int, wanted: Sequence[int], parted_by: str) -> Float64Array | None:
    """The same of a table of plain numbers and blanks, in half of the time; None where anything in it is unusual."""
    from motionlake.formats.parse.field_kernels import UNUSUAL, scan_fields

    columns = np.full(width, -1)
    columns[list(wanted)] = np.arange(len(wanted))
    if np.count_nonzero(columns >= 0) < len(wanted):  # a column that is wanted twice
        return None
    capacity = min(data.count(b"\n", begin), (len(data) - begin) // width) + 1  # a field has a byte after it
    table = np.empty((capacity, len(wanted)))
    rows = scan_fields(np.frombuffer(data, np.uint8), begin, ord(parted_by), columns, table)
    return None if rows in (UNUSUAL, 0) else table[:rows]


def _told(said: str, before: int) -> ClipError:
    """What Arrow says of a table, in one short line; it counts rows from 1."""
    row = _ROW.search(said)
    line = before + int(row[1]) if row else None
    if fields := _FIELDS.search(said):
        return ClipError(f"the row has {fields[2]} fields, not {fields[1]}", line)
    if word := _WORD.search(said):
        return ClipError(f"{printable(word[1])[:_LONGEST]!r} is no number", line)
    return ClipError(f"is no table: {printable(said.partition(chr(10))[0])[:_LONGEST]}", line)
