"""What people decide about clips: entered, taken back, and given out as labels.csv and segments.csv."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import Annotated, Any, Final, Literal

from fastapi import APIRouter, Query, Request, Response
from motionlake.lake.annotations import LONGEST, Annotation, new_annotation
from motionlake.lake.catalog import fetch
from motionlake.lake.frames import frame_range
from motionlake.service.errors import ServiceError
from motionlake.service.served import Served, annotations_of, serving_of
from pydantic import BaseModel, ConfigDict, Field

router = APIRouter(prefix="/api", tags=["annotations"])
MOST: Final = 20_000  # clips of one request
_SHOWN: Final = 10_000  # annotations of one answer
_FORMULA: Final = ("=", "+", "-", "@", "\t", "\r")  # which a spreadsheet would run


class AnnotationRequest(BaseModel):
    """What a person decided about some clips, or frames [from, to) of one."""

    model_config = ConfigDict(extra="forbid")
    clips: list[str] = Field(min_length=1, max_length=MOST)
    kind: Literal["tag", "label", "segment", "accept", "reject", "duplicate", "fault"]
    value: str = Field(min_length=1, max_length=LONGEST)
    first: int | None = Field(None, alias="from", ge=0, le=2**40)
    last: int | None = Field(None, alias="to", ge=0, le=2**40)
    who: str = Field("", max_length=200)


@router.get("/annotations")
def decided(
    request: Request,
    clip: Annotated[str | None, Query(max_length=2000)] = None,
    kind: Annotated[str | None, Query(max_length=20)] = None,
    undone: Annotated[bool, Query(description="Those that were taken back, too.")] = False,
    limit: Annotated[int, Query(ge=1, le=_SHOWN)] = 1000,
) -> dict[str, Any]:
    """What was decided, the newest first."""
    found = [
        each
        for each in annotations_of(request).all()
        if clip in (None, each.clip) and kind in (None, each.kind) and (undone or each.undone_at is None)
    ]
    return {"total": len(found), "annotations": [each.as_row() for each in reversed(found[-limit:])]}


@router.post("/annotations")
def annotate(request: Request, asked: AnnotationRequest) -> dict[str, list[str]]:
    """Enter a decision; it is kept in the lake beside what came from the source, and no ingest or run loses it."""
    served = writable(request)
    rows = served.shelf.of(asked.clips)
    if asked.first is not None or asked.last is not None:
        if len(rows) != 1:
            raise ServiceError(400, "annotation: frames are of one clip")
        frame_range(asked.clips[0], asked.first, asked.last, rows[0]["frames"])
    new = [new_annotation(clip, asked.kind, asked.value, asked.first, asked.last, asked.who) for clip in asked.clips]
    annotations_of(request).add(new)
    return {"ids": [each.id for each in new]}


@router.delete("/annotations")
def undo(request: Request, id: Annotated[list[str], Query(max_length=MOST)]) -> dict[str, list[str]]:  # noqa: A002
    """Take decisions back; they stay in the lake as undone."""
    writable(request)
    annotations_of(request).undo(id)
    return {"undone": id}


@router.get("/annotations/export", response_class=Response)
def export(
    request: Request,
    kind: Annotated[Literal["labels", "segments"], Query()],
    dataset: Annotated[str | None, Query(max_length=200)] = None,
) -> Response:
    """The labels, or the segments, that people gave, as CSV that `motionlake ingest` takes: of one source folder."""
    served, known = serving_of(request).now(), annotations_of(request)
    wanted = (
        known.current(kind="label") + known.current(kind="tag") if kind == "labels" else known.current(kind="segment")
    )
    files = _files(served, {each.clip for each in wanted}, dataset)
    text = _labels(wanted, files) if kind == "labels" else _segments(wanted, files)
    named = {"Content-Disposition": f'attachment; filename="{kind}.csv"'}
    return Response(text, media_type="text/csv; charset=utf-8", headers=named)


def writable(request: Request) -> Served:
    """What is served, where it may be written to. Raises `ServiceError` where it may not."""
    serving = serving_of(request)
    if serving.options.read_only:
        raise ServiceError(403, "this service is read-only")
    return serving.now()


def _files(served: Served, clips: set[str], dataset: str | None) -> dict[str, str]:
    """The file of each clip, as a labels.csv in its source folder names it."""
    with served.cursor() as con:
        rows = [row for row in fetch(con, "labels_of_files") if row["clip"] in clips]
    places = served.shelf.of([row["clip"] for row in rows])
    rows = [row for row, place in zip(rows, places, strict=True) if dataset in (None, place["dataset"])]
    if len({row["root"] for row in rows}) > 1:
        raise ServiceError(400, "the clips come from several source folders, and a CSV is for one; choose a dataset")
    return {row["clip"]: row["path"] for row in rows}


def _labels(found: Sequence[Annotation], files: dict[str, str]) -> str:
    rows: dict[str, dict[str, str]] = {}
    tags: dict[str, set[str]] = {}
    for each in (each for each in found if each.clip in files):
        row = rows.setdefault(files[each.clip], {"label": "", "who": "", "made_at": ""})
        if each.kind == "tag":
            tags.setdefault(files[each.clip], set()).add(each.value)
        elif each.made_at >= row["made_at"]:  # the newest label of a file counts
            row |= {"label": each.value, "who": each.who, "made_at": each.made_at}
    cells = (
        [file, row["label"], ";".join(sorted(tags.get(file, ()))), row["who"], row["made_at"]]
        for file, row in rows.items()
    )
    return _csv(["file", "label", "tags", "who", "made_at"], sorted(cells))


def _segments(found: Sequence[Annotation], files: dict[str, str]) -> str:
    known = sorted(
        (files[each.clip], each.start or 0, each.stop or 0, each.value) for each in found if each.clip in files
    )
    return _csv(
        ["file", "start", "stop", "label"], [[file, str(start), str(stop), label] for file, start, stop, label in known]
    )


def _csv(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([[f"'{cell}" if cell.startswith(_FORMULA) else cell for cell in row] for row in rows])
    return text.getvalue()
