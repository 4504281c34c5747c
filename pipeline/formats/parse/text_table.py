"""A table of joints as text."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import partial
from typing import Final

from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.parse.delimited import read_columns
from motionlake.formats.parse.table_columns import header_of

MISSING: Final = ("", " ", "nan", "NaN", "NAN", "NA", "N/A", "null", "NULL", "None", "none", "-nan", "-NaN")
_FIRST_BYTES: Final = 4096  # of the first row, which tell of commas
_DECIMAL_COMMA: Final = re.compile(r"\d,\d")


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
        header, begin = self._header, 0
        for _ in range(header.rows):
            begin = self._data.find(b"\n", begin) + 1 or len(self._data)
        first = self._data[begin : begin + _FIRST_BYTES].partition(b"\n")[0].decode("latin-1")
        comma = header.delimiter == ";" and bool(_DECIMAL_COMMA.search(first))
        numbers = partial(
            read_columns, self._data, begin, len(header.names), columns, parted_by=header.delimiter,
            lines_before=header.rows, decimal_point="," if comma else ".", quoted=True,
        )  # fmt: skip
        try:
            return numbers()
        except ClipError:  # perhaps a word for what is missing
            return numbers(blanks=MISSING)
