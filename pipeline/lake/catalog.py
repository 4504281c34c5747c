"""The catalog: one DuckDB file, changed by building the next one beside it and renaming.

A read-write handle on a DuckDB file shuts out every other process. So nobody ever opens the served file for
writing: a transaction works on a copy that then takes the file's name. Searches go on reading the file they
have opened, and a killed writer leaves the last whole catalog.
"""

from __future__ import annotations

import errno
import os
import weakref
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from threading import local
from typing import TYPE_CHECKING, Any, Final, TypeAlias, TypeVar

import pyarrow as pa
from motionlake import sql
from motionlake.errors import DamagedError, UserError, explained
from motionlake.lake.catalog_file import announce_catalog, catalog_written, check_catalog
from motionlake.lake.host import attached, elsewhere, room, seen_by_thread
from motionlake.lake.layout import Lake
from motionlake.lake.lock import share
from motionlake.lake.parts import replacing
from motionlake.lake.working import Version, deferred, version, working_copy
from motionlake.stopping import held

if TYPE_CHECKING:
    import duckdb

# DuckDB is imported where a connection is used: workers import this module and never open the catalog.
Connection: TypeAlias = "duckdb.DuckDBPyConnection"
Found = TypeVar("Found")
_own: Final = local()  # of a thread, the catalogs that stay open until a block ends
SCHEMA_VERSION: Final = 4  # of the catalog's tables, and of the macros and views over them that this program calls
# What mends an error of DuckDB with such words.
_TO_DO: Final = {
    "set lock": "close the program that has it open for writing",
    "version number": "update DuckDB to the version that wrote it",
}


def run_sql(con: Connection, name: str, parameters: Mapping[str, Any] | None = None) -> Connection:
    """Run the statements of one .sql file in turn, each with those of the parameters that it names.

    Raises:
        duckdb.Error: with a note of the file and the statement.
    """
    import duckdb

    given = parameters or {}
    for statement in con.extract_statements(sql.read(name)):
        try:
            con.execute(statement, {k: given[k] for k in statement.named_parameters})
        except duckdb.Error as error:
            error.add_note(f"in SQL {name}: {statement.query.strip()}")
            raise
    return con


def fetch(con: Connection, name: str, parameters: Mapping[str, Any] | None = None) -> list[dict[str, Any]]:
    """The rows of a query file as dictionaries."""
    cursor = run_sql(con, name, parameters)
    columns = [c[0] for c in cursor.description or ()]
    return [dict(zip(columns, row, strict=True)) for row in cursor.fetchall()]


def fetch_table(con: Connection, name: str, parameters: Mapping[str, Any] | None = None) -> pa.Table:
    """The rows of a query file of one statement as an Arrow table."""
    return con.sql(sql.read(name), params=dict(parameters or {})).to_arrow_table()


def rows_of(
    con: Connection, name: str, rows: pa.Table, parameters: Mapping[str, Any] | None = None
) -> list[tuple[Any, ...]]:
    """The rows of a query file that reads from the Arrow table `rows`."""
    con.register("rows", rows)
    try:
        return run_sql(con, name, parameters).fetchall()
    finally:
        con.unregister("rows")


def load_rows(con: Connection, name: str, rows: pa.Table, parameters: Mapping[str, Any] | None = None) -> None:
    """Run a .sql file that reads from the Arrow table `rows`."""
    con.register("rows", rows)
    try:
        run_sql(con, name, parameters)
    finally:
        con.unregister("rows")


def check_no_lake(lake: Lake) -> None:
    """Raises `UserError` if there is a lake."""
    if lake.catalog.exists():
        raise UserError(f"{lake.root}: there is a lake here already")


