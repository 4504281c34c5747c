"""Bands over time: the motifs of clips (Deep Motifs, figure 9), how near a sequence is to a few queries (figure 11),
segments beside the truth (figure 13).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from motionlake.arrays import Float64Array, FloatArray, IntArray
from motionlake.pictures.stick_figures import draw_strip
from motionlake.pictures.style import (
    FAINT,
    LINE,
    TOP,
    UNKNOWN,
    UNLABELLED,
    ClassStyle,
    Sheet,
    class_styles,
    fitted,
    ink_on,
    motif_colours,
    styled,
    tick_seconds,
    width_of,
)

LEFT: Final = 3.0
WIDE: Final = 7.7
LEGEND_COLUMNS: Final = 4
LANE: Final = 0.17
MOST_LANES: Final = 6
A_QUERY: Final = 1.3
QUERY_COLOURS: Final = ("#AA3377", "#CC3311", "#0077BB")


@dataclass(frozen=True)
class MotifBand:
    """The motifs of a clip's words in time.

    Attributes:
        name: of the clip.
        motifs: [w].
        times: [w + 1] seconds; word i is shown from `times[i]` to `times[i + 1]` (`word_edges`).
        signature: [K].
    """

    name: str
    motifs: IntArray
    times: Float64Array
    signature: FloatArray


@dataclass(frozen=True)
class Segment:
    """A labelled stretch of a clip, seconds."""

    start: float
    stop: float
    label: str


@dataclass(frozen=True)
class QueryCurve:
    """One query and its distance from every window of a sequence.

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


def word_edges(starts: IntArray, stops: IntArray, fps: float) -> Float64Array:
    """[w + 1] seconds that part a clip among its overlapping words, each around its own middle."""
    middles = (starts + stops) / 2
    return np.concatenate([starts[:1], (middles[1:] + middles[:-1]) / 2, stops[-1:]]) / fps


@styled
def motif_bands(bands: Sequence[MotifBand], order: IntArray, title: str, note: str = "") -> Figure:
    """For each clip its motifs in time, and below them its signature with [K] motifs in `order` (`motif_order`)."""
    colours = motif_colours(order)
    each = 1.25
    sheet = Sheet(LEFT + WIDE + 0.3, TOP + each * len(bands) + 0.2, title, note)
    longest = max(band.times[-1] for band in bands)
    for i, band in enumerate(bands):
        top = TOP + each * i + 0.05
        sheet.text(LEFT - 0.1, top + 0.29, band.name, size=8, ha="right", weight="bold", room=LEFT - 0.2)
        sheet.text(LEFT - 0.1, top + 0.76, "its signature", size=8, color=FAINT, ha="right")
        cuts = np.flatnonzero(np.diff(band.motifs)) + 1  # a block is a run of words of one motif
        edges = band.times[[0, *cuts, len(band.motifs)]]
        time = sheet.bare(LEFT, top, WIDE, 0.5, "bottom")
        _blocks(time, band.motifs[[0, *cuts]], edges[:-1], np.diff(edges), colours, longest)
        tick_seconds(time, longest)
        held = order[band.signature[order] > 0]
        shares = band.signature[held].astype(float)
        share = sheet.bare(LEFT, top + 0.68, WIDE, 0.2)
        _blocks(share, held, np.cumsum(shares) - shares, shares, colours, 1.0)
        share.set_xlim(0, max(float(shares.sum()), 1e-9))
    sheet.text(
        LEFT, TOP + each * len(bands) + 0.02,
        "upper band: time in seconds; lower band: the same motifs sorted, as wide as their share; numbers name motifs",
        size=8, color=FAINT,
    )  # fmt: skip
    return sheet.figure


def _blocks(
    axes: Axes, motifs: IntArray, starts: Float64Array, widths: Float64Array, colours: Float64Array, whole: float
) -> None:
    """Bars in the colours of motifs, on axes that are `whole` wide, with the motifs' numbers where there is room."""
    axes.bar(starts, 1, widths, align="edge", color=colours[motifs], edgecolor="white", linewidth=0.3)
    axes.set_ylim(0, 1)
    for motif, start, width in zip(motifs, starts, widths, strict=True):
        if width * WIDE / whole > width_of(str(motif), 7) + 0.04:
            ink = ink_on(colours[motif])
            axes.text(start + width / 2, 0.5, str(motif), ha="center", va="center", fontsize=7, color=ink)


@styled
def segment_bands(
    rows: Mapping[str, Sequence[Segment]], seconds: float, title: str, note: str = "", classes: Collection[str] = ()
) -> Figure:
    """Segments of a clip in the colour of their class; unknown is hatched grey, overlapping ones lie in lanes.

    Args:
        rows: by what they are: the truth first, then what is compared with it.
        seconds: of the clip.
        classes: of all clips, so that each has its colour in every picture.
    """
    labels = _labels(segment for segments in rows.values() for segment in segments)
    styles = class_styles([*classes, *labels])
    body = sum(_height(segments) + 0.16 for segments in rows.values())
    sheet = Sheet(LEFT + WIDE + 0.3, TOP + body + 0.2 + _legend_height(labels), title, note)
    top = TOP
    for name, segments in rows.items():
        height = _height(segments)
        axes = draw_segments(sheet, LEFT, top, WIDE, height, segments, seconds, styles)
        axes.set_facecolor("#f4f4f4")
        sheet.text(LEFT - 0.1, top + height / 2, name, ha="right", va="center", room=LEFT - 0.2)
        top += height + 0.16
    axes.spines["bottom"].set_visible(True)
    tick_seconds(axes, seconds)
    sheet.text(LEFT - 0.1, top + 0.02, "seconds", size=7.5, color=FAINT, ha="right")
    _class_legend(sheet, labels, styles, top + 0.14)
    return sheet.figure


