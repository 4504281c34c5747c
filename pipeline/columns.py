"""Columns of Arrow tables and of Parquet files, without what takes long to import."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray


def numbers(column: pa.Array | pa.ChunkedArray) -> NDArray[Any]:
    """[n] a column of numbers without nulls, as they lie where they lie in one piece.

    Not `to_numpy`, which imports pandas where it is installed, and so takes a third of a second at the first call.
    """
    pieces = column.chunks if isinstance(column, pa.ChunkedArray) else [column]
    found = [np.from_dlpack(piece) for piece in pieces]
    if len(found) == 1:
        return found[0]
    return np.concatenate(found) if found else np.zeros(0, dtype=column.type.to_pandas_dtype())


def read_parquet(path: Path, columns: Sequence[str] | None = None) -> pa.Table:
    """The rows of a file, of some columns or all.

    Not `pyarrow.parquet.read_table`, which imports pyarrow's data sets, and with them pandas.
    """
    with pq.ParquetFile(path) as file:
        found = file.read(columns=columns)
    return found if columns is None else found.select(columns)
