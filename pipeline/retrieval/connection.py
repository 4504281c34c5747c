"""A DuckDB connection to a lake with its functions and macros ready."""

from __future__ import annotations

from pathlib import Path

from motionlake.lake.catalog import Connection, connect_read_only
from motionlake.lake.layout import open_lake
from motionlake.retrieval import sql_functions


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
    sql_functions.register(con, target)
    return con
