"""Stage "windows": codes of the windows of clips, one byte a number, by which pieces are looked for in large lakes.

A part is an Arrow file that a search maps into memory. It lists windows in the order of the part of stage "submotions"
that it follows; vector x is kept as s c, with integers c of one byte and a scale s, and its squared length.
"""

from __future__ import annotations

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
from motionlake.stages.mapped_part import CLIP, MappedPart, MappedStage
from motionlake.stages.reader import LakeReader
from motionlake.stages.stage import Part, Shard, live_parts
from motionlake.stages.submotions import SUBMOTIONS
from numpy.typing import NDArray

MOST: Final = 1000  # clips of a lake up to which a search reads the vectors themselves
CODE: Final = 127
ROWS: Final = pa.schema(
    [
        CLIP, ("start", pa.int64()), ("stop", pa.int64()),
        ("scale", pa.float32()), ("square", pa.float32()), ("code", pa.list_(pa.int8(), DIMENSION)),
    ]
)  # fmt: skip


class Windows(MappedStage):
    """Made in lakes of more than `MOST` clips."""

    name = "windows"
    about = "codes of the windows of clips, by which pieces are looked for in a large lake"
    source = SUBMOTIONS
    folder = "windows"

    def shaping(self, at: LakeReader) -> Sequence[Any]:
        return ()

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
        part = MappedPart.open(path)
        codes, scales, squares = (part.column(name) for name in ("code", "scale", "square"))
        return WindowFile(part.table, codes, scales, squares, part.runs)

    def bounds(self) -> tuple[Int64Array, Int64Array]:
        """[n] first frames of windows, and frames after their last."""
        return numbers(self.table["start"]), numbers(self.table["stop"])
