"""The numbers of a table in Parquet."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.limits_config import limits
from motionlake.formats.parse.table_columns import COLUMNS_A_JOINT

_NUMBERS: Final = frozenset({"FLOAT", "DOUBLE", "INT32", "INT64"})


class ParquetTable:
    """A file's columns, those within structures too ("Hips.x")."""

    def __init__(self, source: bytes | Path) -> None:
        """Read what the file says of its columns.

        Raises:
            ClipError: it is no Parquet, or has more columns than `limits` allow.
        """
        import pyarrow as pa
        from pyarrow import parquet

        try:
            self._file: Any = parquet.ParquetFile(pa.BufferReader(source) if isinstance(source, bytes) else source)
        except (pa.ArrowException, OSError) as error:
            raise ClipError("is damaged: its columns cannot be read as Parquet") from error
        schema = self._file.schema
        limits().check("joints", len(schema) // COLUMNS_A_JOINT, f"has {len(schema)} columns")
        self.names = tuple(schema.column(number).path for number in range(len(schema)))
        self._types = tuple(schema.column(number).physical_type for number in range(len(schema)))

    @property
    def rows(self) -> int:
        """As many as it promises."""
        return int(self._file.metadata.num_rows)

    def read(self, columns: Sequence[int]) -> Float64Array:
        """[F, C] columns of numbers; NaN where there is none.

        Raises:
            ClipError: a column of something else, or one that is damaged.
        """
        import pyarrow as pa

        names = [self.names[column] for column in columns]
        if words := next((self.names[column] for column in columns if self._types[column] not in _NUMBERS), None):
            raise ClipError(f"column {words!r:.40} holds no numbers")
        groups = map(self._file.metadata.row_group, range(self._file.metadata.num_row_groups))
        size = sum(group.column(column).total_uncompressed_size for group in groups for column in columns)
        limits().check_memory(size + 8 * self.rows * len(names))
        try:
            table = self._file.read(columns=names, use_threads=False)
            while any(pa.types.is_struct(kind) for kind in table.schema.types):
                table = table.flatten()
            found = [table[name].cast(pa.float64()).to_numpy() for name in names]
        except (pa.ArrowException, OSError) as error:
            raise ClipError("is damaged: its numbers cannot be read") from error
        return np.array(found).T  # column by column; who takes some of them copies once
