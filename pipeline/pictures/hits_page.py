"""The answers of a search as stick figures: the query on top, each hit with its rank and distance below it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from motionlake.arrays import FloatArray
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import Lake
from motionlake.names import kept
from motionlake.pictures.stick_figures import PoseReader, draw_strip, spread
from motionlake.pictures.style import FAINT, INK, TOP, Sheet, styled
from motionlake.stages.frames import first_body

MOST_HITS: Final = 30
MOMENTS: Final = 14
ROW: Final = 1.1
LEFT: Final = 3.3
STRIP: Final = 6.4


@dataclass(frozen=True)
class HitStrip:
    """One row of a page of hits.

    Attributes:
        head: what it is called: "query", or its rank.
        lines: what is said of it, such as label, clip and distance.
        poses: [n, 21, 3] moments of it.
    """

    head: str
    lines: Sequence[str]
    poses: FloatArray


@styled
def draw_hits(query: HitStrip | None, hits: Sequence[HitStrip], title: str, note: str = "") -> Figure:
    """The query, shaded, where it is a motion, and below it the hits in the order given."""
    rows = [*([] if query is None else [query]), *hits]
    sheet = Sheet(LEFT + STRIP + 0.3, TOP + ROW * len(rows) + 0.2, title, note)
    if query is not None:
        sheet.box(0, TOP - 0.04, sheet.width, ROW, "#eef3f8")
    for i, row in enumerate(rows):
        top = TOP + ROW * i + (0.08 if i else 0)
        sheet.text(0.12, top + 0.36, row.head, size=10, weight="bold", room=0.6)
        for j, line in enumerate(row.lines):
            weight, color = ("bold", INK) if j == 0 else ("normal", FAINT)
            sheet.text(0.75, top + 0.36 + 0.2 * j, line, size=8, weight=weight, color=color, room=LEFT - 0.9)
        draw_strip(sheet, LEFT, top, STRIP, ROW - 0.14, row.poses)
    return sheet.figure


def hits_page(
    con: Connection, lake: Lake, query: str | Path, hits: Sequence[Mapping[str, Any]], start: int | None = None,
    stop: int | None = None, measure: str = "distance", about: str = "distances",
) -> Figure:  # fmt: skip
    """A page of the hits of any search.

    Args:
        con: to the lake.
        lake: the same.
        query: a clip of the lake, or a clip file, of which the first body is drawn.
        hits: rows with "rank", "clip" and the measure; "label", "mirrored" and, for ranges of frames, "start" and
            "stop" are used where there are such. At most 30 are drawn.
        start: first frame of the query, where it is a range of frames.
        stop: frame after its last.
        measure: which of a row's values the hits are ranked by.
        about: what that is, for the line below the title.

    Raises:
        UserError: a file that cannot be read.
    """
    poses = PoseReader(con, lake)
    shown = hits[:MOST_HITS]
    facts = {clip: fetch(con, "clip", {"clip": clip})[0] for clip in {str(hit["clip"]) for hit in shown}}
    strips = [_hit_strip(poses, hit, facts[str(hit["clip"])], measure) for hit in shown]
    if isinstance(query, Path):
        body, motion = first_body(lake, query)
        name, label, fps, positions = kept(query.name), None, body.fps, motion.positions.astype(np.float32)
    else:
        known = fetch(con, "clip", {"clip": query})[0]
        name, label, fps, positions = query, known["label"], known["fps"], poses.positions(query)
    part = positions[start:stop]
    first = (start or 0) / fps
    lines = [line for line in (label, name, f"{first:.1f}–{first + len(part) / fps:.1f} s") if line]
    note = "1 hit" if len(hits) == 1 else f"{len(hits)} hits"
    note += f", the first {MOST_HITS} are shown" if len(hits) > MOST_HITS else ", nearest first"
    asked = HitStrip("query", lines, spread(part, MOMENTS))
    return draw_hits(asked, strips, f"What is most like {name}", f"{note}; {about}")


def _hit_strip(poses: PoseReader, hit: Mapping[str, Any], known: Mapping[str, Any], measure: str) -> HitStrip:
    clip, start, stop = str(hit["clip"]), hit.get("start"), hit.get("stop")
    distance = f"{measure} {hit[measure]:.3f}" + (", mirrored" if hit.get("mirrored") else "")
    if start is None or stop is None:
        when = f"{known['seconds']:.1f} s"
    else:
        when = f"{start / known['fps']:.1f}–{stop / known['fps']:.1f} s"
    lines = [line for line in (hit.get("label") or known["label"], clip, f"{distance}, {when}") if line]
    return HitStrip(str(hit["rank"]), lines, spread(poses.positions(clip)[start:stop], MOMENTS))
