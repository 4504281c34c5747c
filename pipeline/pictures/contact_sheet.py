"""Motifs as stick figures (Deep Motifs, figure 5): words near the centroid, and how common it is in each class."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.figure import Figure
from motionlake.pictures.stick_figures import draw_strip
from motionlake.pictures.style import FAINT, TOP, Float64Array, Sheet, fitted, percent, styled, width_of
from numpy.typing import NDArray

ROW: Final = 1.22
STRIP: Final = 2.65
LEFT: Final = 1.55
SHARES: Final = 2.5
BARS: Final = 4


@dataclass(frozen=True)
class WordStrip:
    """A word: the clip it is from, when in that clip, and [n, 21, 3] moments of it."""

    clip: str
    when: str
    poses: NDArray[np.floating]


@dataclass(frozen=True)
class MotifRow:
    """One motif of a contact sheet.

    Attributes:
        motif: its number.
        reason: why it is shown, such as the class that it stands for.
        colour: [3], its colour in bands.
        words: the closest to its centroid first, each from another clip.
        shares: (class, share of the words of that class that belong to the motif).
    """

    motif: int
    reason: str
    colour: Float64Array
    words: Sequence[WordStrip]
    shares: Sequence[tuple[str, float]]


@styled
def contact_sheet(rows: Sequence[MotifRow], title: str, note: str = "", shares_title: str = "") -> Figure:
    """One row a motif: its words as stick figures in time, and its share in the classes where it is most common."""
    columns = max((len(row.words) for row in rows), default=1)
    bars = LEFT + columns * STRIP + 0.2
    sheet = Sheet(bars + SHARES + 0.15, TOP + 0.25 + ROW * len(rows), title, note)
    sheet.text(LEFT, TOP + 0.08, "closest to the motif's centre", size=8, color=FAINT)
    if columns > 1:
        sheet.text(LEFT + STRIP, TOP + 0.08, "next closest, from other clips", size=8, color=FAINT)
    sheet.text(bars, TOP + 0.08, shares_title, size=8, color=FAINT)
    for i, row in enumerate(rows):
        _draw_row(sheet, row, TOP + 0.2 + ROW * i, bars)
    return sheet.figure


def _draw_row(sheet: Sheet, row: MotifRow, top: float, bars: float) -> None:
    sheet.box(0.12, top + 0.28, 0.16, 0.16, tuple(row.colour))
    sheet.text(0.36, top + 0.42, f"motif {row.motif}", size=9, weight="bold")
    sheet.text(0.12, top + 0.66, row.reason, size=8, room=LEFT - 0.2)
    for i, word in enumerate(row.words):
        left = LEFT + i * STRIP
        draw_strip(sheet, left, top, STRIP - 0.15, ROW - 0.24, word.poses)
        name = fitted(word.clip, STRIP - 0.2 - width_of(word.when, 7), 7)
        sheet.text(left + STRIP / 2 - 0.06, top + ROW - 0.14, name + word.when, size=7, color=FAINT, ha="center")
    held = [(name, share) for name, share in row.shares if share > 0]
    shown = sorted(held, key=lambda s: (-s[1], s[0]))[:BARS]
    if len(held) == 1:
        sheet.text(bars, top + 0.46, "nowhere else", size=8, color=FAINT)
    most = max((share for _, share in shown), default=0.0) or 1.0
    for i, (name, share) in enumerate(shown):
        y = top + 0.2 + 0.22 * i
        sheet.text(bars, y + 0.04, name, size=8, room=1.15)
        sheet.box(bars + 1.2, y - 0.07, 0.8 * share / most, 0.13, tuple(row.colour))
        sheet.text(bars + 2.05, y + 0.04, percent(share), size=8)
