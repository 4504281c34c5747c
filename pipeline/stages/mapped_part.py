"""Parts that a search maps into memory: Arrow files of one batch, of which a few clips are read without all others.

To open one takes much less time than a Parquet part, and some search opens sixty for each query. What it reads of each
is little, so the rows of each clip have a checksum of their own beside that of the whole file.
"""

from __future__ import annotations

import time
import zlib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from mmap import ACCESS_READ, MADV_RANDOM, MADV_WILLNEED, PAGESIZE, mmap
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np
import pyarrow as pa
from motionlake.columns import column_of, numbers
from motionlake.errors import DamagedError
from motionlake.lake.integrity import OTHER_BYTES, damage, sized_files, sound
from motionlake.lake.layout import Lake
from motionlake.lake.merging import Order
from motionlake.lake.parts import replacing
from motionlake.stages.stage import PartStage, Shard, ShardResult
from numpy.typing import NDArray

CLIP: Final = pa.field("clip", pa.dictionary(pa.int32(), pa.string()))  # the first column
SUMS: Final = "sums"  # of its metadata: in hexadecimal, those of `MappedPart.sum_of`, four bytes a clip, in order
KEPT: Final = np.dtype("<u4")
HEAD: Final = 1 << 16  # bytes at the beginning of a part: its schema, names of clips, and whose each row is
FOOT: Final = 1 << 13  # bytes at its end: where all that lies
TOGETHER: Final = 64  # parts that are mapped at a time
Found = TypeVar("Found")


class MappedStage(PartStage):
    """A stage whose parts are mapped; the first column is "clip", which `rows` may spell as strings."""

    def file(self, key: str) -> str:
        return f"{self.folder}/{key[:16]}.arrow"

    def run(self, root: Path, shard: Shard, /) -> ShardResult:
        started = time.perf_counter()
        lake, file = Lake(root), self.file(shard.key)
        tables = list(self.rows(lake, shard))
        if not tables:
            raise ValueError(f"part {shard.part} holds no clip of the lake")
        size = write_mapped(lake.path(file), pa.concat_tables(map(_spelled, tables)), shard.key)
        rows = sum(self.count(table, shard) for table in tables)
        return ShardResult(shard, rows, size, (file,), time.perf_counter() - started)

    def merge(self, parts: Mapping[str, Path], order: Order, target: Path, part: str, key: str) -> None:
        own = {name: MappedPart.open(path) for name, path in parts.items()}
        rows = [own[name].of(clip) for clip, name in order if name in own and clip in own[name].runs]
        none = [part.table.slice(0, 0) for part in own.values()]  # where no clip has rows
        write_mapped(target, pa.concat_tables([*none, *rows]), key)


@dataclass(frozen=True)
class MappedPart:
    """A part, mapped into memory.

    Attributes:
        table: its rows, clip by clip, in one batch.
        runs: the rows of each clip.
    """

    table: pa.Table
    runs: Mapping[str, slice]

    @staticmethod
    def open(path: Path) -> MappedPart:
        return MappedPart.of_table(pa.ipc.open_file(pa.memory_map(str(path))).read_all())

    @staticmethod
    def of_table(table: pa.Table) -> MappedPart:
        """Of rows in one batch."""
        return MappedPart(table, _runs(table["clip"].chunk(0)) if table.num_rows else {})

    def of(self, clip: str) -> pa.Table:
        """The rows of a clip."""
        run = self.runs[clip]
        return self.table.slice(run.start, run.stop - run.start)

    def sum_of(self, clip: str) -> int:
        """The CRC-32 of the name of a clip and its rows, one column after another."""
        run, found = self.runs[clip], zlib.crc32(clip.encode())
        for rows in self.numbers:
            found = zlib.crc32(rows[run].view(np.uint8).data, found)
        return found

    @cached_property
    def sums(self) -> Mapping[str, int] | None:
        """Of each clip what `sum_of` gave when the part was written; None in parts of earlier versions."""
        said = (self.table.schema.metadata or {}).get(SUMS.encode())
        if said is None:
            return None
        return dict(zip(self.runs, np.frombuffer(bytes.fromhex(said.decode()), KEPT).tolist(), strict=True))

    @cached_property
    def numbers(self) -> list[NDArray[Any]]:
        """Every column but that of clips."""
        return [self.column(name) for name in self.table.column_names[1:]]

    def column(self, name: str) -> NDArray[Any]:
        """[n] or [n, d] a column of numbers, or of lists of d of them, read-only as it lies in the file."""
        kind, width = self.table.schema.field(name).type, 0
        if pa.types.is_fixed_size_list(kind):
            kind, width = kind.value_type, kind.list_size
        if not self.table.num_rows:
            found = np.zeros(0, dtype=kind.to_pandas_dtype())
        else:
            chunk = self.table[name].chunk(0)
            found = numbers(chunk.flatten() if width else chunk)
        return found.reshape(-1, width) if width else found


