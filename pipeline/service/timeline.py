"""What is known of the moments of a clip, as bands over its frames."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

import numpy as np
from fastapi import APIRouter, Request
from motionlake.lake.catalog import Connection, fetch
from motionlake.names import printable
from motionlake.service.clips import faults_of
from motionlake.service.motion import Clip, height_of, positions_of
from motionlake.service.served import annotations_of, serving_of

router = APIRouter(prefix="/api", tags=["clips"])
COLOURS: Final = 12  # that spans are drawn in
_FEET: Final = ("left foot", "right foot")
Span = dict[str, Any]


@router.get("/clip/timeline")
def timeline(request: Request, clip: Clip) -> dict[str, Any]:
    """Bands of labelled ranges; those of stages that were not run are missing."""
    served = serving_of(request).now()
    row = served.shelf.of([clip])[0]
    frames, fps = int(row["frames"]), float(row["fps"])
    with served.cursor() as con:
        found = {
            "segments": [_named(each["start"], each["stop"], each["label"]) for each in _segments(con, clip, frames)],
            "motifs": _motifs(con, clip, frames),
            "symbols": _symbols(con, clip),
            "quality": [
                _named(each["start"], each["stop"], each["fault"], f"{each['fault']} {each['joint'] or ''}".strip())
                for each in faults_of(con, clip)
            ],
        }
    found["contacts"] = _contacts(*positions_of(served, [clip])[clip])
    found["annotations"] = [
        {**_named(each.start or 0, each.stop or frames, each.value), "id": each.id, "kind": each.kind}
        for each in annotations_of(request).current(clip)
        if each.start is not None or each.kind == "label"
    ]
    bands = [{"name": name, "spans": spans} for name, spans in found.items() if spans]
    return {"frames": frames, "fps": fps, "bands": bands}


def _named(start: int, stop: int, value: str, text: str | None = None) -> Span:
    """A span whose colour follows from its text, the same in every clip."""
    colour = sum(value.encode()) % COLOURS
    return {"start": start, "stop": stop, "value": value, "colour_index": colour, "text": printable(text or value)}


def _numbered(start: int, stop: int, number: int, what: str) -> Span:
    span = {"start": start, "stop": stop, "value": number, "colour_index": number % COLOURS}
    return {**span, "text": f"{what} {number}"}


def _segments(con: Connection, clip: str, frames: int) -> list[dict[str, Any]]:
    """Labelled segments, or the classes of a made clip that has none."""
    found = fetch(con, "segments_of_clip", {"clip": clip})
    lineage = [] if found else fetch(con, "synthetic_clip", {"clip": clip})
    if not lineage:
        return found
    classes = lineage[0]["classes"]
    edges = np.linspace(0, frames, len(classes) + 1).round().astype(int).tolist()
    return [{"start": a, "stop": b, "label": c} for a, b, c in zip(edges[:-1], edges[1:], classes, strict=True)]


def _motifs(con: Connection, clip: str, frames: int) -> list[Span]:
    """The motifs of successive words; words overlap, so that each counts up to where the next one starts."""
    rows = fetch(con, "motifs_of_clip", {"clip": clip})
    starts = [int(row["start"]) for row in rows]
    stops = [*starts[1:], max((int(row["stop"]) for row in rows), default=frames)]
    return _joined(rows, starts, stops, "motif")


def _symbols(con: Connection, clip: str) -> list[Span]:
    rows = fetch(con, "symbols_of_clip", {"clip": clip})
    return _joined(rows, [int(row["start"]) for row in rows], [int(row["stop"]) for row in rows], "symbol")


def _joined(rows: Iterable[Mapping[str, Any]], starts: list[int], stops: list[int], what: str) -> list[Span]:
    """Spans of numbers, where neighbours of one number are one span."""
    found: list[Span] = []
    for row, start, stop in zip(rows, starts, stops, strict=True):
        if found and found[-1]["value"] == row[what] and found[-1]["stop"] == start:
            found[-1]["stop"] = stop
        else:
            found.append(_numbered(start, stop, int(row[what]), what))
    return found


def _contacts(positions: Any, fps: float) -> list[Span]:
    """When each foot stands."""
    from motionlake.motion.standing import contacts

    places = np.asarray(positions, np.float64)
    stands = contacts(places, fps, height_of(places))
    found: list[Span] = []
    for foot, name in enumerate(_FEET):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], stands[:, foot].astype(np.int8), [0]])))
        pairs = edges.reshape(-1, 2).tolist()
        found += [
            {"start": a, "stop": b, "value": name.split()[0], "colour_index": foot, "text": f"{name} stands"}
            for a, b in pairs
        ]
    return found