@styled
def similarity_along(
    queries: Sequence[QueryCurve], seconds: float, title: str, note: str = "", truth: Sequence[Segment] = (),
    classes: Collection[str] = (),
) -> Figure:  # fmt: skip
    """For each of up to three queries, its stick figures, a curve of the distance, and a band: darker is nearer.

    Below them the labelled segments of the sequence; `classes` are as those of `segment_bands`.
    """
    labels = _labels(truth)
    styles = class_styles([*classes, *labels])
    below = _height(truth) + 0.2 + _legend_height(labels) if truth else 0
    sheet = Sheet(LEFT + WIDE + 0.3, TOP + A_QUERY * len(queries) + 0.25 + below, title, note)
    farthest = max(float(query.distances.max()) for query in queries) or 1.0
    top = TOP
    for query, colour in zip(queries, QUERY_COLOURS, strict=False):
        sheet.text(0.12, top + 0.14, query.name, size=8, color=colour, weight="bold", room=LEFT - 0.65)
        draw_strip(sheet, 0.1, top + 0.2, LEFT - 0.65, 0.95, query.poses)
        curve = sheet.axes(LEFT, top, WIDE, 0.78)
        curve.plot(query.times, query.distances, color=colour, linewidth=1.1)
        curve.set(xlim=(0, seconds), ylim=(farthest * 1.03, -farthest * 0.03), xticks=[])
        curve.set_ylabel("distance", fontsize=7, color=FAINT)
        curve.spines[["top", "right", "bottom"]].set_visible(False)
        axes = sheet.bare(LEFT, top + 0.84, WIDE, 0.26, "bottom")
        edges = np.concatenate([[0.0], (query.times[1:] + query.times[:-1]) / 2, [seconds]])
        shade = LinearSegmentedColormap.from_list("near", [colour, "#ffffff"])
        axes.pcolormesh(edges, [0, 1], query.distances[None], cmap=shade, vmin=0, vmax=farthest)
        axes.set_xlim(0, seconds)
        bottom = top + 1.1
        top += A_QUERY
    if truth:
        axes = draw_segments(sheet, LEFT, top, WIDE, _height(truth), truth, seconds, styles)
        axes.spines["bottom"].set_visible(True)
        bottom = top + _height(truth)
        sheet.text(LEFT - 0.1, (top + bottom) / 2, "labelled segments", size=8, ha="right", va="center")
        _class_legend(sheet, labels, styles, bottom + 0.28)
    tick_seconds(axes, seconds)
    sheet.text(LEFT + WIDE + 0.08, bottom + 0.14, "s", size=7.5, color=FAINT)
    return sheet.figure


def lanes_of(segments: Sequence[Segment]) -> list[int]:
    """The lane of each segment: the first one that is free when it starts."""
    ends: list[float] = []
    lanes = [0] * len(segments)
    for i in sorted(range(len(segments)), key=lambda j: (segments[j].start, segments[j].stop, segments[j].label)):
        free = next((lane for lane, end in enumerate(ends) if end <= segments[i].start), len(ends))
        ends[free : free + 1] = [segments[i].stop]
        lanes[i] = free
    return lanes


def lane_count(segments: Sequence[Segment]) -> int:
    return max(lanes_of(segments), default=-1) + 1


def in_few_lanes(segments: Sequence[Segment]) -> list[Segment]:
    """Those that lie in the first six lanes."""
    return [segment for segment, lane in zip(segments, lanes_of(segments), strict=True) if lane < MOST_LANES]


def draw_segments(
    sheet: Sheet, left: float, top: float, width: float, height: float, segments: Sequence[Segment], seconds: float,
    styles: Mapping[str, ClassStyle],
) -> Axes:  # fmt: skip
    """Draw segments in lanes into a box, inches, that stands for so many seconds."""
    axes = sheet.bare(left, top, width, height)
    for segment, lane in zip(segments, lanes_of(segments), strict=True):
        style, length = styles[segment.label], segment.stop - segment.start
        axes.bar(
            segment.start, 0.94, length, lane, align="edge", color=style.colour, hatch=style.hatch,
            edgecolor="white", linewidth=0.6,
        )  # fmt: skip
        text = fitted(segment.label, length / seconds * width - 0.06, 7)
        if len(text) >= min(len(segment.label), 5) and not style.hatch:
            axes.text(
                segment.start + length / 2, lane + 0.47, text, ha="center", va="center", fontsize=7,
                color=ink_on(style.colour), clip_on=True,
            )  # fmt: skip
    axes.set(xlim=(0, seconds), ylim=(max(lane_count(segments), 1), 0))
    return axes


def _height(segments: Sequence[Segment]) -> float:
    return LANE * max(lane_count(segments), 2)


def _labels(segments: Iterable[Segment]) -> list[str]:
    """By name, grey ones last."""
    return sorted({s.label for s in segments}, key=lambda label: (label in (UNKNOWN, UNLABELLED), label))


def _legend_height(labels: Sequence[str]) -> float:
    return LINE * -(-len(labels) // LEGEND_COLUMNS)


def _class_legend(sheet: Sheet, labels: Sequence[str], styles: Mapping[str, ClassStyle], top: float) -> None:
    column = WIDE / LEGEND_COLUMNS
    for i, label in enumerate(labels):
        x, y = LEFT + (i % LEGEND_COLUMNS) * column, top + LINE * (i // LEGEND_COLUMNS) + 0.06
        sheet.box(x, y - 0.06, 0.22, 0.12, styles[label].colour, styles[label].hatch)
        sheet.text(x + 0.28, y, label, size=8, va="center", room=column - 0.4)
