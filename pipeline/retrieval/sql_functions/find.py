"""Functions of motions inside clips: ranges like a range.

What they need is imported at the first call: a connection that asks for none of it opens as fast.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import duckdb
import pyarrow as pa
from duckdb.func import ARROW, SPECIAL
from duckdb.sqltypes import BIGINT, BOOLEAN, DOUBLE, VARCHAR
from motionlake.lake.catalog import Connection, reading
from motionlake.lake.layout import Lake

if TYPE_CHECKING:
    from motionlake.deep_motifs.corpus import Corpus

FOUND = pa.list_(
    pa.struct(
        [
            ("rank", pa.int64()), ("clip", pa.string()), ("start", pa.int64()), ("stop", pa.int64()),
            ("distance", pa.float64()), ("mirrored", pa.bool_()), ("label", pa.string()), ("dataset", pa.string()),
            ("start_seconds", pa.float64()), ("seconds", pa.float64()),
        ]
    )
)  # fmt: skip
ROW = {
    "rank": BIGINT, "clip": VARCHAR, "start": BIGINT, "stop": BIGINT, "distance": DOUBLE, "mirrored": BOOLEAN,
    "label": VARCHAR, "dataset": VARCHAR, "start_seconds": DOUBLE, "seconds": DOUBLE,
}  # fmt: skip


def register(con: Connection, lake: Lake) -> None:
    """Make `find_ranges` known to a connection.

    `find_ranges(clip VARCHAR, start BIGINT, stop BIGINT, k BIGINT, within VARCHAR, mirrored BOOLEAN, real BOOLEAN) ->
    STRUCT(rank, clip, start, stop, distance, mirrored, label, dataset, start_seconds, seconds)[]`: see
    `motionlake.retrieval.query_by_example.Finder.in_clip`. NULL for `start`, `stop` or `within` leaves them open.
    """
    served = _Served(lake)

    def found(  # DuckDB counts the parameters
        clip: pa.ChunkedArray,
        start: pa.ChunkedArray,
        stop: pa.ChunkedArray,
        k: pa.ChunkedArray,
        within: pa.ChunkedArray,
        turned: pa.ChunkedArray,
        real: pa.ChunkedArray,
    ) -> pa.Array:
        rows = zip(*(column.to_pylist() for column in (clip, start, stop, k, within, turned, real)), strict=True)
        return pa.array([None if row[0] is None else served.find(*row) for row in rows], FOUND)

    kind: Any = {"type": ARROW, "null_handling": SPECIAL}
    arguments: Any = [VARCHAR, BIGINT, BIGINT, BIGINT, VARCHAR, BOOLEAN, BOOLEAN]
    con.create_function("find_ranges", found, arguments, duckdb.list_type(duckdb.struct_type(ROW)), **kind)


class _Served:
    """The signed words that a connection serves, read at first use (a function must not query its own connection)."""

    def __init__(self, lake: Lake) -> None:
        self.lake = lake

    @cached_property
    def corpus(self) -> Corpus:
        from motionlake.lake.corpus import read_corpus

        with reading(self.lake) as con:
            return read_corpus(con)

    def find(
        self, clip: str, start: int | None, stop: int | None, k: int, within: str | None, mirrored: bool, real: bool
    ) -> list[dict[str, object]]:
        from motionlake.retrieval.query_by_example import Finder

        corpus = self.corpus
        with reading(self.lake) as con:
            finder = Finder(con, self.lake, corpus, real=real)
            hits = finder.in_clip(clip, start, stop, k, dataset=within, mirrored=mirrored)
        return [hit.as_row() for hit in hits]