def create_catalog(lake: Lake) -> None:
    """Write an empty catalog; the caller holds the lake's lock. Raises `UserError` if there is one."""
    check_no_lake(lake)
    import duckdb

    lake.root.mkdir(parents=True, exist_ok=True)
    with held(), room(lake.catalog), replacing(lake.catalog) as temporary:
        try:
            with closing(duckdb.connect(str(temporary))) as con:
                for name in sql.names("schema"):
                    run_sql(con, name)
                refresh_macros(con)
                run_sql(con, "set_schema_version", {"version": SCHEMA_VERSION})
                con.execute("CHECKPOINT")  # to close it would say nothing of a full disk
        finally:
            temporary.with_name(temporary.name + ".wal").unlink(missing_ok=True)
        announce_catalog(lake, temporary)
    catalog_written(lake)


def version_of(con: Connection) -> int:
    """The version of a catalog; 0 for those written before catalogs had one."""
    import duckdb

    try:
        return int(fetch(con, "schema_version")[0]["version"])
    except duckdb.CatalogException:
        return 0


def check_version(con: Connection, lake: Lake) -> None:
    """Raises `UserError` where a lake is of another version than this program reads."""
    version = version_of(con)
    if version != SCHEMA_VERSION:
        migrate = f"bring it up to date with `motionlake migrate {lake.root}`"
        todo = migrate if version < SCHEMA_VERSION else "update motionlake"
        raise UserError(
            f"{lake.root}: is a lake of version {version}, and this motionlake reads version {SCHEMA_VERSION}; {todo}"
        )


@contextmanager
def reading(lake: Lake) -> Iterator[Connection]:
    """A connection to the catalog as it stands, for reading; relative Parquet paths resolve in the lake.

    Raises:
        UserError: as `connect_read_only`.
    """
    block = _unopened().pop(lake.catalog, None)
    if block is not None:
        block.enter_context(_opened(lake))
    with _opened(lake) as con:
        yield con


@contextmanager
def open_once(lake: Lake) -> Iterator[None]:
    """Within the block this thread opens the catalog when it first reads it, and not again.

    To open it a dozen times takes as long as a search, and some searches do not read it.
    """
    with ExitStack() as block:
        waiting = _unopened()
        waiting.setdefault(lake.catalog, block)
        try:
            yield
        finally:
            if waiting.get(lake.catalog) is block:
                del waiting[lake.catalog]


def _unopened() -> dict[Path, ExitStack]:
    """The blocks of this thread in which a catalog, by its path, was not read yet; they close it at their end."""
    found: dict[Path, ExitStack] = _own.__dict__.setdefault("unopened", {})
    return found


@contextmanager
def _opened(lake: Lake) -> Iterator[Connection]:
    changed = working_copy(lake)
    with ExitStack() as stack:
        again = changed is None and seen_by_thread(lake.catalog) is not None  # and so it was checked
        seen = share(lake)
        if seen is not None:
            stack.callback(os.close, seen)
        if changed is None and not again:
            check_catalog(lake)
        stack.enter_context(_told(lake))
        con = stack.enter_context(attached(changed or lake.catalog, writable=changed is not None))
        run_sql(con, "use_lake", {"root": str(lake.root)})
        if changed is not None:
            con.begin()  # what this command changes meanwhile does not show
        if not again:
            check_version(con, lake)
        yield con


def remembered(lake: Lake, what: str, find: Callable[[Connection], Found]) -> Found:
    """What a catalog tells, asked of it once: a process that answers many remembers it until there is a newer one.

    Who gets it does not change it.

    Args:
        lake: whose catalog it is.
        what: a name of it.
        find: asks the catalog.

    Raises:
        UserError: as `reading`.
    """
    kept = _remembered.get((lake.root, what))
    if kept is None or kept[0] != version(lake):
        with reading(lake) as con:
            kept = _remembered[lake.root, what] = version(lake), find(con)
    found: Found = kept[1]
    return found


def remember(lake: Lake, what: str, found: object) -> None:
    """Have `remembered` give what the catalog told that this thread reads now."""
    _remembered[lake.root, what] = version(lake), found


_remembered: Final[dict[tuple[Path, str], tuple[Version, Any]]] = {}


def connect_read_only(lake: Lake) -> Connection:
    """Open the catalog of now for reading, with a DuckDB of its own, in which cursors need `USE lake`.

    Raises:
        UserError: the lake is of another version, or somebody has the catalog open for writing.
        DamagedError: the catalog is not as it was written.
    """
    con = open_catalog(lake)
    try:
        check_version(con, lake)
    except BaseException:
        con.close()
        raise
    return con


