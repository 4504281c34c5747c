"""How near each moment of a sequence is to a few queries (Deep Motifs, figure 11)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from motionlake.arrays import Float64Array, FloatArray
from motionlake.pictures.bands import Segment, class_legend, draw_segments, lanes_of, legend_height, second_ticks
from motionlake.pictures.stick_figures import draw_strip
from motionlake.pictures.style import FAINT, TOP, Sheet, bare, class_styles, styled

COLOURS: Final = ("#AA3377", "#CC3311", "#0077BB")
LEFT: Final = 3.1
WIDE: Final = 7.6
EACH: Final = 1.3


@dataclass(frozen=True)
class QueryCurve:
    """One query and its distance from every window of the sequence.

    Attributes:
        name: what the query is.
        poses: [n, 21, 3] moments of it.
        distances: [windows] of its signature from the window's.
        times: [windows] seconds, the middle of each window.
    """

    name: str
    poses: FloatArray
    distances: Float64Array
    times: Float64Array


@styled
def similarity_along(
    queries: Sequence[QueryCurve],
    seconds: float,
    title: str,
    note: str = "",
    truth: Sequence[Segment] = (),
    classes: Sequence[str] = (),
) -> Figure:
    """For each of up to three queries, its stick figures, a curve of the distance, and a band: darker is nearer.

    Args:
        queries: one to three.
        seconds: how long the sequence is.
        title: one line.
        note: one line below it.
        truth: labelled segments of the sequence, shown below.
        classes: of all segments, so that each has its colour in every picture.
    """
    labels = sorted({s.label for s in truth})
    styles = class_styles([*classes, *labels])
    lanes = lanes_of(truth)
    lane_height = (0.34 if max(lanes, default=0) == 0 else 0.17 * (max(lanes) + 1)) if truth else 0
    height = TOP + EACH * len(queries) + 0.25 + (lane_height + 0.2 + legend_height(labels) if truth else 0)
    sheet = Sheet(LEFT + WIDE + 0.3, height, title, note)
    farthest = max(float(q.distances.max()) for q in queries) or 1.0
    top = TOP
    for query, colour in zip(queries, COLOURS, strict=False):
        sheet.text(0.12, top + 0.14, query.name, size=8, color=colour, weight="bold", room=LEFT - 0.75)
        draw_strip(sheet, 0.1, top + 0.2, LEFT - 0.75, 0.95, query.poses)
        curve = sheet.axes(LEFT, top, WIDE, 0.78)
        curve.plot(query.times, query.distances, color=colour, linewidth=1.1)
        curve.set_xlim(0, seconds)
        curve.set_ylim(farthest * 1.03, -farthest * 0.03)
        curve.set_xticks([])
        curve.tick_params(labelsize=7, length=2)
        curve.set_ylabel("distance", fontsize=7, color=FAINT)
        for side in ("top", "right", "bottom"):
            curve.spines[side].set_visible(False)
        band = bare(sheet.axes(LEFT, top + 0.84, WIDE, 0.26), "bottom")
        edges = np.concatenate([[0.0], (query.times[1:] + query.times[:-1]) / 2, [seconds]])
        shade = LinearSegmentedColormap.from_list("near", [colour, "#ffffff"])
        band.pcolormesh(edges, [0, 1], query.distances[None], cmap=shade, vmin=0, vmax=farthest)
        band.set_xlim(0, seconds)
        band_bottom = top + 1.1
        top += EACH
    if truth:
        axes = bare(sheet.axes(LEFT, top, WIDE, lane_height), "bottom")
        draw_segments(axes, truth, lanes, styles, seconds, WIDE)
        sheet.text(LEFT - 0.1, top + lane_height / 2, "labelled segments", size=8, ha="right", va="center")
        band_bottom = top + lane_height
        top += lane_height + 0.28
        class_legend(sheet, labels, styles, top, LEFT, WIDE)
        band = axes
    band.xaxis.set_major_locator(second_ticks())
    sheet.text(LEFT + WIDE + 0.08, band_bottom + 0.14, "s", size=7.5, color=FAINT)
    band.tick_params(labelsize=7.5, length=2, pad=1.5)
    return sheet.figure
