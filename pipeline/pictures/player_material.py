"""The clips of a lake, and clip files, as the player and film strips show them; the nearest real clip to one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.frames import frame_range
from motionlake.lake.layout import Lake
from motionlake.pictures.bands import Segment
from motionlake.pictures.player_clip import PlayerClip
from motionlake.pictures.poses import Poses
from motionlake.retrieval.encode import first_body
from motionlake.retrieval.methods import ready_methods, retriever
from motionlake.retrieval.protocol import Query
from motionlake.retrieval.search import Hit

NEAREST_BY: Final = ("descriptor", "signature")


def player_clip(
    con: Connection,
    lake: Lake,
    query: Query,
    start: int | None = None,
    stop: int | None = None,
    nearest: tuple[str, Hit] | None = None,
) -> PlayerClip:
    """A clip of the lake, or the first body of a clip file.

    Args:
        con: to the lake.
        lake: the same.
        query: a clip's full name, or a file.
        start: first frame to show, at the clip's own rate; None: the first.
        stop: frame after the last.
        nearest: what `nearest_real_clip` said of this clip, where it did.

    Raises:
        UserError: the clip has no such frames, or the file cannot be read.
    """
    if isinstance(query, Path):
        body, motion = first_body(lake, query)
        positions, fps, name = motion.positions.astype(np.float32), body.fps, query.name
        facts, segments = [("file", query.suffix.lstrip("."))], []
    else:
        known = fetch(con, "clip", {"clip": query})[0]
        positions, fps, name = Poses(con, lake).positions(query), float(known["fps"]), query
        lineage = _lineage(con, query)
        facts = _facts(known, lineage)
        segments = _segments(con, query, len(positions), lineage)
    first, last = frame_range(name, start, stop, len(positions))
    if nearest is not None:
        method, hit = nearest
        facts.append(("distance", f"{hit.distance:.3f} by {method}"))
    facts.append(("length", f"{len(positions) / fps:.2f} s at {fps:g} frames a second"))
    if (first, last) != (0, len(positions)):
        facts.append(("shown", f"frames {first} to {last}"))
    return PlayerClip(
        name, positions[first:last], fps, len(positions), first, facts, _bands(segments, first, last, fps)
    )  # fmt: skip


def nearest_real_clip(con: Connection, lake: Lake, query: Query) -> tuple[str, Hit]:
    """The recorded clip nearest to a clip or a file: by descriptor where the lake has them, else by signature.

    Args:
        con: with functions and macros, as `motionlake.connect` opens it.
        lake: the same.
        query: a clip's full name, itself no answer, or a file.

    Returns:
        The method, and the hit.

    Raises:
        UserError: no method of the lake can compare it, or there is no other recorded clip.
    """
    ready = [method for method in NEAREST_BY if method in ready_methods(con)]
    if not ready:
        raise UserError(f"{lake.root}: has neither descriptors nor signatures yet; make them with `motionlake run all`")
    failed: UserError | None = None
    for method in ready:
        try:
            found = retriever(method, con, lake, real=True).search([query], 1)[0]
        except UserError as error:
            failed = failed or error
            continue
        if found:
            return method, found[0]
    raise failed or UserError(f"{query}: the lake has no other recorded clip that it can be compared with")


def _lineage(con: Connection, clip: str) -> Mapping[str, Any] | None:
    """How a synthetic clip was made; None for a recorded one."""
    if not fetch(con, "has_synthetic_table"):
        return None
    return next(iter(fetch(con, "synthetic_clip", {"clip": clip})), None)


def _facts(known: Mapping[str, Any], lineage: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    facts = [(name, known[name]) for name in ("label", "subject", "dataset")]
    of_training = "; ".join(lineage["licences"]) if lineage is not None else ""
    facts.append(("licence", known["licence"] or of_training or "not stated"))
    if lineage is not None:
        facts += [
            ("made by", lineage["model"]),
            ("classes", ", ".join(lineage["classes"])),
            ("seed", str(lineage["seed"])),
            ("starts from", f"{lineage['seed_clip']}, frames {lineage['seed_start']} to {lineage['seed_stop']}"),
        ]
    return [(name, str(value)) for name, value in facts if value]


def _segments(
    con: Connection, clip: str, frames: int, lineage: Mapping[str, Any] | None
) -> list[tuple[str, list[tuple[int, int, str]]]]:
    """Rows of labelled stretches in frames: segments, or the classes of a synthetic clip that has none."""
    found = [(r["start"], r["stop"], r["label"]) for r in fetch(con, "segments_of_clip", {"clip": clip})]
    if lineage is None:
        return [("labels", found)] if found else []
    if not found:
        classes = lineage["classes"]
        edges = np.linspace(0, frames, len(classes) + 1).round().astype(int).tolist()
        found = list(zip(edges[:-1], edges[1:], classes, strict=True))
    return [("classes", found)]


def _bands(
    rows: list[tuple[str, list[tuple[int, int, str]]]], first: int, last: int, fps: float
) -> list[tuple[str, list[Segment]]]:
    """Those within frames [first, last), in seconds from the first."""
    bands = []
    for name, stretches in rows:
        inside = [
            Segment((max(start, first) - first) / fps, (min(stop, last) - first) / fps, label)
            for start, stop, label in stretches
            if start < last and stop > first
        ]
        if inside:
            bands.append((name, inside))
    return bands
