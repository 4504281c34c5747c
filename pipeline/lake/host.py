"""A DuckDB of this process that catalogs are attached to: to start one takes seven times as long."""

from __future__ import annotations

import atexit
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from threading import Lock, local
from typing import TYPE_CHECKING, Any, Final

from motionlake import sql
from motionlake.errors import FULL
from motionlake.memory import MIB, for_duckdb

if TYPE_CHECKING:
    import duckdb


# What a writer holds would grow with the lake. 256 MiB are enough to enter the signatures of 142,220 clips.
MOST_TO_WRITE: Final = 512 * MIB


def elsewhere() -> dict[str, Any]:
    """The setting of a connection that keeps what memory has no room for out of the lake and of the current folder."""
    return {"temp_directory": str(Path(tempfile.gettempdir()) / f"motionlake-{os.getpid()}")}


class _Host:
    """A DuckDB with room for one catalog, which many may use at once."""

    def __init__(self, *, writable: bool) -> None:
        import duckdb

        # The cache would hold what was read before.
        bounds = for_duckdb(MOST_TO_WRITE if writable else None)
        settings: dict[str, Any] = {**elsewhere(), **bounds, "enable_external_file_cache": False}
        if writable:
            settings["threads"] = 1  # choices among equals do not depend on the machine, and memory stays small
        self.con = duckdb.connect(config=settings)
        self._attach = sql.read("attach_for_writing" if writable else "attach")
        self._catalog: tuple[Path, int] | None = None
        self.seen: tuple[int, int] = (0, 0)  # inode of the catalog's file, and when it was written
        self._users = 0
        self._lock = Lock()

    def enter(self, catalog: Path) -> bool:
        """Attach a catalog for one more user; False where another one is in use, or an earlier file of that name."""
        with self._lock:
            found = catalog.stat() if catalog.exists() else None
            now = (catalog, found.st_ino if found else 0)
            if self._users == 0:
                self.con.execute(self._attach, {"catalog": str(catalog)})
                self._catalog, self.seen = now, (found.st_ino, found.st_mtime_ns) if found else (0, 0)
            if self._catalog != now:
                return False
            self._users += 1
            return True

    def enter_again(self) -> None:
        """Let one more user in, who reads what another one does."""
        with self._lock:
            self._users += 1

    def leave(self) -> None:
        with self._lock:
            self._users -= 1
            if self._users == 0:
                self.con.execute(sql.read("detach"))


@cache
def _host(process: int, *, writable: bool) -> _Host:
    """That of this process: one that was forked cannot use its parent's."""
    return _Host(writable=writable)


_own: Final = local()  # of a thread, the hosts of the catalogs that it has open


atexit.register(_host.cache_clear)  # else DuckDB may tell of objects that are left


def seen_by_thread(catalog: Path) -> tuple[int, int] | None:
    """Inode, and time of writing in nanoseconds, of the file of a catalog that this thread has open for reading; None
    where it has none open."""
    host = _hosts_of_thread().get((catalog, False))
    return None if host is None else host.seen


def _hosts_of_thread() -> dict[tuple[Path, bool], _Host]:
    found: dict[tuple[Path, bool], _Host] = _own.__dict__.setdefault(f"hosts {os.getpid()}", {})
    return found


@contextmanager
def attached(catalog: Path, *, writable: bool = False) -> Iterator[duckdb.DuckDBPyConnection]:
    """A connection to a catalog as it stands, or as this thread sees it where it has one open.

    To attach a catalog that this process uses already takes no time.

    Raises:
        duckdb.Error: it cannot be opened.
    """
    mine = _hosts_of_thread()
    outer = mine.get((catalog, writable))
    host = outer or _host(os.getpid(), writable=writable)
    if outer is not None:
        outer.enter_again()
    elif not host.enter(catalog):
        host = _Host(writable=writable)
        host.enter(catalog)
    mine[catalog, writable] = host
    con = host.con.cursor()
    try:
        con.execute(sql.read("use_catalog"))
        yield con
    finally:
        con.close()
        host.leave()
        if outer is None:
            mine.pop((catalog, writable), None)


@contextmanager
def room(catalog: Path) -> Iterator[None]:
    """What DuckDB says of a full disk, as Python says it. Raises `OSError`."""
    import duckdb

    try:
        yield
    except duckdb.Error as error:
        for number in FULL:
            if os.strerror(number) in str(error):
                raise OSError(number, os.strerror(number), str(catalog)) from error
        raise
