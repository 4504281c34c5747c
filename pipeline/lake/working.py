"""The copy of the catalog that a command changes: transactions gather in it, and it is served now and then.

To serve a catalog is to copy, hash and sync all of it, however little has changed. So a command that may change it many
times does so in one copy, which takes the catalog's name when the command ends, and before that whenever the time since
it did so last is `RATIO` times what that takes. A small catalog is served after nearly every change.

The command itself reads what it has changed; all others read what is served.
"""

from __future__ import annotations

import os
import shutil
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeAlias

from motionlake.lake.catalog_file import announce_catalog, catalog_written, check_catalog
from motionlake.lake.host import attached, room, seen_by_thread
from motionlake.lake.layout import Lake
from motionlake.lake.parts import sync_folder
from motionlake.stopping import held

if TYPE_CHECKING:
    import duckdb

Version: TypeAlias = tuple[int | str, int]  # of a catalog; no other has the same
RATIO: Final = 20.0  # seconds between two times at which a catalog is served, by those that it takes
SPEED: Final = 200e6  # bytes a second at which a catalog is taken to be served before that was measured


@dataclass
class Working:
    """What a command has changed and not served.

    Attributes:
        lake: whose catalog it is.
        path: the copy; None where there is none since the catalog was served.
        changes: transactions in it.
        all_changes: transactions since the command began.
    """

    lake: Lake
    path: Path | None = None
    changes: int = 0
    all_changes: int = 0
    _served: float = field(default_factory=time.monotonic)
    _seconds: float | None = None  # that serving took last

    @contextmanager
    def transaction(self) -> Iterator[duckdb.DuckDBPyConnection]:
        """Change the copy: all of it where the block ends well, else nothing.

        Raises:
            DamagedError: the catalog that is served is not as it was written.
            duckdb.Error: the copy cannot be read or written; nothing of it will be served, for it may be broken.
        """
        import duckdb

        breaking = (duckdb.IOException, duckdb.FatalException, duckdb.InternalException)
        path, failed = self.path or self._begin(), None
        try:
            with attached(path, writable=True) as con:
                con.begin()
                try:
                    yield con
                except BaseException as error:
                    failed = error
                    raise
                con.commit()
                self.changes += 1
                self.all_changes += 1
                _checkpoint(con)
        except BaseException as error:
            if error is not failed or isinstance(error, breaking):
                self.discard()
            raise

    def _begin(self) -> Path:
        check_catalog(self.lake)
        catalog = self.lake.catalog
        self.path = catalog.with_name(f".{catalog.name}.{uuid.uuid4().hex[:12]}.tmp")
        try:
            shutil.copyfile(catalog, self.path)
        except BaseException:
            self.discard()
            raise
        return self.path

    def due(self) -> bool:
        """Whether what was changed has waited long enough."""
        if self.path is None or not self.changes:
            return False
        takes = self.path.stat().st_size / SPEED if self._seconds is None else self._seconds
        return time.monotonic() - self._served >= RATIO * takes

    def serve(self) -> None:
        """Let all read what was changed. Raises `OSError` where the disk is full; nothing is served then."""
        if self.path is None or not self.changes:
            self.discard()
            return
        started = time.monotonic()
        try:
            with attached(self.path, writable=True) as con:
                con.execute("CHECKPOINT")
            announce_catalog(self.lake, self.path)
            with self.path.open("rb") as handle:
                os.fsync(handle.fileno())
            self.path.replace(self.lake.catalog)
            sync_folder(self.lake.root)
        finally:
            self.discard()
        catalog_written(self.lake)
        self._served = time.monotonic()
        self._seconds = self._served - started

    def discard(self) -> None:
        """Forget what was not served."""
        path, self.path, self.changes = self.path, None, 0
        if path is not None:
            for each in (path, path.with_name(path.name + ".wal")):
                each.unlink(missing_ok=True)


def _checkpoint(con: duckdb.DuckDBPyConnection) -> None:
    """Write the copy's file; what others of this process still read waits until it is served."""
    import duckdb

    with suppress(duckdb.TransactionException):
        con.execute("CHECKPOINT")


@contextmanager
def deferred(lake: Lake) -> Iterator[Working]:
    """What changes in the block is served at its end, however it ends; in another such block at the end of that.

    The caller holds the lake's lock.
    """
    key = os.getpid(), lake.root
    if key in _working:
        yield _working[key]
        return
    work = _working[key] = Working(lake)
    try:
        yield work
    finally:
        try:
            serve(lake)
        finally:
            del _working[key]


def serve(lake: Lake) -> None:
    """Let all read what this process has changed."""
    work = _working.get((os.getpid(), lake.root))
    if work is not None:
        with held(), room(lake.catalog):
            work.serve()


def working_copy(lake: Lake) -> Path | None:
    """The copy that this process has changed; None where it reads what is served."""
    work = _working.get((os.getpid(), lake.root))
    return work.path if work is not None and work.changes else None


def version(lake: Lake) -> Version:
    """What tells the catalog that this thread reads now from those before it."""
    path = working_copy(lake)
    if path is None:
        return seen_by_thread(lake.catalog) or lake.served()
    return path.name, _working[os.getpid(), lake.root].all_changes


_working: Final[dict[tuple[int, Path], Working]] = {}  # by process, since one that was forked has none
