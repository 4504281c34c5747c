"""SQL that can only ask: a connection that reads the Parquet folders of one lake, and writes nowhere.

DuckDB's own settings shut out every other file and the network, and are locked. They cannot tell reading from writing
within the lake's folders: statements that write files, attach databases or load extensions are refused by their kind
before DuckDB runs them.
"""

from __future__ import annotations

import re
import tempfile
import uuid
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from threading import Event, Timer
from typing import TYPE_CHECKING, Any, Final, TypeVar

from motionlake import sql
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, run_sql

if TYPE_CHECKING:
    import duckdb

# What CREATE, INSERT and the like change can only be temporary, for the lake is attached for reading.
_ALLOWED: Final = frozenset(
    ("SELECT", "SET", "CREATE", "INSERT", "UPDATE", "DELETE", "DROP", "TRANSACTION", "RELATION", "CALL")
)
# DuckDB splits some statements (PIVOT) and wraps others (EXPLAIN): their first words say what they do.
_BY_FIRST_WORDS: Final = frozenset(("MULTI", "EXPLAIN"))
_ASKS: Final = re.compile(
    r"(?:\s|--[^\n]*\n|/\*.*?\*/)*(?:EXPLAIN\s+(?:ANALYZE\s+)?)?(?:SELECT|WITH|FROM|PIVOT|UNPIVOT|VALUES|SUMMARIZE)\b",
    re.IGNORECASE | re.DOTALL,
)


_LOOK: Final = 0.1  # seconds after which a signal is noticed at the latest
Answer = TypeVar("Answer")


class LakeConnection:
    """A DuckDB connection to a lake, whose SQL can only ask.

    It has the methods of a DuckDB connection; those that take SQL raise `UserError` for statements that may do more.
    """

    def __init__(self, con: Connection, *, trusted: bool = False) -> None:
        """`con`: to the attached lake; `trusted`: any statement may run."""
        self._con, self._trusted = con, trusted
        con.execute(sql.read("use_catalog"))
        con.execute(sql.read("listed_files_alone"))

    @property
    def own(self) -> Connection:
        """DuckDB's connection, for SQL of this program."""
        return self._con

    def _checked(self, query: Any) -> Any:
        return query if self._trusted else checked(self._con, query)

    def execute(self, query: Any, parameters: Any = None) -> LakeConnection:
        """Run SQL; its rows are fetched from this connection."""
        self._con.execute(self._checked(query), parameters)
        return self

    def executemany(self, query: Any, parameters: Any = None) -> LakeConnection:
        """Run SQL once for each of some parameters."""
        self._con.executemany(self._checked(query), parameters)
        return self

    def sql(self, query: Any, **options: Any) -> duckdb.DuckDBPyRelation:
        """What SQL answers, as a relation."""
        return self._con.sql(self._checked(query), **options)

    def query(self, query: Any, **options: Any) -> duckdb.DuckDBPyRelation:
        """The same as `sql`."""
        return self.sql(query, **options)

    from_query = query

    def fetchall(self) -> list[tuple[Any, ...]]:
        """The rows of what ran last that were not fetched yet."""
        return self._con.fetchall()

    def cursor(self) -> LakeConnection:
        """A further connection to the same lake, as safe as this one."""
        return LakeConnection(self._con.cursor(), trusted=self._trusted)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._con, name)

    def __enter__(self) -> LakeConnection:
        return self

    def __exit__(self, *_: object) -> None:
        self._con.close()


def checked(con: Connection, query: Any) -> Any:
    """The query, or statement, if all that it holds may run.

    Raises:
        UserError: a statement may do more than ask.
        duckdb.Error: the query cannot be parsed.
    """
    for statement in con.extract_statements(query) if isinstance(query, str) else [query]:
        if not _asks(statement):
            what = " ".join(statement.query.split()[:2]).upper()[:40]
            raise UserError(
                f"SQL: {what}: not allowed, for SQL only asks here; results go into a file by --out FILE, and "
                "--trusted (in Python: connect(lake, trusted=True)) allows everything"
            )
    return query


def _asks(statement: duckdb.Statement) -> bool:
    try:
        kind = statement.type.name
    except ValueError:  # one that DuckDB's Python package has no name for
        return False
    return kind in _ALLOWED or (kind in _BY_FIRST_WORDS and _ASKS.match(statement.query) is not None)


def limit_memory(con: Connection, memory: str) -> None:
    """The most that a DuckDB may use ("4GB"). Raises `UserError` where that is no size."""
    import duckdb

    try:
        con.execute(sql.read("limit_memory"), {"memory": memory})
    except duckdb.Error as error:
        raise UserError(f"memory {memory}: give a size such as 4GB") from error


def lock_down(con: Connection, root: Path) -> None:
    """Let a DuckDB read the Parquet folders below `root` and nothing else, for good.

    All connections to one DuckDB share its settings: it must be of this connection alone. What it sorts beyond its
    memory goes into a folder of its own, which is readable too, and which it makes and removes.
    """
    temporary = Path(tempfile.gettempdir()) / f"motionlake-sql-{uuid.uuid4().hex}"
    folders = [f"{root}/{name.removeprefix('views/').removesuffix('.sql')}/" for name in sql.names("views")]
    run_sql(con, "lock_down", {"folders": folders, "temporary": str(temporary)})


def interruptible(con: LakeConnection, run: Callable[[], Answer]) -> Answer:
    """What `run` gives, which asks a connection: a signal ends the query, for which DuckDB alone does not look."""
    with ThreadPoolExecutor(1) as thread:
        answer = thread.submit(run)
        try:
            while not answer.done():
                wait([answer], timeout=_LOOK)
        except BaseException:
            _interrupt(con, lambda: bool(wait([answer], timeout=_LOOK).done))
            raise
        return answer.result()


def _interrupt(con: Connection | LakeConnection, ended: Callable[[], bool]) -> None:
    """Interrupt a connection until what it runs has `ended`: between two statements, DuckDB forgets an interrupt."""
    con.interrupt()
    while not ended():
        con.interrupt()


@contextmanager
def time_limit(con: Connection | LakeConnection, seconds: float | None) -> Iterator[None]:
    """Stop what a connection runs after so many seconds; None: never.

    Raises:
        UserError: it was stopped.
    """
    import duckdb

    if seconds is None:
        yield
        return
    ended = Event()
    timer = Timer(seconds, _interrupt, (con, partial(ended.wait, _LOOK)))
    timer.start()
    try:
        yield
    except duckdb.InterruptException as error:
        raise UserError(f"SQL: stopped after {seconds:g} s; give it longer by --seconds") from error
    finally:
        ended.set()
        timer.cancel()
        timer.join()
