"""Symbols on a page: their number on a chip of their colour, runs of them along a line of time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.figure import Figure
from motionlake.arrays import Float64Array, FloatArray, IntArray
from motionlake.pictures.bands import second_ticks
from motionlake.pictures.stick_figures import body_height, draw_bodies, postures_view, three_quarter_view
from motionlake.pictures.style import FAINT, INK, TOP, Sheet, bare, fitted, ink_on, styled, width_of

CHIP: Final = 0.15
SIZE: Final = 6.5


def chip(sheet: Sheet, x: float, y: float, symbol: int, colour: Float64Array, size: float = SIZE) -> None:
    """The number of a symbol on its colour, around `x`, `y` inches."""
    width = width_of(str(symbol), size) + 0.05
    sheet.box(x - width / 2, y - CHIP / 2, width, CHIP, tuple(colour))
    sheet.text(x, y, str(symbol), size=size, color=ink_on(colour), ha="center", va="center_baseline")


def symbol_band(
    sheet: Sheet, top: float, height: float, symbols: IntArray, starts: Float64Array, stops: Float64Array,
    colours: Float64Array,
) -> None:  # fmt: skip
    """Boxes from `starts[i]` to `stops[i]` inches, with numbers where there is room."""
    for symbol, start, stop in zip(symbols.tolist(), starts, stops, strict=True):
        sheet.box(start, top, max(stop - start - 0.008, 0.004), height, tuple(colours[symbol]))
        if width_of(str(symbol), SIZE) + 0.03 < stop - start:
            sheet.text(
                (start + stop) / 2, top + height / 2, str(symbol), size=SIZE, color=ink_on(colours[symbol]),
                ha="center", va="center_baseline",
            )  # fmt: skip


LEFT: Final = 1.35
WIDE: Final = 10.4
MOMENTS: Final = 16
FIGURE: Final = 0.62  # inches of a body height
BAND: Final = 0.24
A_LINE: Final = 18  # postures of the final string
MOST_LINES: Final = 3
FOLDED: Final = "#efefef"


@dataclass(frozen=True)
class Fold:
    """A stretch [start, stop) in seconds that a tandem repeat was folded out of.

    Attributes:
        symbols: how many symbols were left out.
        period: how many the one instance has that was kept, where that can be told.
    """

    start: float
    stop: float
    symbols: int
    period: int | None


@dataclass(frozen=True)
class StripOfSymbols:
    """A clip of r runs and a string of s symbols.

    Attributes:
        frames: of the clip, at its own rate.
        seconds: its length.
        poses: [n, 21, 3] moments of it.
        moments: [n] seconds at which they are.
        runs: [r] symbols of its runs, before repeats are folded.
        run_starts: [r] seconds.
        symbols: [s].
        starts: [s] seconds; each symbol lasts to the next, the last to the end.
        bodies: [s, 21, 3] a posture for each symbol.
    """

    frames: int
    seconds: float
    poses: FloatArray
    moments: Float64Array
    runs: IntArray
    run_starts: Float64Array
    symbols: IntArray
    starts: Float64Array
    bodies: FloatArray


def folds(clip: StripOfSymbols, sample: float) -> list[Fold]:
    """The runs after the first one of each symbol of the string: instances of a repeat that the first stands for.

    Args:
        clip: the runs and the string.
        sample: seconds between two coded postures; a run begins half of that before its first sample.
    """
    runs = np.asarray(clip.runs).tolist()
    owner = np.searchsorted(clip.starts, clip.run_starts + sample - 1e-9, side="left") - 1
    edges = np.append(clip.run_starts, clip.seconds)
    found = []
    for symbol in np.unique(owner).tolist():
        own = np.flatnonzero(owner == symbol)
        if len(own) > 1:
            first, last = int(own[0]), int(own[-1])
            period = _period(runs[: first + 1], runs[first + 1 : last + 1])
            found.append(Fold(float(edges[first + 1]), float(edges[last + 1]), last - first, period))
    return found


def _period(kept: Sequence[int], removed: Sequence[int]) -> int | None:
    """The least p so that what was removed is the last p kept symbols again and again."""
    for p in range(1, min(len(kept), len(removed)) + 1):
        if len(removed) % p == 0 and list(removed) == list(kept[-p:]) * (len(removed) // p):
            return p
    return None


@styled
def symbol_strip(
    clip: StripOfSymbols, folded: Sequence[Fold], colours: Float64Array, title: str, note: str = ""
) -> Figure:
    """(a) the clip's moments with their symbols, its runs in time, its string in time; (b) the string as postures.

    Args:
        clip: what is drawn.
        folded: as `folds` finds them.
        colours: [m, 3] of symbols.
        title: one line.
        note: one line below it.
    """
    lines = min(MOST_LINES, -(-len(clip.symbols) // A_LINE))
    first = TOP + 2.12
    sheet = Sheet(LEFT + WIDE + 0.25, first + 0.15 + lines * 1.1, title, note)
    _moments(sheet, clip, colours, TOP - 0.14)
    top = TOP + 1.14
    scale = WIDE / clip.seconds
    for name, symbols, starts in (("runs", clip.runs, clip.run_starts), ("string", clip.symbols, clip.starts)):
        stops = np.append(starts[1:], clip.seconds)
        if name == "string":
            own = np.searchsorted(starts, [fold.start for fold in folded], side="right") - 1
            stops[own] = [fold.start for fold in folded]
        sheet.text(LEFT - 0.1, top + BAND / 2, f"{name} ({len(symbols)})", ha="right", va="center_baseline", size=8)
        symbol_band(sheet, top, BAND, symbols, LEFT + starts * scale, LEFT + stops * scale, colours)
        top += BAND + 0.07
    for fold in folded:
        _fold(sheet, fold, top - BAND - 0.07, scale)
    axis = bare(sheet.axes(LEFT, top - 0.05, WIDE, 0.001), "bottom")
    axis.set_xlim(0, clip.seconds)
    axis.xaxis.set_major_locator(second_ticks())
    axis.tick_params(labelsize=7.5, length=2, pad=1.5)
    sheet.text(LEFT - 0.2, top + 0.1, "seconds", size=7.5, color=FAINT, ha="right")
    _string(sheet, clip, colours, first)
    return sheet.figure


def _moments(sheet: Sheet, clip: StripOfSymbols, colours: Float64Array, top: float) -> None:
    view = three_quarter_view(clip.poses) / body_height(clip.poses)
    tall = max(1.3, float(view[..., 1].max()) + 0.1)
    scale = min(FIGURE, 0.95 / tall)
    ground = top + 1.0
    places = LEFT + (np.arange(len(view)) + 0.5) * WIDE / len(view)
    sheet.text(LEFT - 0.1, top + 0.62, "(a) moments", ha="right", size=8.5, weight="bold")
    sheet.text(LEFT - 0.1, top + 1.14, "their symbols", ha="right", va="center_baseline", size=8)
    sheet.canvas.plot([LEFT, LEFT + WIDE], [ground + 0.03] * 2, color="#c8c8c8", linewidth=0.8, zorder=1)
    draw_bodies(sheet, view, np.stack([places, np.full(len(view), ground)], axis=-1), scale)
    held = clip.runs[np.searchsorted(clip.run_starts, clip.moments, side="right") - 1]
    for place, symbol in zip(places, held.tolist(), strict=True):
        chip(sheet, place, top + 1.14, symbol, colours[symbol])


def _fold(sheet: Sheet, fold: Fold, top: float, scale: float) -> None:
    left, width = LEFT + fold.start * scale, (fold.stop - fold.start) * scale
    sheet.box(left, top, max(width - 0.008, 0.004), BAND, FOLDED)
    sheet.canvas.plot([left, left + width], [top + BAND] * 2, color=FAINT, linewidth=0.8, zorder=3)
    if fold.period:
        again = fold.symbols // fold.period
        text = f"the last {fold.period} symbols {again}× again"
        short = f"{fold.period} sym. +{again}×"
    else:
        text, short = f"{fold.symbols} symbols of repeats", f"{fold.symbols} folded"
    for said in (text, short, f"+{fold.symbols}"):
        if fitted(said, width - 0.05, 7) == said:
            sheet.text(left + width / 2, top + BAND / 2, said, size=7, color=INK, ha="center", va="center_baseline")
            return


def _string(sheet: Sheet, clip: StripOfSymbols, colours: Float64Array, top: float) -> None:
    shown = min(len(clip.symbols), A_LINE * MOST_LINES)
    view = postures_view(clip.bodies[:shown])
    drawn = np.isfinite(view).all(axis=(1, 2))
    scale = FIGURE if not drawn.any() else min(FIGURE, 0.86 / max(1.3, float(view[drawn][..., 1].max()) + 0.1))
    column = WIDE / A_LINE
    row, place = np.divmod(np.arange(shown), A_LINE)
    x, ground = LEFT + (place + 0.5) * column, top + 0.82 + row * 1.1
    sheet.text(LEFT - 0.1, top + 0.5, "(b) string", ha="right", size=8.5, weight="bold")
    draw_bodies(sheet, view, np.stack([x, ground], axis=-1), scale)
    for i, symbol in enumerate(clip.symbols[:shown].tolist()):
        chip(sheet, float(x[i]), float(ground[i]) + 0.17, symbol, colours[symbol])
        if i + 1 < shown and place[i] < A_LINE - 1:
            sheet.canvas.plot(
                [x[i] + 0.17, x[i] + column - 0.17], [ground[i] + 0.17] * 2, color="#c8c8c8", linewidth=0.8, zorder=0
            )
    left_out = len(clip.symbols) - shown
    if left_out:
        sheet.text(LEFT - 0.1, top + 0.7, f"the first {shown}", ha="right", size=8, color=FAINT)
