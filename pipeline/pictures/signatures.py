"""Signatures as bars (Deep Motifs, figures 1 and 6), and how near each moment of a sequence is to a few queries
(figure 11).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.colors import LinearSegmentedColormap, LogNorm, to_rgb
from matplotlib.figure import Figure
from motionlake.arrays import Float64Array, FloatArray, Int64Array, IntArray
from motionlake.pictures.bands import Segment, class_legend, draw_segments, lanes_of, legend_height, second_ticks
from motionlake.pictures.stick_figures import draw_strip
from motionlake.pictures.style import (
    FAINT,
    NONE,
    TOP,
    Sheet,
    bare,
    class_styles,
    frequency_map,
    motif_colours,
    plain,
    styled,
    width_of,
)
from scipy.cluster.hierarchy import leaves_list, linkage

# One scale for all pictures, so that they compare: shares outside it take the colour of its ends.
RAREST: Final = 0.005
MOST: Final = 0.5
ROW: Final = 0.165
GAP: Final = 0.13
MOST_CLASS: Final = 2.0
MOST_NAME: Final = 2.3


@dataclass(frozen=True)
class BarGroup:
    """Clips of one class: their names [n] and signatures [n, K]."""

    name: str
    clips: Sequence[str]
    signatures: FloatArray


def motif_order(centroids: FloatArray) -> Int64Array:
    """[K] motifs in an order that puts similar ones side by side.

    Average linkage of the centroids [K, d], its leaves ordered so that neighbours are close.
    """
    if len(centroids) < 3:
        return np.arange(len(centroids))
    tree = linkage(centroids.astype(np.float64), method="average", optimal_ordering=True)
    return np.asarray(leaves_list(tree), dtype=np.int64)


def bar_colours(signatures: FloatArray) -> Float64Array:
    """[..., 3] colours of shares: grey where there is none, then from cold to hot."""
    scale = LogNorm(RAREST, MOST, clip=True)
    colours = frequency_map()(np.asarray(scale(np.maximum(signatures, RAREST))))[..., :3]
    colours[signatures <= 0] = to_rgb(NONE)
    return np.asarray(colours)


@styled
def signature_bars(groups: Sequence[BarGroup], order: IntArray, title: str, note: str = "") -> Figure:
    """Rows of bars, grouped by class, below a strip with the colours that bands give the motifs.

    Args:
        groups: at least one clip in all.
        order: [K] motifs from left to right (`motif_order`).
        title: one line.
        note: one line below it.
    """
    rows = sum(len(g.clips) for g in groups)
    middle = 0.12 + min(max(width_of(plain(g.name), 8.5, "bold") for g in groups), MOST_CLASS) + 0.2
    names = max(width_of(plain(clip), 7.5) for g in groups for clip in g.clips)
    left, wide = max(middle + min(names, MOST_NAME) + 0.1, 2.0), 6.9
    body = rows * ROW + (len(groups) - 1) * GAP
    sheet = Sheet(left + wide + 0.3, TOP + 0.35 + body + 0.95, title, note)
    sheet.image(left, TOP, wide, 0.14, motif_colours(order)[order][None])
    sheet.text(left - 0.1, TOP + 0.11, "motif colours in bands", size=7.5, color=FAINT, ha="right")
    top = TOP + 0.3
    for group in groups:
        height = len(group.clips) * ROW
        sheet.image(left, top, wide, height, _separated(bar_colours(group.signatures[:, order])))
        sheet.text(0.12, top + 0.12, group.name, weight="bold", room=MOST_CLASS)
        for i, clip in enumerate(group.clips):
            sheet.text(left - 0.1, top + ROW * (i + 0.73), clip, size=7.5, ha="right", room=left - 0.1 - middle)
        top += height + GAP
    sheet.text(left, top + 0.06, f"{len(order)} motifs, similar ones side by side", size=8, color=FAINT)
    _scale(sheet, left, top + 0.28)
    return sheet.figure


def _separated(colours: Float64Array) -> Float64Array:
    """Rows of pixels with a white line after each bar."""
    tall = np.repeat(colours, 12, axis=0)
    tall[10::12] = tall[11::12] = 1.0
    return tall


def _scale(sheet: Sheet, left: float, top: float) -> None:
    sheet.box(left, top, 0.35, 0.13, NONE)
    sheet.text(left + 0.175, top + 0.28, "none", size=7.5, ha="center")
    axes = sheet.axes(left + 0.6, top, 3.4, 0.13)
    steps = np.geomspace(RAREST, MOST, 256)
    axes.pcolormesh(steps, [0, 1], bar_colours(steps[:-1])[None])
    axes.set_xscale("log")
    axes.set_yticks([])
    axes.set_xticks([RAREST, 0.01, 0.02, 0.05, 0.1, 0.2, MOST], ["≤ 0.5 %", "1", "2", "5", "10", "20", "≥ 50 %"])
    axes.tick_params(labelsize=7.5, length=2)
    axes.minorticks_off()
    sheet.text(left + 4.35, top + 0.11, "share of a motif in the clip's signature", size=8, color=FAINT)


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
