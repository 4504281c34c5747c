"""Parts that a search maps into memory: Arrow files of one batch, of which a few clips are read without all others.

To open one takes much less time than a Parquet part, and some search opens sixty for each query.
"""

from __future__ import annotations

import time
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.columns import column_of, numbers
from motionlake.lake.layout import Lake
from motionlake.lake.merging import Order
from motionlake.lake.parts import replacing
from motionlake.stages.stage import PartStage, Shard, ShardResult
from numpy.typing import NDArray

CLIP: Final = pa.field("clip", pa.dictionary(pa.int32(), pa.string()))  # the first column


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
        table = pa.ipc.open_file(pa.memory_map(str(path))).read_all()
        return MappedPart(table, _runs(table["clip"].chunk(0)) if table.num_rows else {})

    def of(self, clip: str) -> pa.Table:
        """The rows of a clip."""
        run = self.runs[clip]
        return self.table.slice(run.start, run.stop - run.start)

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
    whole = table.set_column(0, CLIP, clips).combine_chunks().replace_schema_metadata({"key": key})
    with replacing(path) as temporary, pa.ipc.new_file(str(temporary), whole.schema) as writer:
        writer.write_table(whole)
    return path.stat().st_size


def lists_of(matrix: NDArray[Any]) -> pa.Array:
    """The rows of a matrix [n, d] as a column of lists."""
    return pa.FixedSizeListArray.from_arrays(column_of(matrix.ravel()), matrix.shape[1])


def read_rows(path: Path, name: str, clips: Container[str] | None = None) -> Iterator[tuple[str, NDArray[Any]]]:
    """(clip, [n] or [n, d]) a column of every clip of a part, or of some clips, in order.

    Copied: who holds those of many parts need not keep these mapped.
    """
    part = MappedPart.open(path)
    rows = part.column(name)
    yield from ((clip, rows[run].copy()) for clip, run in part.runs.items() if clips is None or clip in clips)


def _spelled(rows: pa.Table) -> pa.Table:
    return rows.set_column(0, CLIP, rows["clip"].cast(pa.string()).dictionary_encode())


def _runs(clips: pa.DictionaryArray) -> dict[str, slice]:
    """The rows of each clip, of rows clip by clip."""
    codes = numbers(clips.indices)
    starts = np.flatnonzero(np.diff(codes, prepend=-1)).tolist()
    names = clips.dictionary.to_pylist()
    return {names[codes[a]]: slice(a, b) for a, b in zip(starts, [*starts[1:], len(codes)], strict=True)}
