"""The map of all clips, read from the lake or made once of each catalog."""

from __future__ import annotations

from typing import Annotated, Any, Final

import numpy as np
from fastapi import APIRouter, Query, Request
from motionlake.arrays import Float64Array
from motionlake.columns import numbers
from motionlake.deep_motifs.clip_map import places
from motionlake.lake.catalog import fetch_table
from motionlake.lake.config import load_config
from motionlake.service.errors import ServiceError
from motionlake.service.places import clusters
from motionlake.service.served import Served, annotations_of, serving_of
from motionlake.service.shelf import SHOWN
from motionlake.stages.clip_map import CLIP_MAP, clip_vectors
from motionlake.stages.reader import lake_reader

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
    shelf = served.shelf
    rows = np.array([shelf.places[name] for name in names if name in shelf.places], np.int64)
    tags = annotations_of(request).tags() if colour == "tags" else {}
    values: list[Any]
    if colour == "tags":
        values = [", ".join(sorted(tags.get(name, ()))) or None for name in names]
    else:
        values = shelf.rows.column(colour).take(rows).to_pylist()
    return {
        "ready": True,
        "points": np.round(points, 4).tolist(),
        "clips": names,
        "values": values,
        "clusters": served.keep("clusters", lambda: _clusters(served, names, points)),
    }


def _places(served: Served) -> tuple[list[str], Float64Array]:
    """That of the lake where stage "map" has made it of the lake as it stands, else one made now."""
    config = load_config(served.lake.config_file)
    with lake_reader(served.lake, config) as at:
        shard = CLIP_MAP.whole(at)
        if shard is None:
            raise ServiceError(
                409, "the lake has neither descriptors nor signatures yet; make them with `motionlake run all`"
            )
        if CLIP_MAP.due(at) == 0:
            rows = fetch_table(at.con, "map_of_clips")
            names, points = rows["clip"].to_pylist(), np.column_stack([numbers(rows[axis]) for axis in ("x", "y")])
        else:
            names, vectors = clip_vectors(at.con, shard.spec["source"])
            points = places(vectors, names)
    known = [i for i, name in enumerate(names) if name in served.shelf.places]
    return [names[i] for i in known], points[known]


def _clusters(served: Served, names: list[str], points: Float64Array) -> list[dict[str, Any]]:
    rows = np.array([served.shelf.places[name] for name in names], np.int64)
    labels = served.shelf.rows.column("label").take(rows).to_pylist()
    datasets = served.shelf.rows.column("dataset").take(rows).to_pylist()
    return clusters(points, labels, datasets)
