"""A DuckDB connection to a lake with its functions and macros ready."""

from __future__ import annotations

from pathlib import Path

from motionlake import sql
from motionlake.lake.catalog import Connection, connect_read_only, run_sql
from motionlake.lake.layout import open_lake
from motionlake.retrieval.sql_functions import align, duplicates, emd, find, find_submotion, labelling, synthesize


def connect(lake: Path | str) -> Connection:
    """Open a lake for reading: its tables, views, macros, and the functions that macros need.

    Functions: those of `sql_functions`. Open another connection to see what later runs have added: this one reads the
    catalog as it stood when it was opened.

    Raises:
        UserError: there is no lake, or its catalog is open for writing elsewhere.
    """
    target = open_lake(lake)
    con = connect_read_only(target)
    emd.register(con, target)
    find.register(con, target)
    find_submotion.register(con, target)
    labelling.register(con, target)
    duplicates.register(con, target)
    align.register(con, target)
    synthesize.register(con, target)
    for name in sql.names("udf_macros"):
        run_sql(con, name)
    return con
