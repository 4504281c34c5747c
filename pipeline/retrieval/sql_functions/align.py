"""Functions of aligned strings: ranges and whole clips like one.

What they need is imported at the first call: a connection that asks for none of it opens as fast.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property
from typing import TYPE_CHECKING, Any

import duckdb
import pyarrow as pa
from duckdb.func import ARROW, SPECIAL
from duckdb.sqltypes import BIGINT, BOOLEAN, DOUBLE, INTEGER, VARCHAR
from motionlake.lake.catalog import Connection, reading
from motionlake.lake.layout import Lake

if TYPE_CHECKING:
    from motionlake.retrieval.aligner import Aligner
    from motionlake.retrieval.lake_strings import LakeStrings

RANGE = {
    "rank": BIGINT, "clip": VARCHAR, "start": BIGINT, "stop": BIGINT, "cost": DOUBLE, "normalised_cost": DOUBLE,
    "label": VARCHAR, "dataset": VARCHAR, "start_seconds": DOUBLE, "seconds": DOUBLE,
}  # fmt: skip
WHOLE = {"rank": BIGINT, "clip": VARCHAR, "cost": DOUBLE, "label": VARCHAR, "dataset": VARCHAR, "seconds": DOUBLE}
_ARROW = {BIGINT: pa.int64(), DOUBLE: pa.float64(), VARCHAR: pa.string()}
Row = dict[str, Any]


def register(con: Connection, lake: Lake) -> None:
    """Make three functions known to a connection. NULL leaves `start`, `stop`, `within`, `stride`, `method` open.

    - `align_ranges(clip VARCHAR, start BIGINT, stop BIGINT, k BIGINT, within VARCHAR, stride BIGINT, method VARCHAR,
      real BOOLEAN)
      -> STRUCT(rank, clip, start, stop, cost, normalised_cost, label, dataset, start_seconds, seconds)[]`:
      see `motionlake.retrieval.aligner.Aligner.in_clip`.
    - `align_strings(symbols INTEGER[], model VARCHAR, k BIGINT, within VARCHAR, stride BIGINT, method VARCHAR,
      real BOOLEAN)`: the same for a string of symbols, see `Aligner.in_symbols`.
    - `align_wholes(clip VARCHAR, k BIGINT, within VARCHAR, stride BIGINT, method VARCHAR, real BOOLEAN)
      -> STRUCT(rank, clip, cost, label, dataset, seconds)[]`: see `Aligner.whole`.
    """
    served = _Served(lake)

    def ranges(  # DuckDB counts the parameters
        clip: pa.ChunkedArray,
        start: pa.ChunkedArray,
        stop: pa.ChunkedArray,
        k: pa.ChunkedArray,
        within: pa.ChunkedArray,
        stride: pa.ChunkedArray,
        method: pa.ChunkedArray,
        real: pa.ChunkedArray,
    ) -> pa.Array:
        return _rows(served.ranges, RANGE, clip, start, stop, k, within, stride, method, real)

    def strings(
        given: pa.ChunkedArray,
        model: pa.ChunkedArray,
        k: pa.ChunkedArray,
        within: pa.ChunkedArray,
        stride: pa.ChunkedArray,
        method: pa.ChunkedArray,
        real: pa.ChunkedArray,
    ) -> pa.Array:
        return _rows(served.strings_like, RANGE, given, model, k, within, stride, method, real)

    def wholes(
        clip: pa.ChunkedArray,
        k: pa.ChunkedArray,
        within: pa.ChunkedArray,
        stride: pa.ChunkedArray,
        method: pa.ChunkedArray,
        real: pa.ChunkedArray,
    ) -> pa.Array:
        return _rows(served.wholes, WHOLE, clip, k, within, stride, method, real)

    kind: Any = {"type": ARROW, "null_handling": SPECIAL}
    options: list[Any] = [BIGINT, VARCHAR, BIGINT, VARCHAR, BOOLEAN]
    found, clips = (duckdb.list_type(duckdb.struct_type(row)) for row in (RANGE, WHOLE))
    con.create_function("align_ranges", ranges, [VARCHAR, BIGINT, BIGINT, *options], found, **kind)
    con.create_function("align_strings", strings, [duckdb.list_type(INTEGER), VARCHAR, *options], found, **kind)
    con.create_function("align_wholes", wholes, [VARCHAR, *options], clips, **kind)


def _rows(answer: Callable[..., list[Row]], fields: dict[str, Any], *columns: pa.ChunkedArray) -> pa.Array:
    asked = zip(*(column.to_pylist() for column in columns), strict=True)
    kind = pa.list_(pa.struct([(name, _ARROW[t]) for name, t in fields.items()]))
    return pa.array([None if row[0] is None else answer(*row) for row in asked], kind)


class _Served:
    """The strings that a connection serves, read at first use (a function must not query its own connection)."""

    def __init__(self, lake: Lake) -> None:
        self.lake = lake

    @cached_property
    def strings(self) -> LakeStrings:
        from motionlake.retrieval.lake_strings import read_strings

        with reading(self.lake) as con:
            return read_strings(con)

    @contextmanager
    def aligner(self, real: bool) -> Iterator[Aligner]:
        from motionlake.retrieval.aligner import Aligner

        strings = self.strings
        with reading(self.lake) as con:
            yield Aligner(con, self.lake, strings, real=real)

    def ranges(
        self,
        clip: str,
        start: int | None,
        stop: int | None,
        k: int,
        within: str | None,
        stride: int | None,
        method: str | None,
        real: bool,
    ) -> list[Row]:
        with self.aligner(real) as aligner:
            hits = aligner.in_clip(clip, start, stop, k, dataset=within, stride=stride, method=method)
        return [hit.as_row() for hit in hits]

    def strings_like(
        self,
        given: list[int],
        model: str | None,
        k: int,
        within: str | None,
        stride: int | None,
        method: str | None,
        real: bool,
    ) -> list[Row]:
        with self.aligner(real) as aligner:
            hits = aligner.in_symbols(given, k, model=model, dataset=within, stride=stride, method=method)
        return [hit.as_row() for hit in hits]

    def wholes(
        self, clip: str, k: int, within: str | None, stride: int | None, method: str | None, real: bool
    ) -> list[Row]:
        with self.aligner(real) as aligner:
            hits = aligner.whole(clip, k, dataset=within, stride=stride, method=method)
        return [hit.as_row() for hit in hits]
