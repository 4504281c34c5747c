"""The list of a lake's files that its catalog holds: size, time and hashes of each as it was written."""

from __future__ import annotations

import hashlib
import os
import zlib
from collections.abc import Iterable, Iterator, Mapping
from io import FileIO
from typing import Final, NamedTuple

import pyarrow as pa
from motionlake.lake.catalog import Connection, fetch_table, load_rows, table_of
from motionlake.lake.layout import Lake

FILE_ROWS: Final = pa.schema(
    {"file": pa.string(), "size": pa.int64(), "mtime_ns": pa.int64(), "crc32": pa.uint32(), "sha256": pa.string()}
)
_BLOCK: Final = 1 << 17  # bytes read at a time


class FileSums(NamedTuple):
    """A file as it was written.

    Attributes:
        file: its name relative to the lake.
        size: in bytes.
        mtime_ns: when it was written last.
        crc32: of its bytes, which tells accidents as fast as a disk reads.
        sha256: of its bytes.
    """

    file: str
    size: int
    mtime_ns: int
    crc32: int
    sha256: str


Listed = Mapping[str, FileSums]  # by name relative to the lake


def sums_of(lake: Lake, file: str) -> FileSums:
    """Size and hashes of a file of the lake as it lies there now."""
    crc, sha = 0, hashlib.sha256()
    with lake.path(file).open("rb", buffering=0) as handle:
        for block in blocks(handle):
            crc = zlib.crc32(block, crc)
            sha.update(block)
        found = os.fstat(handle.fileno())
    return FileSums(file, found.st_size, found.st_mtime_ns, crc, sha.hexdigest())


def blocks(handle: FileIO) -> Iterator[memoryview]:
    """What is left of a file, in pieces that stay in the processor's cache."""
    block = memoryview(bytearray(_BLOCK))
    while count := handle.readinto(block):
        yield block[:count]


class ListedFiles(Mapping[str, FileSums]):
    """Files of a catalog by name, kept as columns: of tens of thousands of files a command asks for a few."""

    def __init__(self, table: pa.Table) -> None:
        self._columns = [table[name].combine_chunks() for name in FileSums._fields]
        self._rows = {name: row for row, name in enumerate(self._columns[0].to_pylist())}

    def __getitem__(self, file: str) -> FileSums:
        row = self._rows[file]
        return FileSums(*(column[row].as_py() for column in self._columns))

    def __contains__(self, file: object) -> bool:
        return file in self._rows

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    def touched(self, seen: Iterable[os.stat_result | None]) -> list[FileSums]:
        """Those that are not there, or have another size or time than when they were written; seen: what is known of
        every file now, in the order of their names."""
        sizes, times = (column.to_pylist() for column in self._columns[1:3])
        looks = zip(self._rows, sizes, times, seen, strict=True)
        return [
            self[name]
            for name, size, time, now in looks
            if now is None or now.st_size != size or now.st_mtime_ns != time
        ]


def listed_in(con: Connection) -> ListedFiles:
    """Every file that a catalog lists."""
    return ListedFiles(fetch_table(con, "files"))


def list_files(con: Connection, files: Iterable[FileSums]) -> None:
    """Enter files as they were written just now, within the caller's transaction."""
    load_rows(con, "add_files", table_of([file._asdict() for file in files], FILE_ROWS))
