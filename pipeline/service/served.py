"""What all requests share of a lake: its clips in memory, a connection for conditions, and warm searchers.

A run puts another catalog in the place of the one that is served. What was read of the one before goes on answering
until the same was read of the new one.
"""

from __future__ import annotations

import logging
import os
from collections import OrderedDict
from collections.abc import Callable, Iterator
from concurrent.futures import Future, wait
from contextlib import AbstractContextManager, contextmanager, suppress
from threading import Lock
from typing import Any, Final, TypeVar

from fastapi import Request
from motionlake import api, sql
from motionlake.errors import UserError, told_by_sql
from motionlake.kernels import expect_many
from motionlake.lake.annotations import Annotations
from motionlake.lake.catalog import Connection, fetch, fetch_table, reading
from motionlake.lake.layout import Lake
from motionlake.lake.safe import LakeConnection, time_limit
from motionlake.retrieval.fused import FusedSearcher
from motionlake.retrieval.hits import Hit
from motionlake.retrieval.protocol import Finds, Query, Searcher
from motionlake.service.background import end_background, in_background
from motionlake.service.errors import ServiceError
from motionlake.service.options import Options
from motionlake.service.shelf import Shelf
from motionlake.service.turns import Turns

T = TypeVar("T")
KEPT: Final = 64  # answers to conditions in SQL
ANSWERS: Final = 500  # to searches
PATIENCE: Final = 4.0  # seconds that a request waits for what takes long
LONGEST: Final = 4000  # characters of a condition
GOODBYE: Final = 5.0  # seconds that what is done in the background may take when the service ends
_LOG: Final = logging.getLogger("motionlake.service")


class Served:
    """One catalog of a lake, read once."""

    def __init__(self, lake: Lake, options: Options) -> None:
        self.lake, self._options, self.served = lake, options, lake.served()
        self.generation = f"{self.served[0]:x}-{self.served[1]:x}"
        with reading(lake) as con:
            verdicts = {}
            if fetch(con, "view_is_there", {"view": "quality"})[0]["there"]:
                verdicts = {row["clip"]: row["verdict"] for row in fetch(con, "shelf_verdicts")}
            self.shelf = Shelf(fetch_table(con, "shelf"), verdicts)
        self._kept: dict[object, Any] = {}
        self._making: dict[object, Lock] = {}
        self._started: dict[object, Future[Any]] = {}
        self._lock = Lock()
        self._conditions: OrderedDict[str, frozenset[str]] = OrderedDict()
        self._answers: OrderedDict[str, list[Hit]] = OrderedDict()
        self._turns = Turns(options.search_seconds)  # searchers share kernels and what they remember

    @property
    def con(self) -> LakeConnection:
        """The connection whose cursors requests use; its functions in SQL take a second to import."""
        from motionlake.retrieval.sql_functions import connect

        return self.keep("con", lambda: connect(self.lake.root, memory=self._options.memory))

    def warm_up(self) -> None:
        """Read what the first condition and the first default search need."""
        expect_many()
        with suppress(Exception):  # a lake that is not ready for search says so to who searches
            self.con  # noqa: B018 - opens it
            if self.shelf.names:
                searcher = self.searcher("clip", "fused", explain=True, matched=False)
                with self.searching():
                    searcher.search([Query(self.shelf.names[0])], 1)
                if isinstance(searcher, FusedSearcher):
                    searcher.warm_up()

    def keep(self, key: object, make: Callable[[], T]) -> T:
        """What was made for a key, made when first asked for and once."""
        if key not in self._kept:
            with self._lock:
                making = self._making.setdefault(key, Lock())
            with making:
                if key not in self._kept:
                    self._kept[key] = make()
        kept: T = self._kept[key]
        return kept

    def answered(self, key: str, ask: Callable[[], list[Hit]]) -> list[Hit]:
        """The answers to a question; the last ones are kept, for people go back and forth."""
        found = self._answers.get(key)
        if found is None:
            found = self._answers[key] = ask()
            with self._lock:
                while len(self._answers) > ANSWERS:
                    self._answers.popitem(last=False)
        return found

    def later(self, key: object, make: Callable[[], T]) -> T | None:
        """The same for what takes long: None while it is being made, which goes on meanwhile."""
        with self._lock:
            if key not in self._started:
                future: Future[Any] = Future()
                self._started[key] = future
                in_background(_made, future, make)
            future = self._started[key]
        if not wait((future,), PATIENCE).done:
            return None
        failed = future.exception()
        if failed is not None:
            with self._lock:
                self._started.pop(key, None)  # the next request tries again
            raise failed
        made: T = future.result()
        return made

    def api(self) -> api.Lake:
        """The lake as programs have it; whoever uses it takes a turn (`searching`)."""
        return self.keep("api", lambda: api.Lake(self.lake.root))

    def searcher(self, finds: Finds, name: str, /, **how: Any) -> Searcher:
        """A way to search, which all requests share."""
        from motionlake.retrieval.registry import searcher

        return self.keep((finds, name, *sorted(how.items())), lambda: searcher(finds, name, self.lake, **how))

    def searching(self, *, alone: bool = True) -> AbstractContextManager[None]:
        """A turn to search. Raises `ServiceError` where others search for too long."""
        return self._turns.turn(alone=alone)

    @contextmanager
    def cursor(self) -> Iterator[Connection]:
        """A connection to the catalog for statements of this program."""
        with self.con.cursor() as con:
            yield con.own

    def clips_of_condition(self, condition: str) -> frozenset[str]:
        """The clips that a condition in SQL is true of; it can read the lake and nothing else.

        Raises:
            ServiceError: it is no condition, is too long, or takes too long or too much memory.
        """
        if len(condition) > LONGEST:
            raise ServiceError(413, f"where: is longer than {LONGEST} characters")
        found = self._conditions.get(condition)
        if found is None:
            found = self._conditions[condition] = self._asked(condition)
            with self._lock:
                while len(self._conditions) > KEPT:
                    self._conditions.popitem(last=False)
        return found

    def _asked(self, condition: str) -> frozenset[str]:
        import duckdb

        seconds = self._options.seconds
        with self.con.cursor() as con:
            try:
                with time_limit(con, seconds):
                    ((known,),) = con.execute(sql.read("has_view"), {"view": "quality"}).fetchall()
                    query = sql.read("clips_with_quality" if known else "clips_of_dataset")
                    found = con.sql(query, params={"dataset": None}).filter(condition).project("clip").fetchall()
            except duckdb.OutOfMemoryException as error:
                raise ServiceError(503, f"where: needs more than the {self._options.memory} that there is") from error
            except duckdb.Error as error:
                raise ServiceError(400, f"where: {told_by_sql(str(error))}") from error
            except UserError as error:
                if isinstance(error.__cause__, duckdb.InterruptException):
                    raise ServiceError(503, f"where: stopped after {seconds:g} s") from error
                raise
        return frozenset(clip for (clip,) in found)

    def close(self) -> None:
        """Let go of the catalog."""
        con = self._kept.pop("con", None)
        self._kept.clear()
        if con is not None:
            con.close()


