"""What `motionlake search` and `find` ask of a service that runs: the same answers as theirs, from warm searchers."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, Literal

from fastapi import APIRouter, Request, Response
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.resolve import resolve_clip
from motionlake.retrieval.hits import Hit
from motionlake.retrieval.named_ranges import frame_at
from motionlake.retrieval.protocol import Query, Scope, Searcher
from motionlake.service.calls import MOST
from motionlake.service.errors import ServiceError
from motionlake.service.served import Served, serving_of
from pydantic import BaseModel, ConfigDict, Field

if TYPE_CHECKING:
    from motionlake.retrieval.text import LakeText
    from motionlake.retrieval.text_example import ExampleAndText

router = APIRouter(prefix="/api", tags=["library"])
QUERIES = 100
Name = Annotated[str, Field(max_length=2000)]


class Place(BaseModel):
    """A frame, or seconds."""

    model_config = ConfigDict(extra="forbid")
    value: float = Field(ge=0, le=2**40, allow_inf_nan=False)
    in_seconds: bool

    def frame(self, fps: float) -> int:
        return frame_at(self.value, fps, in_seconds=self.in_seconds)


class Among(BaseModel):
    """As `motionlake.retrieval.protocol.Scope`."""

    model_config = ConfigDict(extra="forbid")
    dataset: Annotated[str | None, Field(max_length=200)] = None
    split: Annotated[str | None, Field(max_length=200)] = None
    recorded_only: bool = False
    mirrored: bool = False
    own: bool = False
    min_quality: Annotated[str | None, Field(max_length=40)] = None
    below: float | None = None


class Command(BaseModel):
    """What a command of the command line asks.

    `catalog` is the one that it sees: the answer is of that, or there is none.
    """

    model_config = ConfigDict(extra="forbid")
    catalog: tuple[int, int]
    finds: Literal["clip", "range"]
    clips: list[Name] = Field(max_length=QUERIES)
    start: Place | None = None
    stop: Place | None = None
    k: int = Field(ge=1, le=MOST)
    method: str = Field(max_length=40)
    explain: bool = False
    text: str | None = Field(None, max_length=10_000)
    scope: Among = Among()


@router.post("/command", response_class=Response)
def command(request: Request, asked: Command) -> Response:
    """The rows that `motionlake search` or `find` prints, for each clip, with what it says beside them."""
    serving = serving_of(request)
    served = serving.now()
    if served.served != asked.catalog or serving.stale():
        raise ServiceError(409, "another catalog is served")
    scope = Scope(**asked.scope.model_dump())
    with served.cursor() as con:
        queries = [_query(con, name, asked) for name in asked.clips]
    with served.searching():
        found, notices = _answers(served, queries, scope, asked)
    told = {
        "clips": [query.name for query in queries],
        "answers": [[hit.as_row() for hit in hits] for hits in found],
        "notices": notices,
    }
    if serving.stale():
        raise ServiceError(409, "another catalog is served")
    return Response(json.dumps(told, default=str), media_type="application/json")


def _query(con: Connection, name: str, asked: Command) -> Query:
    """A clip of the lake, and never a file of this machine."""
    if name.startswith(("/", "./", "../")):
        raise ServiceError(400, "clips: name clips of the lake")
    clip = resolve_clip(con, name)
    fps = fetch(con, "clip", {"clip": clip})[0]["fps"]
    first, last = (None if place is None else place.frame(fps) for place in (asked.start, asked.stop))
    return Query(clip, first, last)


def _answers(
    served: Served, queries: Sequence[Query], scope: Scope, asked: Command
) -> tuple[Sequence[Sequence[Hit]], list[str]]:
    """The answers to each query, or those to a text alone, and why methods were left out."""
    if not queries:
        if asked.text is None or asked.finds != "clip":
            raise ServiceError(400, "clips: there is none")
        return [_text(served).search(asked.text, asked.k, scope)], []
    fused = (asked.finds, asked.method) == ("clip", "fused")
    # Shares are always told: one searcher answers both, which is the one that pages ask.
    how: dict[str, Any] = {"explain": True, "matched": asked.explain} if fused else {}
    if asked.explain and not fused:
        raise ServiceError(400, "explain: is for method fused")
    searcher: Searcher = served.searcher(asked.finds, asked.method, **how)
    found = _ranking(served, searcher, asked).search(queries, asked.k, scope)
    if fused and not asked.explain:
        found = [[replace(hit, shares=None) for hit in hits] for hits in found]
    left_out: dict[str, list[str]] = getattr(searcher, "left_out", {})
    return found, [reason for query in queries for reason in left_out.get(query.name, [])]


def _ranking(served: Served, searcher: Searcher, asked: Command) -> Searcher | ExampleAndText:
    if asked.text is None:
        return searcher
    from motionlake.retrieval.text_example import ExampleAndText

    return ExampleAndText(searcher, _text(served), asked.text, explain=asked.explain)


def _text(served: Served) -> LakeText:
    from motionlake.retrieval.text import LakeText

    return served.keep("text", lambda: LakeText(served.lake, None))
