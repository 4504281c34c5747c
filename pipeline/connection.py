"""A DuckDB connection to a lake with its functions and macros ready."""

from __future__ import annotations

from pathlib import Path

import duckdb
import numpy as np
import pyarrow as pa
from duckdb.func import ARROW, SPECIAL
from duckdb.sqltypes import DOUBLE, FLOAT

import sql
from pipeline.emd import emd, ground_distances
from pipeline.lake.catalog import Connection, connect_read_only, run_sql
from pipeline.lake.layout import open_lake


def connect(lake: Path | str) -> Connection:
    """Open a lake for reading: its tables, views, macros, and the functions that macros need.

    Functions: `emd(FLOAT[], FLOAT[]) -> DOUBLE`, the earth mover's distance between two signatures over the
    lake's current motifs. Close the connection to see what later runs have added: it reads the catalog as it
    stood when it was opened, and a process that opens it twice sees the older one.

    Raises:
        UserError: there is no lake, or its catalog is open for writing elsewhere.
    """
    con = connect_read_only(open_lake(lake))
    centroids = run_sql(con, "queries/centroids.sql").fetchall()
    _register_emd(con, np.array([row[0] for row in centroids], dtype=np.float32))
    for name in sql.names("udf_macros"):
        run_sql(con, name)
    return con


def _register_emd(con: Connection, centroids: np.ndarray) -> None:
    ground = ground_distances(centroids) if len(centroids) else np.zeros((0, 0))

    def distances(left: pa.ChunkedArray, right: pa.ChunkedArray) -> pa.Array:
        pairs = zip(left.to_pylist(), right.to_pylist(), strict=True)
        return pa.array([None if p is None or q is None else emd(p, q, ground) for p, q in pairs], pa.float64())

    lists = duckdb.list_type(FLOAT)
    con.create_function("emd", distances, [lists, lists], DOUBLE, type=ARROW, null_handling=SPECIAL)
