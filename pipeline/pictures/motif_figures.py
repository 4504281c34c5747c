"""What motifs are: signatures as bars (Deep Motifs, figures 1 and 6), motifs as stick figures (figure 5)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.colors import LogNorm, to_rgb
from matplotlib.figure import Figure
from motionlake.arrays import Float64Array, FloatArray, Int64Array, IntArray
from motionlake.pictures.stick_figures import draw_strip
from motionlake.pictures.style import FAINT, NONE, TOP, Sheet, fitted, motif_colours, shades, styled, widest, width_of
from scipy.cluster.hierarchy import leaves_list, linkage

# One scale for all pictures, so that they compare: shares outside it take the colour of its ends.
RAREST: Final = 0.005
MOST: Final = 0.5
# From cold and light (rare) to hot and dark (frequent): lightness falls all the way.
HEAT: Final = ("#a9d0ec", "#6f9fd8", "#7b63b8", "#a63a8d", "#cf2554", "#b01017", "#5c0404")
BAR: Final = 0.165
GAP: Final = 0.13
MOST_CLASS: Final = 2.0
MOST_NAME: Final = 2.3
WIDE: Final = 6.9
ROW: Final = 1.22
STRIP: Final = 2.65
LEFT: Final = 1.55
SHARES: Final = 4


@dataclass(frozen=True)
class WordStrip:
    """A word: the clip it is from, when in that clip, and [n, 21, 3] moments of it."""

    clip: str
    when: str
    poses: FloatArray


@dataclass(frozen=True)
class MotifRow:
    """One motif of a contact sheet.

    Attributes:
        motif: its number.
        reason: why it is shown, such as the class that it stands for.
        colour: [3], its colour in bands.
        words: the closest to its centroid first, each from another clip.
        shares: by class, the share of its words that belong to the motif.
    """

    motif: int
    reason: str
    colour: Float64Array
    words: Sequence[WordStrip]
    shares: Mapping[str, float]


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
    colours = shades(np.asarray(scale(np.maximum(signatures, RAREST))), *HEAT)
    colours[signatures <= 0] = to_rgb(NONE)
    return colours


@styled
def signature_bars(
    groups: Mapping[str, Mapping[str, FloatArray]], order: IntArray, title: str, note: str = ""
) -> Figure:
    """Rows of bars, grouped by class, below a strip with the colours that bands give the motifs.

    Args:
        groups: by class, the signatures [K] of its clips by their names.
        order: [K] motifs from left to right (`motif_order`).
    """
    middle = 0.12 + widest(groups, 8.5, MOST_CLASS, "bold") + 0.2
    left = max(middle + widest((clip for clips in groups.values() for clip in clips), 7.5, MOST_NAME) + 0.1, 2.0)
    body = sum(len(clips) for clips in groups.values()) * BAR + (len(groups) - 1) * GAP
    sheet = Sheet(left + WIDE + 0.3, TOP + 0.35 + body + 0.95, title, note)
    sheet.image(left, TOP, WIDE, 0.14, motif_colours(order)[order][None])
    sheet.text(left - 0.1, TOP + 0.11, "motif colours in bands", size=7.5, color=FAINT, ha="right")
    top = TOP + 0.3
    for name, clips in groups.items():
        height = len(clips) * BAR
        pixels = np.repeat(bar_colours(np.stack([*clips.values()])[:, order]), 12, axis=0)
        pixels[10::12] = pixels[11::12] = 1.0  # a white line after each bar
        sheet.image(left, top, WIDE, height, pixels)
        sheet.text(0.12, top + 0.12, name, weight="bold", room=MOST_CLASS)
        for i, clip in enumerate(clips):
            sheet.text(left - 0.1, top + BAR * (i + 0.73), clip, size=7.5, ha="right", room=left - 0.1 - middle)
        top += height + GAP
    sheet.text(left, top + 0.06, f"{len(order)} motifs, similar ones side by side", size=8, color=FAINT)
    _scale(sheet, left, top + 0.28)
    return sheet.figure


def _scale(sheet: Sheet, left: float, top: float) -> None:
    sheet.box(left, top, 0.35, 0.13, NONE)
    sheet.text(left + 0.175, top + 0.28, "none", size=7.5, ha="center")
    axes = sheet.axes(left + 0.6, top, 3.4, 0.13)
    steps = np.geomspace(RAREST, MOST, 256)
    axes.pcolormesh(steps, [0, 1], bar_colours(steps[:-1])[None])
    axes.set(xscale="log", yticks=[])
    axes.set_xticks([RAREST, 0.01, 0.02, 0.05, 0.1, 0.2, MOST], ["≤ 0.5 %", "1", "2", "5", "10", "20", "≥ 50 %"])
    axes.minorticks_off()
    sheet.text(left + 4.35, top + 0.11, "share of a motif in the clip's signature", size=8, color=FAINT)


@styled
def contact_sheet(rows: Sequence[MotifRow], title: str, note: str = "", shares_title: str = "") -> Figure:
    """One row a motif: its words as stick figures in time, and its share in the classes where it is most common."""
    columns = max((len(row.words) for row in rows), default=1)
    bars = LEFT + columns * STRIP + 0.2
    sheet = Sheet(bars + 2.65, TOP + 0.25 + ROW * len(rows), title, note)
    sheet.text(LEFT, TOP + 0.08, "closest to the motif's centre", size=8, color=FAINT)
    if columns > 1:
        sheet.text(LEFT + STRIP, TOP + 0.08, "next closest, from other clips", size=8, color=FAINT)
    sheet.text(bars, TOP + 0.08, shares_title, size=8, color=FAINT)
    for i, row in enumerate(rows):
        _row(sheet, row, TOP + 0.2 + ROW * i, bars)
    return sheet.figure


def _row(sheet: Sheet, row: MotifRow, top: float, bars: float) -> None:
    sheet.box(0.12, top + 0.28, 0.16, 0.16, row.colour)
    sheet.text(0.36, top + 0.42, f"motif {row.motif}", size=9, weight="bold")
    sheet.text(0.12, top + 0.66, row.reason, size=8, room=LEFT - 0.2)
    for i, word in enumerate(row.words):
        left = LEFT + i * STRIP
        draw_strip(sheet, left, top, STRIP - 0.15, ROW - 0.24, word.poses)
        name = fitted(word.clip, STRIP - 0.2 - width_of(word.when, 7), 7)
        sheet.text(left + STRIP / 2 - 0.06, top + ROW - 0.14, name + word.when, size=7, color=FAINT, ha="center")
    held = sorted((pair for pair in row.shares.items() if pair[1] > 0), key=lambda pair: (-pair[1], pair[0]))
    if len(held) == 1:
        sheet.text(bars, top + 0.46, "nowhere else", size=8, color=FAINT)
    for i, (name, share) in enumerate(held[:SHARES]):
        y = top + 0.2 + 0.22 * i
        sheet.text(bars, y + 0.04, name, size=8, room=1.15)
        sheet.box(bars + 1.2, y - 0.07, 0.8 * share / held[0][1], 0.13, row.colour)
        sheet.text(bars + 2.05, y + 0.04, _percent(share), size=8)


def _percent(share: float) -> str:
    """One digit after the point below one per cent."""
    value = 100 * share
    if 0 < value < 0.05:
        return "< 0.1 %"
    return f"{value:.0f} %" if value >= 0.95 else f"{value:.1f} %"
