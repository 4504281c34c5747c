"""Functions of pieces of motion: the clips that hold one, and where.

What they need is imported at the first call: a connection that asks for none of it opens as fast.
"""

from __future__ import annotations

from typing import Any

import duckdb
import pyarrow as pa
from duckdb.func import ARROW, SPECIAL
from duckdb.sqltypes import BIGINT, BOOLEAN, DOUBLE, VARCHAR
from motionlake.lake.catalog import Connection, reading
from motionlake.lake.layout import Lake

ROW = {
    "rank": BIGINT, "clip": VARCHAR, "start": BIGINT, "stop": BIGINT, "distance": DOUBLE, "cost": DOUBLE,
    "label": VARCHAR, "dataset": VARCHAR, "start_seconds": DOUBLE, "seconds": DOUBLE,
}  # fmt: skip
_ARROW = {BIGINT: pa.int64(), DOUBLE: pa.float64(), VARCHAR: pa.string()}
FOUND = pa.list_(pa.struct([(name, _ARROW[kind]) for name, kind in ROW.items()]))


def register(con: Connection, lake: Lake) -> None:
    """Make `find_pieces` known to a connection.

    `find_pieces(clip VARCHAR, start BIGINT, stop BIGINT, k BIGINT, within VARCHAR, own BOOLEAN, real BOOLEAN) ->
    STRUCT(rank, clip, start, stop, distance, cost, label, dataset, start_seconds, seconds)[]`: see
    `SubmotionFinder.in_clip`. NULL for `start`, `stop` or `within` leaves them open.
    """

    def found(  # DuckDB counts the parameters
        clip: pa.ChunkedArray,
        start: pa.ChunkedArray,
        stop: pa.ChunkedArray,
        k: pa.ChunkedArray,
        within: pa.ChunkedArray,
        own: pa.ChunkedArray,
        real: pa.ChunkedArray,
    ) -> pa.Array:
        rows = zip(*(column.to_pylist() for column in (clip, start, stop, k, within, own, real)), strict=True)
        return pa.array([None if row[0] is None else _find(lake, *row) for row in rows], FOUND)

    kind: Any = {"type": ARROW, "null_handling": SPECIAL}
    arguments: Any = [VARCHAR, BIGINT, BIGINT, BIGINT, VARCHAR, BOOLEAN, BOOLEAN]
    con.create_function("find_pieces", found, arguments, duckdb.list_type(duckdb.struct_type(ROW)), **kind)


def _find(
    lake: Lake, clip: str, start: int | None, stop: int | None, k: int, within: str | None, own: bool, real: bool
) -> list[dict[str, object]]:
    """On a connection of its own: a function must not query the one that calls it."""
    from motionlake.retrieval.submotion_search import SubmotionFinder

    with reading(lake) as con:
        hits = SubmotionFinder(con, lake, real=real).in_clip(clip, start, stop, k, dataset=within, own=own)
    return [hit.as_row() for hit in hits]
