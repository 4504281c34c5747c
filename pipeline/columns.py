"""Columns of Arrow tables and of Parquet files, without what takes long to import."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray


def numbers(column: pa.Array | pa.ChunkedArray) -> NDArray[Any]:
    """[n] a column of numbers, read-only as they lie where they lie in one piece. Raises `ValueError` for a null.

    Not `to_numpy`, which imports pandas where it is installed, and so takes a third of a second at the first call.
    """
    pieces = column.chunks if isinstance(column, pa.ChunkedArray) else [column]
    kind = np.dtype(column.type.to_pandas_dtype())
    found = [_numbers(piece, kind) for piece in pieces]
    if len(found) == 1:
        return found[0]
    return np.concatenate([np.zeros(0, dtype=kind), *found])


def _numbers(piece: pa.Array, kind: np.dtype[Any]) -> NDArray[Any]:
    if piece.null_count:
        raise ValueError(f"{piece.null_count} values of a column are null")
    _, values = piece.buffers()
    first = piece.offset * kind.itemsize
    return np.frombuffer(values, kind, len(piece), first) if len(piece) else np.zeros(0, dtype=kind)


def column_of(values: NDArray[Any]) -> pa.Array:
    """[n] numbers as a column, as they lie. Not `pyarrow.array`, which imports pandas as `to_numpy` does."""
    whole = np.ascontiguousarray(values)
    return pa.Array.from_buffers(pa.from_numpy_dtype(whole.dtype), len(whole), [None, pa.py_buffer(whole)])


def texts(values: Sequence[str]) -> pa.Array:
    """[n] strings as a column; as `column_of`."""
    spelled = [value.encode() for value in values]
    offsets = pa.py_buffer(array("i", accumulate(map(len, spelled), initial=0)))
    return pa.Array.from_buffers(pa.string(), len(spelled), [None, offsets, pa.py_buffer(b"".join(spelled))])


def matrix_of(table: pa.Table, columns: Sequence[str]) -> NDArray[Any]:
    """[rows, columns] some columns of numbers of one type, beside each other. Raises `ValueError` for a null.

    It takes a third of the time of putting them there one after the other.
    """
    batches = table.select(columns).combine_chunks().to_batches()
    if not batches:
        return np.empty((0, len(columns)), np.dtype(table.schema.field(columns[0]).type.to_pandas_dtype()))
    (batch,) = batches
    if nulls := sum(column.null_count for column in batch.columns):
        raise ValueError(f"{nulls} values of columns are null")
    found: NDArray[Any] = batch.to_tensor(row_major=True).to_numpy()
    return found


def read_parquet(path: Path, columns: Sequence[str] | None = None, *, threads: bool = True) -> pa.Table:
    """The rows of a file, of some columns or all; `threads`: on more than one, unless several files are read at a time.

    Not `pyarrow.parquet.read_table`, which imports pyarrow's data sets, and with them pandas.
    """
    with pq.ParquetFile(path) as file:
        found = file.read(columns=columns, use_threads=threads)
    return found if columns is None else found.select(columns)
