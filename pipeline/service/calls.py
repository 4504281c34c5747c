"""The methods of the Python library over HTTP: arguments as JSON in, rows and frames as Arrow out."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import pyarrow as pa
from fastapi import APIRouter, Request, Response
from motionlake.errors import UserError, told_by_sql
from motionlake.lake.catalog import fetch
from motionlake.lake.frames import CHANNELS, read_rows
from motionlake.lake.integrity import sound
from motionlake.lake.resolve import resolve_clip
from motionlake.lake.safe import LakeConnection, time_limit
from motionlake.service.clips import plain
from motionlake.service.errors import ServiceError
from motionlake.service.motion import Clip
from motionlake.service.served import Served, serving_of
from pydantic import BaseModel, ConfigDict, Field

router = APIRouter(prefix="/api", tags=["library"])
ARROW: Final = "application/vnd.apache.arrow.stream"
MOST_BYTES: Final = 256 << 20  # of rows of one answer
MOST: Final = 10_000  # answers to a search
_SCOPE: Final = ("dataset", "split", "recorded_only", "min_quality", "mirrored", "own", "below")
# What may be given to each method; no file of this machine is among it.
_TAKES: Final = {
    "search": ("query", "k", "start", "stop", "method", "text", *_SCOPE),
    "find": ("query", "start", "stop", "k", "method", *_SCOPE),
    "align": ("query", "start", "stop", "k", "method", "stride", "gaps", "boundaries", "path", "whole", "ways",
              "window", *_SCOPE),
    "suggest_labels": ("dataset", "column", "min_quality"),
}  # fmt: skip
# What of a clip its frames do not say.
FACTS: Final = ("rest_offsets", "body_height", "twist", "filled", "fk_error", "notes")


class Call(BaseModel):
    """A method of `motionlake.Lake` and its arguments; `upload` stands for a query that is a file."""

    model_config = ConfigDict(extra="forbid")
    method: str = Field(max_length=40)
    arguments: dict[str, Any] = Field(default_factory=dict)
    upload: str | None = Field(None, max_length=64)


class Sql(BaseModel):
    """A query in SQL, or a condition that clips meet."""

    model_config = ConfigDict(extra="forbid")
    text: str | None = Field(None, max_length=100_000)
    parameters: dict[str, Any] | list[Any] | None = None
    where: str | None = Field(None, max_length=4000)
    equal: dict[str, str | float | bool | None] = Field(default_factory=dict)


@router.post("/call", response_class=Response)
def call(request: Request, asked: Call) -> Response:
    """The rows that a method of the Python library answers, as an Arrow stream."""
    if asked.method not in _TAKES:
        raise ServiceError(400, f"{asked.method}: is not asked of a service; it answers {', '.join(sorted(_TAKES))}")
    wrong = sorted(set(asked.arguments) - set(_TAKES[asked.method]))
    if wrong:
        raise ServiceError(400, f"{asked.method}: takes no {wrong[0][:40]} here")
    served, arguments = serving_of(request).now(), dict(asked.arguments)
    if not isinstance(arguments.get("k", 1), int) or arguments.get("k", 1) > MOST:
        raise ServiceError(400, f"k: is a number, {MOST} at most")
    if asked.upload is not None:
        arguments["query"] = request.app.state.uploads.path(asked.upload)
    elif arguments.get("query") is not None:
        with served.cursor() as con:
            arguments["query"] = resolve_clip(con, str(arguments["query"]))
        if arguments["query"].startswith(("/", "./", "../")):
            raise ServiceError(400, "query: name a clip of the lake")
    with served.searching():
        try:
            rows = getattr(served.api(), asked.method)(**arguments)
        except TypeError as error:
            raise ServiceError(400, f"{asked.method}: {error}") from error
    return streamed(rows.arrow().schema, rows.arrow().to_batches())


@router.post("/sql", response_class=Response)
def sql(request: Request, asked: Sql) -> Response:
    """What a query in SQL answers, or the rows of `clips` that a condition is true of, as an Arrow stream.

    It reads the lake alone, for some seconds and within some memory."""
    served, seconds = serving_of(request).now(), serving_of(request).options.seconds
    with served.con.cursor() as con, _told(seconds), time_limit(con, seconds):
        found = _clips(con, asked) if asked.text is None else con.sql(asked.text, params=asked.parameters)
        if found is None:
            raise ServiceError(400, "sql: there is no statement in the text")
        reader = found.to_arrow_reader()
        return streamed(reader.schema, reader)


def _clips(con: LakeConnection, asked: Sql) -> Any:
    import duckdb

    found = con.own.table("clips")
    for name, value in asked.equal.items():
        if name not in found.columns:
            raise ServiceError(400, f"clips: have no column {name[:80]}; they have {', '.join(found.columns)}")
        column = duckdb.ColumnExpression(name)
        found = found.filter(column.isnull() if value is None else column == duckdb.ConstantExpression(value))
    return (found if asked.where is None else found.filter(asked.where)).order("clip")


@contextmanager
def _told(seconds: float) -> Iterator[None]:
    """DuckDB's errors as those of a request."""
    import duckdb

    try:
        yield
    except duckdb.OutOfMemoryException as error:
        raise ServiceError(503, "SQL: needs more memory than the service gives") from error
    except duckdb.Error as error:
        raise ServiceError(400, f"SQL: {told_by_sql(str(error))}") from error
    except UserError as error:
        if isinstance(error.__cause__, duckdb.InterruptException):
            raise ServiceError(503, f"SQL: stopped after {seconds:g} s") from error
        raise


@router.get("/clip/frames", response_class=Response)
def frames(request: Request, clip: Clip) -> Response:
    """All that is stored of the frames of a clip, as an Arrow stream; what else its motion has is in the metadata."""
    served = serving_of(request).now()
    with served.cursor() as con:
        name = resolve_clip(con, clip)
        known = fetch(con, "clip", {"clip": name})[0]
    table = _stored(served, name)
    facts = json.dumps({"clip": name, **{each: plain(known[each]) for each in FACTS}})
    return streamed(table.schema.with_metadata({"motion": facts}), table.to_batches())


def _stored(served: Served, clip: str) -> pa.Table:
    row = served.shelf.of([clip])[0]
    path = sound(served.lake, served.lake.frames_part(row["dataset"], row["part"]))
    return next(rows for _, rows in read_rows(path, [clip], ("fps", *CHANNELS)))


def streamed(schema: pa.Schema, batches: Any) -> Response:
    """Batches of rows as an answer. Raises `ServiceError` where they are too many."""
    sink, size = pa.BufferOutputStream(), 0
    with pa.ipc.new_stream(sink, schema) as writer:
        for batch in batches:
            size += batch.nbytes
            if size > MOST_BYTES:
                raise ServiceError(
                    413, f"the answer is larger than {MOST_BYTES >> 20} MiB; ask for fewer rows or columns"
                )
            writer.write_batch(batch)
    return Response(sink.getvalue().to_pybytes(), media_type=ARROW)