def open_catalog(lake: Lake) -> Connection:
    """Open the catalog of a lake of any version for reading. Raises `UserError` where that cannot be done."""
    import duckdb

    with ExitStack() as stack, _told(lake):
        seen = share(lake)
        if seen is not None:
            stack.callback(os.close, seen)
        check_catalog(lake)
        con = duckdb.connect(config=elsewhere())
        run_sql(con, "attach", {"catalog": str(lake.catalog)})
        run_sql(con, "use_catalog")
        run_sql(con, "use_lake", {"root": str(lake.root)})
        weakref.finalize(con, stack.pop_all().close)
    return con


@contextmanager
def _told(lake: Lake) -> Iterator[None]:
    """Say in one line why a catalog cannot be opened, or what of it cannot be read."""
    import duckdb

    try:
        yield
    except duckdb.Error as error:
        reason = str(error).splitlines()[0]
        if os.strerror(errno.EACCES) in reason:
            fault = PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(lake.catalog))
            raise UserError(explained(fault)) from error
        if not any(word in reason for word in (*_TO_DO, str(lake.catalog), "orrupt", "erializ")):
            raise
        told = f"{lake.catalog}: cannot be read ({reason})"
        for word, todo in _TO_DO.items():
            if word in reason:
                raise UserError(f"{told}; {todo}") from error
        raise DamagedError(f"{told}; `{lake.mending}` mends it from what lies beside it") from error


@contextmanager
def writing(lake: Lake) -> Iterator[Connection]:
    """A transaction over the whole catalog: all of it is entered when the block ends well, else nothing.

    It is served at once, or with others of the command (`motionlake.lake.working`).
    """
    with changing(lake) as con:
        check_version(con, lake)
        since, views = _written.get(lake.catalog, (None, frozenset[str]()))
        if since != version(lake):
            refresh_macros(con)
            views = frozenset()
        yield con
        run_sql(con, "forget_unnamed_files")
        views |= refresh_views(con, lake, views)
    _written[lake.catalog] = version(lake), views


_written: Final[dict[Path, tuple[Version, frozenset[str]]]] = {}  # catalogs with macros and views of this process


@contextmanager
def changing(lake: Lake) -> Iterator[Connection]:
    """The same for a lake of any version; macros and views stay as they are."""
    with held(), room(lake.catalog), deferred(lake) as work:
        with work.transaction() as con:
            run_sql(con, "use_lake", {"root": str(lake.root)})
            yield con
        if work.due():
            work.serve()


def refresh_macros(con: Connection) -> None:
    """Macros as this program has them: they hold no data."""
    for name in sql.names("macros"):
        run_sql(con, name)


def has_macros(con: Connection) -> bool:
    """Whether a catalog has all macros that this program has: an earlier one may have written it."""
    stems = {name.removeprefix("macros/").removesuffix(".sql") for name in sql.names("macros")}
    return stems == {row["name"] for row in fetch(con, "functions_among", {"names": sorted(stems)})}


def bring_macros(lake: Lake) -> None:
    """Give a catalog the macros that it lacks; the caller holds the lake's lock."""
    with reading(lake) as con:
        lacking = not has_macros(con)
    if lacking:
        with writing(lake):
            pass


def refresh_views(con: Connection, lake: Lake, made: Collection[str] = ()) -> frozenset[str]:
    """Make views over Parquet of which there are parts to read, since DuckDB then looks for these; their names.

    Those that are `made` stay as they are.
    """
    found = set()
    for name in sql.names("views"):
        folder = name.removeprefix("views/").removesuffix(".sql")
        if name not in made and any(lake.root.joinpath(folder).glob("**/[!.]*.parquet")):
            run_sql(con, name)
            found.add(name)
    return frozenset(found)


def table_of(rows: Sequence[Mapping[str, Any]], schema: pa.Schema) -> pa.Table:
    return pa.Table.from_pylist(list(rows), schema=schema)
