"""Stage "windows": codes of the windows of clips, one byte a number, by which pieces are looked for in large lakes.

A part is an Arrow file that a search maps into memory. It lists windows in the order of the part of stage "submotions"
that it follows; vector x is kept as s c, with integers c of one byte and a scale s, and its squared length.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array, Int64Array
from motionlake.columns import numbers, read_parquet
from motionlake.deephums.config import DIMENSION
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.lake.parts import replacing
from motionlake.stages.reader import LakeReader
from motionlake.stages.stage import Part, PartStage, Shard, ShardResult, live_parts
from motionlake.stages.submotions import SUBMOTIONS
from numpy.typing import NDArray

MOST: Final = 1000  # clips of a lake up to which a search reads the vectors themselves
CODE: Final = 127
ROWS: Final = pa.schema(
    [
        ("clip", pa.dictionary(pa.int32(), pa.string())), ("start", pa.int64()), ("stop", pa.int64()),
        ("scale", pa.float32()), ("square", pa.float32()), ("code", pa.list_(pa.int8(), DIMENSION)),
    ]
)  # fmt: skip


class Windows(PartStage):
    """Made in lakes of more than `MOST` clips."""

    name = "windows"
    about = "codes of the windows of clips, by which pieces are looked for in a large lake"
    source = SUBMOTIONS
    folder = "windows"

    def shaping(self, at: LakeReader) -> Sequence[Any]:
        return ()

    def file(self, key: str) -> str:
        return f"{self.folder}/{key[:16]}.arrow"

    def plan(self, at: LakeReader) -> list[Shard]:
        return super().plan(at) if _is_large(at) else []

    def due(self, at: LakeReader) -> int:
        return super().due(at) if _is_large(at) else 0

    def spec(self, at: LakeReader, part: Part) -> Mapping[str, Any]:
        return {"submotions": SUBMOTIONS.file(part.upstream)}

    def rows(self, lake: Lake, shard: Shard) -> Iterator[pa.Table]:
        found = read_parquet(sound(lake, shard.spec["submotions"]))
        vectors = found["descriptor"].combine_chunks().flatten().to_numpy(zero_copy_only=False)
        yield coded(found, vectors.astype(np.float32).reshape(-1, DIMENSION))

    def run(self, root: Path, shard: Shard, /) -> ShardResult:
        started = time.perf_counter()
        lake, file = Lake(root), self.file(shard.key)
        (table,) = self.rows(lake, shard)
        size = _write(lake.path(file), table, shard.key)
        return ShardResult(shard, table.num_rows, size, (file,), time.perf_counter() - started)

    def merge(
        self, parts: Mapping[str, Path], order: Sequence[tuple[str, str]], target: Path, part: str, key: str
    ) -> None:
        own = {name: WindowFile.open(path) for name, path in parts.items()}
        rows = [own[name].table.slice(run.start, run.stop - run.start) for clip, name in order
                if name in own and (run := own[name].runs.get(clip)) is not None]  # fmt: skip
        _write(target, pa.concat_tables([ROWS.empty_table(), *rows]), key)


WINDOWS: Final = Windows()


def _is_large(at: LakeReader) -> bool:
    return at.once("large", WINDOWS.name, lambda: sum(part.clips for part in live_parts(at)) > MOST)


def coded(windows: pa.Table, vectors: Float32Array) -> pa.Table:
    """Rows of windows (`clip`, `start`, `stop`) with the codes of their vectors [n, 512]."""
    largest = np.abs(vectors).max(axis=1, initial=0.0)
    scales = np.where(largest > 0, largest / CODE, 1.0).astype(np.float32)
    codes = np.rint(vectors / scales[:, None]).astype(np.int8)
    squares = np.square(vectors.astype(np.float64)).sum(axis=1).astype(np.float32)
    lists = pa.FixedSizeListArray.from_arrays(pa.array(codes.ravel()), DIMENSION)
    columns = [
        windows["clip"].cast(pa.string()).dictionary_encode(),
        windows["start"],
        windows["stop"],
        pa.array(scales),
        pa.array(squares),
        lists,
    ]
    return pa.table(columns, schema=ROWS)


def _write(path: Path, table: pa.Table, key: str) -> int:
    """Write a part, all of it as one batch; returns its bytes."""
    clips = table["clip"].cast(pa.string()).combine_chunks().dictionary_encode()  # of these rows alone
    whole = table.set_column(0, ROWS.field("clip"), clips).combine_chunks().replace_schema_metadata({"key": key})
    with replacing(path) as temporary, pa.ipc.new_file(str(temporary), whole.schema) as writer:
        writer.write_table(whole)
    return path.stat().st_size


def _runs(clips: pa.DictionaryArray) -> dict[str, slice]:
    """The rows of each clip, of rows clip by clip."""
    numbers = np.from_dlpack(clips.indices)
    starts = np.flatnonzero(np.diff(numbers, prepend=-1)).tolist()
    names = clips.dictionary.to_pylist()
    return {names[numbers[a]]: slice(a, b) for a, b in zip(starts, [*starts[1:], len(numbers)], strict=True)}


@dataclass(frozen=True)
class WindowFile:
    """A part, mapped into memory.

    Attributes:
        table: its rows.
        codes: [n, 512].
        scales, squares: [n] of the vectors.
        runs: the rows of each clip.
    """

    table: pa.Table
    codes: NDArray[np.int8]
    scales: Float32Array
    squares: Float32Array
    runs: Mapping[str, slice]

    @staticmethod
    def open(path: Path) -> WindowFile:
        table = pa.ipc.open_file(pa.memory_map(str(path))).read_all()
        codes: NDArray[Any] = np.zeros(0, dtype=np.int8)
        scales: NDArray[Any] = np.zeros(0, dtype=np.float32)
        squares = scales
        if table.num_rows:
            codes = np.from_dlpack(table["code"].chunk(0).flatten())
            scales, squares = (np.from_dlpack(table[name].chunk(0)) for name in ("scale", "square"))
        runs = _runs(table["clip"].chunk(0)) if table.num_rows else {}
        return WindowFile(table, codes.reshape(-1, DIMENSION), scales, squares, runs)

    def bounds(self) -> tuple[Int64Array, Int64Array]:
        """[n] first frames of windows, and frames after their last."""
        return numbers(self.table["start"]), numbers(self.table["stop"])
