"""motionlake sql: questions to a lake in SQL."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from motionlake.cli._output import notice, tell
from motionlake.cli.common import JsonOption, LakeOption, argument, option
from motionlake.errors import UserError, told_by_sql

if TYPE_CHECKING:
    from motionlake.lake.safe import LakeConnection


def sql(
    lake: LakeOption,
    query: Annotated[str, argument("A query, or - to read it from stdin.")],
    out: Annotated[
        Path | None, option("--out", "-o", help="Write the rows into this .parquet, .csv or .json file.")
    ] = None,
    memory: Annotated[
        str | None, option(help="Most that the query may use, such as 4GB (default: 4/5 of all).")
    ] = None,
    seconds: Annotated[float, option(min=0.0, help="Stop the query after so long.")] = 600.0,
    trusted: Annotated[
        bool,
        typer.Option(
            "--trusted",
            help="Let the query read and write any file, attach databases and load extensions: all that "
            "you may. Without it, it reads the lake and nothing else, and writes nowhere.",
        ),
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Run SQL on a lake, with the lake's functions and macros. It reads the lake alone, and changes nothing.

    Example: motionlake sql "SELECT label, count(*) FROM clips GROUP BY ALL" --lake mylake

    Example: motionlake sql "FROM similar_clips('hdm05/clips/a.amc', 5)" --lake mylake

    Into a file: motionlake sql "SELECT clip, seconds FROM clips" --out clips.csv --lake mylake
    """
    import duckdb
    from motionlake.lake.safe import interruptible, time_limit
    from motionlake.retrieval.sql_functions import connect
    from motionlake.retrieval.sql_results import check_results_file

    if out is not None:
        check_results_file(out)
    text = sys.stdin.read() if query == "-" else query
    try:
        with connect(lake, trusted=trusted, memory=memory) as con, time_limit(con, seconds):
            if not con.extract_statements(text):
                raise UserError("sql: there is no statement in the query")
            if out is not None:
                notice(f"{out}: {interruptible(con, partial(_write_rows, con, text, out))} rows")
                return
            rows = interruptible(con, partial(_rows, con, text))
    except duckdb.Error as error:
        raise UserError(f"SQL: {told_by_sql(str(error))}") from error
    tell(rows, as_json=as_json)


def _rows(con: LakeConnection, query: str) -> list[dict[str, Any]]:
    con.execute(query)
    names = [c[0] for c in con.description or ()]
    return [dict(zip(names, row, strict=True)) for row in con.fetchall()]


def _write_rows(con: LakeConnection, query: str, out: Path) -> int:
    from motionlake.retrieval.sql_results import write_results

    found = con.sql(query)
    if found is None:
        raise UserError("sql --out: the query answers no rows")
    return write_results(found.to_arrow_reader(), out)