def write_mapped(path: Path, table: pa.Table, key: str) -> int:
    """Write a part, all of it as one batch; returns its bytes."""
    clips = table["clip"].cast(pa.string()).combine_chunks().dictionary_encode()  # of these rows alone
    whole = table.set_column(0, CLIP, clips).combine_chunks()
    part = MappedPart.of_table(whole)
    sums = np.array([part.sum_of(clip) for clip in part.runs], dtype=KEPT)
    whole = whole.replace_schema_metadata({"key": key, SUMS: sums.tobytes().hex()})
    with replacing(path) as temporary, pa.ipc.new_file(str(temporary), whole.schema) as writer:
        writer.write_table(whole)
    return path.stat().st_size


def lists_of(matrix: NDArray[Any]) -> pa.Array:
    """The rows of a matrix [n, d] as a column of lists."""
    return pa.FixedSizeListArray.from_arrays(column_of(matrix.ravel()), matrix.shape[1])


def read_rows(path: Path, name: str) -> Iterator[tuple[str, NDArray[Any]]]:
    """(clip, [n] or [n, d]) a column of every clip of a part, in order; copied, as `rows_of_clips` does."""
    part = MappedPart.open(path)
    rows = part.column(name)
    yield from ((clip, rows[run].copy()) for clip, run in part.runs.items())


def rows_of_clips(lake: Lake, wanted: Mapping[str, Collection[str]], name: str) -> dict[str, NDArray[Any]]:
    """By clip, [n] or [n, d] a column of some clips of parts, given clips by file; without those that a file lacks.

    Of each file the rows of these clips alone are read, compared with what was written, and copied: who holds those of
    many parts need not keep these mapped.

    Raises:
        DamagedError: the rows of a clip are not as they were written, or a file has another size.
    """
    found: dict[str, NDArray[Any]] = {}
    asked = list(zip(wanted.items(), sized_files(lake, wanted), strict=True))
    for first in range(0, len(asked), TOGETHER):
        some = [
            (file, clips, _or_said(lake, file, partial(SparsePart.open, path)))
            for (file, clips), path in asked[first : first + TOGETHER]
        ]
        held = [_or_said(lake, file, partial(part.expect, clips)) for file, clips, part in some]
        for (file, clips, part), own in zip(some, held, strict=True):
            found.update(_or_said(lake, file, partial(_rows_of, lake, file, part.mapped, own, name)))
            if part.mapped.sums is None or len(own) < len(clips):  # a damaged name is that of no clip
                sound(lake, file)
    return found


@dataclass(frozen=True)
class SparsePart:
    """A part of which a few clips are read: the system reads their pages, and none beside them.

    What is needed next is asked for before it is looked at, so that a disk works for several parts at once.
    """

    pages: mmap

    @staticmethod
    def open(path: Path) -> SparsePart:
        """Map a part, and have its ends read, where it says what it holds."""
        with path.open("rb") as handle:
            pages = mmap(handle.fileno(), 0, access=ACCESS_READ)
        pages.madvise(MADV_RANDOM)
        last = max(0, len(pages) - FOOT) // PAGESIZE * PAGESIZE
        pages.madvise(MADV_WILLNEED, 0, min(HEAD, len(pages)))
        pages.madvise(MADV_WILLNEED, last, len(pages) - last)
        return SparsePart(pages)

    @cached_property
    def mapped(self) -> MappedPart:
        """Its rows."""
        table = pa.ipc.open_file(pa.BufferReader(self._whole)).read_all()
        table.validate()
        return MappedPart.of_table(table)

    @cached_property
    def _whole(self) -> pa.Buffer:
        return pa.py_buffer(self.pages)

    def expect(self, clips: Collection[str]) -> list[str]:
        """Have the rows of some clips read; returns those that the part holds."""
        part = self.mapped
        held = [clip for clip in clips if clip in part.runs]
        for clip in held:
            for rows in part.numbers:
                own = rows[part.runs[clip]]
                start = own.ctypes.data - self._whole.address
                first = start // PAGESIZE * PAGESIZE
                if own.nbytes:
                    self.pages.madvise(MADV_WILLNEED, first, start + own.nbytes - first)
        return held


def _rows_of(lake: Lake, file: str, part: MappedPart, clips: Sequence[str], name: str) -> dict[str, NDArray[Any]]:
    rows, sums = part.column(name), part.sums
    if sums is not None and any(part.sum_of(clip) != sums[clip] for clip in clips):
        raise DamagedError(damage(lake, file, OTHER_BYTES))
    return {clip: rows[part.runs[clip]].copy() for clip in clips}


def _or_said(lake: Lake, file: str, work: Callable[[], Found]) -> Found:
    """What some work on a part gives; where it fails, and the part is damaged, that is said."""
    try:
        return work()
    except Exception:  # a damaged schema fails in many ways
        sound(lake, file)
        raise


def _spelled(rows: pa.Table) -> pa.Table:
    return rows.set_column(0, CLIP, rows["clip"].cast(pa.string()).dictionary_encode())


def _runs(clips: pa.DictionaryArray) -> dict[str, slice]:
    """The rows of each clip, of rows clip by clip."""
    codes = numbers(clips.indices)
    starts = np.flatnonzero(np.diff(codes, prepend=-1)).tolist()
    clips.dictionary.validate(full=True)  # damaged offsets would be followed
    names = clips.dictionary.to_pylist()
    return {names[codes[a]]: slice(a, b) for a, b in zip(starts, [*starts[1:], len(codes)], strict=True)}
