"""The numbers of a table as text, by pyarrow."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.parse.table_columns import header_of
from motionlake.names import printable

BLOCK_BYTES: Final = 2**24  # the longest row is shorter
MISSING: Final = ("", " ", "nan", "NaN", "NAN", "NA", "N/A", "null", "NULL", "None", "none", "-nan", "-NaN")
_DECIMAL_COMMA: Final = re.compile(r"\d,\d")
_ROW: Final = re.compile(r"Row #(\d+): ")
_FIELDS: Final = re.compile(r"Expected (\d+) columns, got (\d+)")
_WORD: Final = re.compile(r"invalid value '([^\n]*)'")
_LONGEST: Final = 80  # characters of a file that are told


class TextTable:
    """A table below a header of one line or two."""

    def __init__(self, data: bytes) -> None:
        """Raises `ClipError` for more columns than `limits` allow."""
        self._data, self._header = data, header_of(data)
        self.names = self._header.names

    @property
    def rows(self) -> int:
        """Rows below the header; blank ones count."""
        return self._data.count(b"\n") + (not self._data.endswith(b"\n")) - self._header.rows

    def read(self, columns: Sequence[int]) -> Float64Array:
        """[F, C] the chosen columns; NaN where a field is blank.

        Raises:
            ClipError: with the line, a row that has not as many fields as the header, or what is no number.
        """
        import pyarrow as pa
        from pyarrow import csv

        header = self._header
        names = [str(number) for number in range(len(header.names))]
        chosen = [names[column] for column in columns]
        first = b"".join(self._data.split(b"\n", header.rows + 1)[header.rows : header.rows + 1]).decode("latin-1")
        comma = header.delimiter == ";" and bool(_DECIMAL_COMMA.search(first))
        try:
            table = csv.read_csv(
                pa.BufferReader(self._data),
                read_options=csv.ReadOptions(
                    use_threads=False, column_names=names, skip_rows=header.rows, block_size=BLOCK_BYTES
                ),
                parse_options=csv.ParseOptions(delimiter=header.delimiter),
                convert_options=csv.ConvertOptions(
                    column_types=dict.fromkeys(chosen, pa.float64()),
                    include_columns=chosen,
                    null_values=list(MISSING),
                    decimal_point="," if comma else ".",
                ),
            )
        except pa.ArrowInvalid as error:
            raise _told(str(error)) from error
        return np.column_stack([table[name].to_numpy() for name in chosen])


def _told(said: str) -> ClipError:
    """What pyarrow says of a table, in one short line; it counts all rows of the file from 1."""
    row = _ROW.search(said)
    line = int(row[1]) if row else None
    if fields := _FIELDS.search(said):
        return ClipError(f"the row has {fields[2]} fields, not {fields[1]}", line)
    if word := _WORD.search(said):
        return ClipError(f"{printable(word[1])[:_LONGEST]!r} is no number", line)
    return ClipError(f"is no table: {printable(said.partition(chr(10))[0])[:_LONGEST]}", line)
