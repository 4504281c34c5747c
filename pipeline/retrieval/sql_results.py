"""Rows that SQL answers, written into a file as they come."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

import pyarrow as pa
from motionlake.errors import UserError
from motionlake.lake.parts import replacing


def check_results_file(path: Path) -> None:
    """Before the query runs: can its rows be written there? Raises `UserError` if not."""
    if path.suffix not in _WRITERS:
        raise UserError(f"{path}: rows are written as {', '.join(_WRITERS)}")
    if not path.absolute().parent.is_dir():
        raise UserError(f"{path}: there is no folder {path.absolute().parent}")


def write_results(rows: pa.RecordBatchReader, path: Path) -> int:
    """Write rows into a file by its suffix, the whole file or none; how many they are.

    JSON is one object a line. Raises `UserError` as `check_results_file` does.
    """
    check_results_file(path)
    with replacing(path) as temporary:
        return _WRITERS[path.suffix](rows, temporary)


def _parquet(rows: pa.RecordBatchReader, path: Path) -> int:
    import pyarrow.parquet as pq

    count = 0
    with pq.ParquetWriter(path, rows.schema, compression="zstd") as writer:
        for batch in rows:
            writer.write_batch(batch)
            count += batch.num_rows
    return count


def _csv(rows: pa.RecordBatchReader, path: Path) -> int:
    import csv

    count = 0
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(rows.schema.names)
        for batch in rows:
            writer.writerows(zip(*(column.to_pylist() for column in batch.columns), strict=True))
            count += batch.num_rows
    return count


def _json(rows: pa.RecordBatchReader, path: Path) -> int:
    import json

    count = 0
    with path.open("w", encoding="utf-8") as file:
        for batch in rows:
            for row in batch.to_pylist():
                file.write(json.dumps(row, ensure_ascii=False, default=str) + "\n")
            count += batch.num_rows
    return count


_WRITERS: Final[Mapping[str, Callable[[pa.RecordBatchReader, Path], int]]] = {
    ".parquet": _parquet,
    ".csv": _csv,
    ".json": _json,
}
