"""A function of all clips: pairs that are one recording.

What it needs is imported at the first call: a connection that does not ask for it opens as fast.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import duckdb
import pyarrow as pa
from duckdb.func import ARROW, SPECIAL
from duckdb.sqltypes import BOOLEAN, DOUBLE, VARCHAR
from motionlake.lake.catalog import Connection, reading
from motionlake.lake.layout import Lake

PAIRS = pa.list_(
    pa.struct(
        [
            ("clip", pa.string()), ("other", pa.string()), ("distance", pa.float64()), ("mirrored", pa.bool_()),
            ("offset_seconds", pa.float64()), ("overlap_seconds", pa.float64()), ("signatures", pa.float64()),
        ]
    )
)  # fmt: skip
ROW = {
    "clip": VARCHAR, "other": VARCHAR, "distance": DOUBLE, "mirrored": BOOLEAN, "offset_seconds": DOUBLE,
    "overlap_seconds": DOUBLE, "signatures": DOUBLE,
}  # fmt: skip


def register(con: Connection, lake: Lake) -> None:
    """Make `near_duplicate_pairs` known to a connection.

    `near_duplicate_pairs(max_distance DOUBLE, within VARCHAR, across BOOLEAN, mirrored BOOLEAN) ->
    STRUCT(clip, other, distance, mirrored, offset_seconds, overlap_seconds, signatures)[]`: see
    `motionlake.retrieval.duplicates.near_duplicates`.
    """

    def pairs(
        max_distance: pa.ChunkedArray, within: pa.ChunkedArray, across: pa.ChunkedArray, mirrored: pa.ChunkedArray
    ) -> pa.Array:
        columns = (max_distance, within, across, mirrored)
        rows = zip(*(column.to_pylist() for column in columns), strict=True)
        return pa.array([_pairs(lake, *row) for row in rows], PAIRS)

    kind: Any = {"type": ARROW, "null_handling": SPECIAL}
    arguments: Any = [DOUBLE, VARCHAR, BOOLEAN, BOOLEAN]
    rows = duckdb.list_type(duckdb.struct_type(ROW))
    con.create_function("near_duplicate_pairs", pairs, arguments, rows, **kind)


def _pairs(
    lake: Lake, max_distance: float, within: str | None, across: bool, mirrored: bool
) -> list[dict[str, object]]:
    from motionlake.retrieval.duplicates import near_duplicates

    with reading(lake) as con:
        found = near_duplicates(con, lake, max_distance=max_distance, within=within, across=across, mirrored=mirrored)
    return [asdict(pair) for pair in found]
