"""Signatures as bars (Deep Motifs, figures 1 and 6): one row a clip, one column a motif, hot is frequent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.colors import LogNorm, to_rgb
from matplotlib.figure import Figure
from motionlake.arrays import Float64Array, FloatArray, Int64Array, IntArray
from motionlake.pictures.style import FAINT, NONE, TOP, Sheet, frequency_map, motif_colours, plain, styled, width_of
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
