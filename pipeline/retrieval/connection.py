"""A DuckDB connection to a lake with its functions and macros ready."""

from __future__ import annotations

from pathlib import Path

from motionlake import sql
from motionlake.lake.catalog import Connection, connect_read_only, fetch, run_sql
from motionlake.lake.layout import Lake, open_lake
from motionlake.retrieval.sql_functions import align, duplicates, emd, find, find_submotion, labelling, synthesize


def connect(lake: Path | str, *, apart: bool = False) -> Connection:
    """Open a lake for reading: its tables, views, macros, and the functions that macros need.

    Functions: those of `sql_functions`. Close the connection to see what later runs have added: it reads the
    catalog as it stood when it was opened, and a process that opens it twice sees the older one.

    Args:
        lake: its folder.
        apart: whatever else this process has open, see the catalog of now; cursors of the connection need `USE lake`.

    Raises:
        UserError: there is no lake, or its catalog is open for writing elsewhere.
    """
    target = open_lake(lake)
    con = connect_read_only(target, apart=apart)
    if not fetch(con, "has_functions"):
        _register(con, target)
    for name in sql.names("udf_macros"):
        run_sql(con, name)
    return con


def _register(con: Connection, target: Lake) -> None:
    emd.register(con, target)
    find.register(con, target)
    find_submotion.register(con, target)
    labelling.register(con, target)
    duplicates.register(con, target)
    align.register(con, target)
    synthesize.register(con, target)
