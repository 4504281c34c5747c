"""Rows of clips that are gone or have moved to another part: each table has a statement that forgets its own."""

from __future__ import annotations

from typing import Final

from motionlake import sql
from motionlake.lake.catalog import Connection, run_sql

PREFIX: Final = "forget_orphans_of_"  # then the table's name


def forget_orphans(con: Connection) -> None:
    """Forget what was derived from clips that are gone, and the shards of parts that are gone."""
    for name in sql.statements():
        if name.startswith(PREFIX):
            run_sql(con, name)
