"""Bands over time: the motifs of clips (Deep Motifs, figure 9), segments beside the truth (figure 13)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from motionlake.arrays import Float64Array, FloatArray, IntArray
from motionlake.pictures.style import (
    FAINT,
    TOP,
    UNKNOWN,
    UNLABELLED,
    ClassStyle,
    Sheet,
    bare,
    class_styles,
    fitted,
    ink_on,
    motif_colours,
    styled,
    width_of,
)

LEFT: Final = 2.8
WIDE: Final = 7.8
LEGEND_COLUMNS: Final = 4
LEGEND_LINE: Final = 0.2


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
class SegmentRow:
    """One way to cut a clip, such as the truth; overlapping segments are drawn in lanes."""

    name: str
    segments: Sequence[Segment]


def word_edges(starts: IntArray, stops: IntArray, fps: float) -> Float64Array:
    """[w + 1] seconds that part a clip among its overlapping words, each around its own middle."""
    middles = (starts + stops) / 2
    return np.concatenate([starts[:1], (middles[1:] + middles[:-1]) / 2, stops[-1:]]) / fps


@styled
def motif_bands(bands: Sequence[MotifBand], order: IntArray, title: str, note: str = "") -> Figure:
    """For each clip, its motifs in time, and below them its signature in the motifs' common order.

    Args:
        bands: at least one.
        order: [K] motifs, as `motif_order` gives them.
        title: one line.
        note: one line below it.
    """
    colours = motif_colours(order)
    each = 1.25
    sheet = Sheet(LEFT + WIDE + 0.3, TOP + each * len(bands) + 0.2, title, note)
    longest = max(band.times[-1] for band in bands)
    for i, band in enumerate(bands):
        top = TOP + each * i + 0.05
        sheet.text(LEFT - 0.1, top + 0.29, band.name, size=8, ha="right", weight="bold", room=LEFT - 0.2)
        sheet.text(LEFT - 0.1, top + 0.76, "its signature", size=8, color=FAINT, ha="right")
        time = bare(sheet.axes(LEFT, top, WIDE, 0.5), "bottom")
        _runs(time, band, colours, WIDE / longest)
        time.set_xlim(0, longest)
        time.xaxis.set_major_locator(second_ticks())
        time.tick_params(labelsize=7.5, length=2, pad=1.5)
        share = bare(sheet.axes(LEFT, top + 0.68, WIDE, 0.2))
        _shares(share, band.signature, colours, order)
    sheet.text(
        LEFT, TOP + each * len(bands) + 0.02,
        "upper band: time in seconds; lower band: the same motifs sorted, as wide as their share; numbers name motifs",
        size=8, color=FAINT,
    )  # fmt: skip
    return sheet.figure


def second_ticks() -> MaxNLocator:
    """Whole steps of seconds."""
    return MaxNLocator(nbins=12, steps=[1, 2, 5, 10])


def _runs(axes: Axes, band: MotifBand, colours: Float64Array, scale: float) -> None:
    """One bar a run of words of one motif, with its number where there is room."""
    cuts = np.flatnonzero(np.diff(band.motifs)) + 1
    firsts, lasts = np.concatenate([[0], cuts]), np.concatenate([cuts, [len(band.motifs)]])
    starts, widths = band.times[firsts], band.times[lasts] - band.times[firsts]
    motifs = band.motifs[firsts]
    axes.bar(starts, 1, widths, align="edge", color=colours[motifs], edgecolor="white", linewidth=0.3)
    axes.set_ylim(0, 1)
    _numbers(axes, motifs, starts, widths, colours, scale)


def _shares(axes: Axes, signature: FloatArray, colours: Float64Array, order: IntArray) -> None:
    held = order[signature[order] > 0]
    widths = signature[held].astype(float)
    starts = np.cumsum(widths) - widths
    axes.bar(starts, 1, widths, align="edge", color=colours[held], edgecolor="white", linewidth=0.4)
    axes.set_xlim(0, max(float(widths.sum()), 1e-9))
    axes.set_ylim(0, 1)
    _numbers(axes, held, starts, widths, colours, WIDE)


def _numbers(
    axes: Axes, motifs: IntArray, starts: Float64Array, widths: Float64Array, colours: Float64Array,
    scale: float,
) -> None:  # fmt: skip
    for motif, start, width in zip(motifs, starts, widths, strict=True):
        if width * scale > width_of(str(motif), 7) + 0.04:
            axes.text(
                start + width / 2, 0.5, str(motif), ha="center", va="center", fontsize=7, color=ink_on(colours[motif])
            )


@styled
def segment_bands(
    rows: Sequence[SegmentRow], seconds: float, title: str, note: str = "", classes: Sequence[str] = ()
) -> Figure:
    """One band a row, segments in the colour of their class; unknown is hatched grey.

    Args:
        rows: the truth first, then what is compared with it.
        seconds: how long the clip is.
        title: one line.
        note: one line below it.
        classes: of all clips, so that each has its colour in every picture.
    """
    labels = sorted({s.label for row in rows for s in row.segments} - {UNKNOWN, UNLABELLED})
    labels += sorted({s.label for row in rows for s in row.segments} & {UNKNOWN, UNLABELLED})
    styles = class_styles([*classes, *labels])
    lanes = [lanes_of(row.segments) for row in rows]
    heights = [0.34 if max(found, default=0) == 0 else 0.17 * (max(found) + 1) for found in lanes]
    body = sum(heights) + 0.16 * len(rows)
    sheet = Sheet(LEFT + WIDE + 0.3, TOP + body + 0.2 + legend_height(labels), title, note)
    top = TOP
    for i, (row, found, height) in enumerate(zip(rows, lanes, heights, strict=True)):
        axes = bare(sheet.axes(LEFT, top, WIDE, height), *(["bottom"] if i == len(rows) - 1 else []))
        axes.set_facecolor("#f4f4f4")
        draw_segments(axes, row.segments, found, styles, seconds)
        sheet.text(LEFT - 0.1, top + height / 2, row.name, ha="right", va="center", room=LEFT - 0.2)
        top += height + 0.16
    axes.xaxis.set_major_locator(second_ticks())
    axes.tick_params(labelsize=7.5, length=2, pad=1.5)
    sheet.text(LEFT - 0.1, top + 0.02, "seconds", size=7.5, color=FAINT, ha="right")
    class_legend(sheet, labels, styles, top + 0.14)
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


def draw_segments(
    axes: Axes, segments: Sequence[Segment], lanes: Sequence[int], styles: dict[str, ClassStyle], seconds: float,
    wide: float = WIDE,
) -> None:  # fmt: skip
    """Draw segments in lanes over `seconds`, on axes that are `wide` inches wide."""
    for segment, lane in zip(segments, lanes, strict=True):
        style, width = styles[segment.label], segment.stop - segment.start
        axes.bar(
            segment.start, 0.94, width, lane, align="edge", color=style.colour, hatch=style.hatch,
            edgecolor="white", linewidth=0.6,
        )  # fmt: skip
        room = width / seconds * wide - 0.06
        text = fitted(segment.label, room, 7)
        if len(text) >= min(len(segment.label), 5) and not style.hatch:
            axes.text(
                segment.start + width / 2, lane + 0.47, text, ha="center", va="center", fontsize=7,
                color=ink_on(style.colour), clip_on=True,
            )  # fmt: skip
    axes.set_xlim(0, seconds)
    axes.set_ylim(max(lanes, default=0) + 1, 0)


def legend_height(labels: Sequence[str]) -> float:
    """Inches that `class_legend` takes."""
    return LEGEND_LINE * -(-len(labels) // LEGEND_COLUMNS)


def class_legend(
    sheet: Sheet, labels: Sequence[str], styles: dict[str, ClassStyle], top: float, left: float = LEFT,
    wide: float = WIDE,
) -> None:  # fmt: skip
    """Boxes in the colours of classes with their names, `top` inches from the top of the sheet."""
    for i, label in enumerate(labels):
        column = wide / LEGEND_COLUMNS
        x, y = left + (i % LEGEND_COLUMNS) * column, top + LEGEND_LINE * (i // LEGEND_COLUMNS) + 0.06
        style = styles[label]
        sheet.box(x, y - 0.06, 0.22, 0.12, style.colour, style.hatch)
        sheet.text(x + 0.28, y, label, size=8, va="center", room=column - 0.4)
