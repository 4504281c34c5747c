"""Numbers of a table of text whose fields a character parts, some of which may be blank; by Arrow's reader."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.names import printable

_ROW: Final = re.compile(r"Row #(\d+)")
# Blocks that stay in the processor's cache; and one word for what is blank, for each more makes it twice as slow.
_BLOCK_BYTES: Final = 1 << 18
_BLANK: Final = [""]


def read_columns(
    data: bytes, begin: int, width: int, wanted: Sequence[int], *, parted_by: str = ",", lines_before: int = 0
) -> Float64Array:
    """[F, C] the numbers of some columns; NaN where a field is blank. Blank lines are left out.

    Args:
        data: of the file.
        begin: the byte at which rows begin.
        width: fields of every row.
        wanted: places of C of them.
        parted_by: what stands between fields.
        lines_before: lines of the file before `begin`, for the line of an error.

    Raises:
        ClipError: a row has more or fewer fields, or a wanted one is no number.
    """
    import pyarrow as pa
    from pyarrow import csv

    names = [str(place) for place in range(width)]
    chosen = [names[place] for place in wanted]
    try:
        table = csv.read_csv(
            pa.BufferReader(memoryview(data)[begin:]),
            read_options=csv.ReadOptions(use_threads=False, column_names=names, block_size=_BLOCK_BYTES),
            parse_options=csv.ParseOptions(delimiter=parted_by, quote_char=False),
            convert_options=csv.ConvertOptions(
                column_types=dict.fromkeys(chosen, pa.float64()), include_columns=chosen, null_values=_BLANK
            ),
            memory_pool=pa.system_memory_pool(),  # Arrow's own gives pages back at once, which takes as long as reading
        )
    except pa.ArrowInvalid as error:
        raise ClipError(*_reason(str(error), lines_before)) from error
    return np.column_stack([column.to_numpy() for column in table.columns])


def _reason(said: str, before: int) -> tuple[str, int | None]:
    """What the parser says of a row, in one line, and the line of the file."""
    row = _ROW.search(said)
    told = said.split(": ", 2)[-1] if row else said
    return f"a row is damaged: {printable(' '.join(told.split()))[:100]}", before + int(row[1]) if row else None
