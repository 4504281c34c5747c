"""Parquet parts: written under a temporary name, synced, renamed, and checked by their footer."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

ROW_GROUP = 16_384  # rows a writer holds, and who wants a clip reads; DuckDB reads a group a thread


def sync_folder(folder: Path) -> None:
    """Make renames in a folder survive a power cut."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary path beside `path` that takes its place, synced, when the block ends well."""
    path.parent.mkdir(parents=True, exist_ok=True)
    name = os.fsdecode(os.fsencode(path.name)[:200])  # a name may be as long as names can be
    temporary = path.with_name(f".{name}.{uuid.uuid4().hex[:12]}.tmp")
    try:
        yield temporary
        with temporary.open("rb") as handle:
            os.fsync(handle.fileno())
        temporary.replace(path)
        sync_folder(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


class PartWriter:
    """One Parquet part written row group by row group, so that memory holds one group.

    Floats are byte-stream-split, everything is zstd at its fastest. Rows must come sorted.
    """

    def __init__(self, path: Path, schema: pa.Schema, metadata: Mapping[str, str]) -> None:
        floats = [f.name for f in schema if pa.types.is_floating(f.type)]
        self._writer = pq.ParquetWriter(
            path,
            schema.with_metadata({k.encode(): v.encode() for k, v in metadata.items()}),
            compression="zstd",
            compression_level=1,
            use_dictionary=[f.name for f in schema if pa.types.is_string(f.type)],
            use_byte_stream_split=floats,
            write_statistics=[f.name for f in schema if f.name not in floats],
            version="2.6",
            write_page_checksum=True,
        )
        self._pending: list[pa.Table] = []
        self._pending_rows = 0
        self.rows = 0

    def append(self, table: pa.Table) -> None:
        self._pending.append(table)
        self._pending_rows += table.num_rows
        self.rows += table.num_rows
        if self._pending_rows >= ROW_GROUP:
            self._flush()

    def _flush(self) -> None:
        if self._pending:
            self._writer.write_table(pa.concat_tables(self._pending), row_group_size=ROW_GROUP)
            self._pending, self._pending_rows = [], 0

    def close(self, metadata: Mapping[str, str] | None = None) -> None:
        """Write what is left, and more keys of the footer."""
        self._flush()
        self._writer.add_key_value_metadata(dict(metadata or {}))
        self._writer.close()


def write_part(path: Path, table: pa.Table, metadata: Mapping[str, str]) -> int:
    """Write one table as a part, atomically; returns its size in bytes."""
    with replacing(path) as temporary:
        writer = PartWriter(temporary, table.schema, metadata)
        writer.append(table)
        writer.close()
    return check_part(path, table.num_rows)


def check_part(path: Path, rows: int) -> int:
    """Read a part's footer back; returns its size in bytes. Raises `OSError` if it is not whole."""
    try:
        found = pq.read_metadata(path).num_rows
    except pa.ArrowInvalid as error:
        raise OSError(f"{path}: damaged part: {error}") from error
    if found != rows:
        raise OSError(f"{path}: {found} rows where {rows} were written")
    return path.stat().st_size
