"""motionlake sql."""

from __future__ import annotations

import sys
from typing import Annotated

import duckdb
import typer
from motionlake.cli.common import JsonOption, LakeOption, tell
from motionlake.errors import UserError


def sql(
    lake: LakeOption,
    query: Annotated[str, typer.Argument(help="A query, or - to read it from stdin.", show_default=False)],
    as_json: JsonOption = False,
) -> None:
    """Run SQL on a lake (read-only), with the lake's functions and macros.

    Example: motionlake sql "SELECT label, count(*) FROM clips GROUP BY ALL" --lake mylake

    Example: motionlake sql "FROM similar_clips('hdm05/clips/a.amc', 5)" --lake mylake
    """
    from motionlake.retrieval.connection import connect

    con = connect(lake)
    try:
        text = sys.stdin.read() if query == "-" else query
        if not con.extract_statements(text):
            raise UserError("sql: there is no statement in the query")
        cursor = con.execute(text)
        names = [c[0] for c in cursor.description or ()]
        rows = [dict(zip(names, row, strict=True)) for row in cursor.fetchall()]
    except duckdb.Error as error:
        # What a function of ours says of a mistake stands at the end of what DuckDB says.
        raise UserError(f"SQL: {str(error).rpartition('UserError: ')[2]}") from error
    finally:
        con.close()
    tell(rows, as_json=as_json)