def _made(future: Future[Any], make: Callable[[], Any]) -> None:
    try:
        future.set_result(make())
    except BaseException as error:
        future.set_exception(error)


class Serving:
    """The catalog of a lake that is served now."""

    def __init__(self, lake: Lake, options: Options) -> None:
        self.lake, self.options = lake, options
        self._now = Served(lake, options)
        self._refreshing = Lock()
        if options.warm:
            in_background(self._now.warm_up)

    def now(self) -> Served:
        """What was read of the catalog; where there is a newer one, that is read meanwhile."""
        if self.stale() and self._refreshing.acquire(blocking=False):
            in_background(self._refresh)
        return self._now

    def stale(self) -> bool:
        """Whether the lake has another catalog by now."""
        try:
            return self.lake.served() != self._now.served
        except OSError:
            return False  # between two catalogs, or the folder is gone: what was read goes on answering

    def _refresh(self) -> None:
        try:
            new = Served(self.lake, self.options)
            if self.options.warm:
                new.warm_up()
            self._now = new  # the one before goes with the last request that uses it
        except Exception as error:
            _LOG.error("the new catalog cannot be read: %s", error)
        finally:
            self._refreshing.release()

    def close(self) -> None:
        """Let go of the catalog, after what is done beside it, unless that takes long."""
        end_background(GOODBYE)
        self._now.close()


def serving_of(request: Request) -> Serving:
    """What all requests share."""
    serving: Serving = request.app.state.serving
    return serving


def annotations_of(request: Request) -> Annotations:
    """What people decided."""
    annotations: Annotations = request.app.state.annotations
    return annotations


def threads() -> int:
    """How many requests are answered at once."""
    return max(8, 2 * (os.cpu_count() or 1))
