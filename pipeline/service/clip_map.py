"""The map of all clips, made once of each catalog."""

from __future__ import annotations

from typing import Annotated, Any, Final

import numpy as np
from fastapi import APIRouter, Query, Request
from motionlake.arrays import Float32Array, Float64Array
from motionlake.lake.catalog import reading
from motionlake.service.errors import ServiceError
from motionlake.service.library import SHOWN
from motionlake.service.places import clusters, places
from motionlake.service.served import Served, annotations_of, serving_of

router = APIRouter(prefix="/api", tags=["map"])
_COLOURS: Final = (*SHOWN[1:], "tags")


@router.get("/map")
def clip_map(request: Request, colour: Annotated[str, Query(max_length=40)] = "label") -> dict[str, Any]:
    """Every clip as a point of a plane, with the value of a column, and the names of what lies together."""
    if colour not in _COLOURS:
        raise ServiceError(400, f"colour: is one of {', '.join(_COLOURS)}")
    served = serving_of(request).now()
    made = served.later("map", lambda: _places(served))
    if made is None:
        return {"ready": False, "points": [], "clips": [], "values": [], "clusters": []}
    names, points = made
    library = served.library
    rows = np.array([library.places[name] for name in names if name in library.places], np.int64)
    tags = annotations_of(request).tags() if colour == "tags" else {}
    values: list[Any]
    if colour == "tags":
        values = [", ".join(sorted(tags.get(name, ()))) or None for name in names]
    else:
        values = library.rows.column(colour).take(rows).to_pylist()
    return {
        "ready": True,
        "points": np.round(points, 4).tolist(),
        "clips": names,
        "values": values,
        "clusters": served.keep("clusters", lambda: _clusters(served, names, points)),
    }


def _places(served: Served) -> tuple[list[str], Float64Array]:
    names, vectors = _vectors(served)
    return names, places(vectors, names)


def _vectors(served: Served) -> tuple[list[str], Float32Array]:
    """The descriptors of clips, or their signatures where there are none."""
    from motionlake.lake.corpus import read_descriptors, read_signatures

    with reading(served.lake) as con:
        clips, vectors = read_descriptors(con)
        if not clips:
            _, clips, vectors = read_signatures(con)
    known = [i for i, clip in enumerate(clips) if clip.clip in served.library.places]
    if not known:
        raise ServiceError(
            409, "the lake has neither descriptors nor signatures yet; make them with `motionlake run all`"
        )
    return [clips[i].clip for i in known], np.asarray(vectors, np.float32)[known]


def _clusters(served: Served, names: list[str], points: Float64Array) -> list[dict[str, Any]]:
    rows = np.array([served.library.places[name] for name in names], np.int64)
    labels = served.library.rows.column("label").take(rows).to_pylist()
    datasets = served.library.rows.column("dataset").take(rows).to_pylist()
    return clusters(points, labels, datasets)
