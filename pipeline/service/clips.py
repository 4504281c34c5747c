"""The clips of a lake: all of them by filters, how many have which value, and one with all that is known of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Query, Request
from motionlake.lake.catalog import fetch
from motionlake.retrieval.registry import SEARCHERS, ready
from motionlake.service.errors import ServiceError
from motionlake.service.motion import Clip
from motionlake.service.search import nearest
from motionlake.service.served import Served, annotations_of, serving_of
from motionlake.service.shelf import FACETS, Filter

router = APIRouter(prefix="/api", tags=["clips"])
Values = Annotated[list[str], Query(max_length=200)]
Seconds = Annotated[float | None, Query(ge=0, le=1e9)]
MOST: int = 1000
TITLES = {
    "fused": "All methods together", "signature": "Motifs", "alignment": "Postures in order", "moves": "Moves",
    "descriptor": "Descriptor", "words": "Words", "submotion": "Sub-motions",
}  # fmt: skip


def filtered(
    request: Request,
    where: Annotated[str, Query(description="A condition in SQL over the columns of clips.")] = "",
    text: Annotated[str, Query(max_length=200, description="Words that its name, labels or licence hold.")] = "",
    shortest: Annotated[float | None, Query(alias="seconds_from", ge=0, le=1e9)] = None,
    longest: Annotated[float | None, Query(alias="seconds_to", ge=0, le=1e9)] = None,
) -> Filter:
    """What an address says of the clips that are meant; facets are parameters of their names."""
    given = request.query_params
    chosen = {name: given.getlist(name) for name in FACETS if name in given}
    if sum(map(len, chosen.values())) > 500:
        raise ServiceError(413, "more than 500 values of facets")
    among = serving_of(request).now().clips_of_condition(where) if where.strip() else None
    return Filter(chosen, text, shortest, longest, among)


Chosen = Annotated[Filter, Depends(filtered)]


@router.get("/lake")
def lake(request: Request) -> dict[str, Any]:
    """What the lake is called and holds, and what can be asked of it."""
    serving = serving_of(request)
    served = serving.now()
    shelf = served.shelf
    return {
        "name": serving.lake.root.name,
        "version": _version(),
        "clips": len(shelf.names),
        "seconds": shelf.seconds,
        "datasets": shelf.datasets,
        "facets": [{"column": name, "title": title} for name, title in FACETS.items()],
        "search_methods": _methods(served),
        "exports": request.app.state.exports,
        "read_only": serving.options.read_only,
        "generation": served.generation,
    }


def _version() -> str:
    try:
        return version("motionlake")
    except PackageNotFoundError:
        return "unknown"


def _methods(served: Served) -> list[dict[str, Any]]:
    there = {finds: served.keep(("ready", finds), lambda f=finds: ready(served.lake, f)) for finds in SEARCHERS}  # type: ignore[misc]
    return [
        {"name": name, "title": TITLES.get(name, name), "finds": finds, "ready": name in there[finds]}
        for finds, known in SEARCHERS.items()
        for name in known
    ]


@router.get("/clips")
def clips(
    request: Request,
    chosen: Chosen,
    offset: Annotated[int, Query(ge=0, le=2**40)] = 0,
    limit: Annotated[int, Query(ge=0, le=MOST)] = 100,
    sort: Annotated[str, Query(max_length=40)] = "clip",
    descending: bool = False,
) -> dict[str, Any]:
    """Some of the clips that a filter lets through, in order."""
    shelf, tags = serving_of(request).now().shelf, annotations_of(request).tags()
    mask = shelf.mask(chosen, tags)
    rows = shelf.page(mask, tags, offset, limit, sort, descending=descending)
    return {"total": int(mask.sum()), "offset": offset, "clips": rows}


@router.get("/facets")
def facets(request: Request, chosen: Chosen) -> dict[str, list[dict[str, Any]]]:
    """How many clips have which value of each facet, and a histogram of lengths."""
    return serving_of(request).now().shelf.facets(chosen, annotations_of(request).tags())


@router.get("/clip")
def clip(
    request: Request,
    clip: Clip,
    near: Annotated[int, Query(ge=0, le=50, description="How many of the nearest clips; none without.")] = 0,
) -> dict[str, Any]:
    """A clip and what is known of it."""
    served, annotations = serving_of(request).now(), annotations_of(request)
    row = served.shelf.of([clip])[0]
    del row["part"]
    with served.cursor() as con:
        known = fetch(con, "clip", {"clip": clip})[0]
        lineage = next(iter(fetch(con, "synthetic_clip", {"clip": clip})), None)
        segments = fetch(con, "segments_of_clip", {"clip": clip})
        faults = faults_of(con, clip)
    licences = [known["licence"]] if known["licence"] else list(lineage["licences"]) if lineage else []
    return {
        **row,
        "tags": sorted(annotations.tags().get(clip, ())),
        "lineage": plain(lineage) if lineage else {},
        "licence": {"licences": licences, "dataset": row["dataset"]},
        "labels": {
            **dict(known["attributes"]),
            "label": row["label"],
            "subject": row["subject"],
            "split": known["split"],
        },
        "segments": segments,
        "file": {name: plain(known[name]) for name in ("path", "format", "rig", "notes", "repaired", "filled")},
        "faults": faults,
        "annotations": [each.as_row() for each in annotations.current(clip)],
        "near": nearest(served, clip, near) if near else [],
    }


def faults_of(con: Any, clip: str) -> list[dict[str, Any]]:
    """What stage "quality" found in a clip; nothing where it has not run."""
    if not fetch(con, "view_is_there", {"view": "quality_ranges"})[0]["there"]:
        return []
    return [plain(row) for row in fetch(con, "faults_of_clip", {"clip": clip})]


def plain(value: Any) -> Any:
    """A value as JSON has it: numbers that are none become null."""
    if isinstance(value, Mapping):
        return {str(name): plain(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
