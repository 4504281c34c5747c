"""A motion as it is shown: read from a lake or a file, with what is known of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import FloatArray
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.frames import frame_range
from motionlake.lake.layout import Lake
from motionlake.motion.skeleton import facing
from motionlake.names import kept
from motionlake.pictures.bands import Segment
from motionlake.pictures.stick_figures import PoseReader, body_height
from motionlake.pictures.style import ClassStyle, class_styles
from motionlake.retrieval.hits import Hit
from motionlake.retrieval.protocol import Query, Scope
from motionlake.retrieval.registry import ready, searcher
from motionlake.stages.frames import first_body

MOST_FPS: Final = 30.0
MOST_SECONDS: Final = 180.0
FLOOR: Final = 2.0  # percentile of the lowest joint of each frame: a glitch or two below the floor is not the floor


@dataclass(frozen=True)
class PlayerClip:
    """A motion and what is said of it.

    Attributes:
        name: of the clip or file.
        positions: [F, 21, 3] joints, metres, y up, at `fps`.
        fps: frames a second.
        frames: of the whole clip.
        first: which of the clip's frames `positions` begins at.
        facts: what is known of it, such as ("label", "walk"), in the order shown.
        bands: rows of labelled stretches by name; seconds from the beginning of `positions`.
    """

    name: str
    positions: FloatArray
    fps: float
    frames: int
    first: int = 0
    facts: Sequence[tuple[str, str]] = ()
    bands: Sequence[tuple[str, Sequence[Segment]]] = ()

    def __post_init__(self) -> None:
        if not len(self.positions):
            raise ValueError(f"{self.name}: has no frames")

    @property
    def step(self) -> int:
        """One of so many frames is shown."""
        return max(1, int(np.ceil(self.fps / MOST_FPS - 1e-3)))

    @property
    def shown_fps(self) -> float:
        return self.fps / self.step

    @property
    def shown(self) -> FloatArray:
        """[n, 21, 3] positions at `shown_fps`, of the first three minutes."""
        return self.positions[:: self.step][: round(MOST_SECONDS * self.shown_fps)]

    @property
    def duration(self) -> float:
        """Seconds of `positions`."""
        return len(self.positions) / self.fps

    @cached_property
    def floor(self) -> float:
        """Height of the ground, metres."""
        return float(np.percentile(self.positions[..., 1].min(axis=1), FLOOR))

    @cached_property
    def heading(self) -> float:
        """Radians about +y from +z to where the body faces at first."""
        return float(facing(self.positions[:1])[0])

    @cached_property
    def height(self) -> float:
        """About that of the standing body, metres."""
        return body_height(self.positions)


def styles_of(clips: Sequence[PlayerClip]) -> dict[str, ClassStyle]:
    """How the labels of all bands of some clips are drawn."""
    return class_styles(sorted({span.label for clip in clips for _, spans in clip.bands for span in spans}))


def player_clip(con: Connection, lake: Lake, query: Query, nearest: tuple[str, Hit] | None = None) -> PlayerClip:
    """A clip of the lake, or the first body of a clip file, and what `nearest_real_clip` said of it, where it did.

    Raises:
        UserError: the clip has no such frames, or the file cannot be read.
    """
    if isinstance(query.source, Path):
        body, motion = first_body(lake, query.source)
        positions, fps, name = motion.positions.astype(np.float32), body.fps, kept(query.source.name)
        facts, name_of_band, stretches = [("file", query.source.suffix.lstrip("."))], "", []
    else:
        name = query.source
        known = fetch(con, "clip", {"clip": name})[0]
        positions, fps = PoseReader(con, lake).positions(name), float(known["fps"])
        lineage = next(iter(fetch(con, "synthetic_clip", {"clip": name})), None)  # None for a recorded one
        facts = _facts(known, lineage)
        name_of_band = "classes" if lineage else "labels"
        stretches = _stretches(con, name, len(positions), lineage)
    first, last = frame_range(name, query.start, query.stop, len(positions))
    if nearest is not None:
        method, hit = nearest
        facts.append(("distance", f"{hit.distance:.3f} by {method}"))
    facts.append(("length", f"{len(positions) / fps:.2f} s at {fps:g} frames a second"))
    if (first, last) != (0, len(positions)):
        facts.append(("shown", f"frames {first} to {last}"))
    spans = [
        Segment((max(start, first) - first) / fps, (min(stop, last) - first) / fps, label)
        for start, stop, label in stretches
        if start < last and stop > first
    ]
    bands = [(name_of_band, spans)] if spans else []
    return PlayerClip(name, positions[first:last], fps, len(positions), first, facts, bands)


def nearest_real_clip(lake: Lake, query: Query) -> tuple[str, Hit]:
    """How the recorded clip nearest to another one or to a file was found, and that clip.

    As `motionlake search` finds it, or, where that cannot compare the query, by the first method that can.

    Raises:
        UserError: no method of the lake can compare it, or there is no other recorded clip.
    """
    failed: UserError | None = None
    for method in ready(lake, "clip"):  # the default first; a clip that was made now may have a descriptor alone
        try:
            (found,) = searcher("clip", method, lake).search([query], 1, Scope(recorded_only=True))
        except UserError as error:
            failed = failed or error
            continue
        if found:
            return method, found[0]
    raise failed or UserError(f"{query.name}: the lake has no other recorded clip that it can be compared with")


def _facts(known: Mapping[str, Any], lineage: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    facts = {name: known[name] for name in ("label", "subject", "dataset")}
    of_training = "; ".join(lineage["licences"]) if lineage else ""
    facts["licence"] = known["licence"] or of_training or "not stated"
    if lineage:
        facts["made by"] = lineage["model"]
        facts["classes"] = ", ".join(lineage["classes"])
        facts["seed"] = str(lineage["seed"])
        facts["starts from"] = f"{lineage['seed_clip']}, frames {lineage['seed_start']} to {lineage['seed_stop']}"
    return [(name, str(value)) for name, value in facts.items() if value]


def _stretches(
    con: Connection, clip: str, frames: int, lineage: Mapping[str, Any] | None
) -> list[tuple[int, int, str]]:
    """Labelled stretches in frames: segments, or the classes of a synthetic clip that has none."""
    found = [(row["start"], row["stop"], row["label"]) for row in fetch(con, "segments_of_clip", {"clip": clip})]
    if found or lineage is None:
        return found
    edges = np.linspace(0, frames, len(lineage["classes"]) + 1).round().astype(int).tolist()
    return list(zip(edges[:-1], edges[1:], lineage["classes"], strict=True))
