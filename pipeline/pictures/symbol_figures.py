"""Symbol strings drawn: a clip and its string (PESTA, figure 3), two strings and what is aligned to what (figure 4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from motionlake.arrays import Float64Array, FloatArray, Int64Array, IntArray
from motionlake.pictures.stick_figures import draw_bodies, draw_moments, postures_view
from motionlake.pictures.style import (
    FAINT,
    INK,
    LINE,
    TOP,
    Sheet,
    fitted,
    ink_on,
    shades,
    styled,
    tick_seconds,
    width_of,
)

CHIP: Final = 0.15
SIZE: Final = 6.5


def chips(
    sheet: Sheet, x: FloatArray | float, y: FloatArray | float, symbols: IntArray, colours: Float64Array,
    size: float = SIZE,
) -> None:  # fmt: skip
    """The numbers of symbols [n] on their colours, around points `x` [n], `y` [n] in inches, either one for all."""
    for symbol, across, down in zip(symbols.tolist(), *np.broadcast_arrays(x, y, symbols)[:2], strict=True):
        width = width_of(str(symbol), size) + 0.05
        sheet.box(across - width / 2, down - CHIP / 2, width, CHIP, colours[symbol])
        ink = ink_on(colours[symbol])
        sheet.text(across, down, str(symbol), size=size, color=ink, ha="center", va="center_baseline")


LEFT: Final = 1.35
WIDE: Final = 10.4
MOMENTS: Final = 16
FIGURE: Final = 0.62  # inches of a body height
BAND: Final = 0.24
A_LINE: Final = 18  # postures of the final string
MOST_LINES: Final = 3


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
        seconds: its length.
        poses: [n, 21, 3] moments of it.
        moments: [n] seconds at which they are.
        runs: [r] symbols of its runs, before repeats are folded.
        run_starts: [r] seconds.
        symbols: [s].
        starts: [s] seconds; each symbol lasts to the next, the last to the end.
        bodies: [s, 21, 3] a posture for each symbol.
    """

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

    `sample` are the seconds between two coded postures; a run begins half of that before its first sample.
    """
    runs = np.asarray(clip.runs).tolist()
    begin = np.where(clip.run_starts > 0, clip.run_starts, -sample / 2)  # of the first run, before the clip's frames
    owner = np.searchsorted(clip.starts, begin + sample - 1e-9, side="left") - 1
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
    periods = (p for p in range(1, min(len(kept), len(removed)) + 1) if len(removed) % p == 0)
    return next((p for p in periods if list(removed) == list(kept[-p:]) * (len(removed) // p)), None)


@styled
def symbol_strip(
    clip: StripOfSymbols, folded: Sequence[Fold], colours: Float64Array, title: str, note: str = ""
) -> Figure:
    """(a) the clip's moments with their symbols, its runs in time, its string in time; (b) the string as postures.

    `folded` is what `folds` finds, `colours` [m, 3] those of symbols.
    """
    lines = min(MOST_LINES, -(-len(clip.symbols) // A_LINE))
    string = TOP + 2.12
    sheet = Sheet(LEFT + WIDE + 0.25, string + 0.15 + lines * 1.1, title, note)
    sheet.text(LEFT - 0.1, TOP + 0.48, "(a) moments", ha="right", size=8.5, weight="bold")
    sheet.text(LEFT - 0.1, TOP + 1.0, "their symbols", ha="right", va="center_baseline", size=8)
    places = draw_moments(sheet, LEFT, TOP + 0.86, WIDE, 0.95, clip.poses, FIGURE)
    held = clip.runs[np.searchsorted(clip.run_starts, clip.moments, side="right") - 1]
    chips(sheet, places, TOP + 1.0, held, colours)
    top = TOP + 1.14
    scale = WIDE / clip.seconds
    stops = np.append(clip.starts[1:], clip.seconds)
    stops[np.searchsorted(clip.starts, [fold.start for fold in folded], side="right") - 1] = [
        fold.start for fold in folded
    ]
    run_stops = np.append(clip.run_starts[1:], clip.seconds)
    for name, symbols, starts, ends in (
        ("runs", clip.runs, clip.run_starts, run_stops), ("string", clip.symbols, clip.starts, stops),
    ):  # fmt: skip
        sheet.text(LEFT - 0.1, top + BAND / 2, f"{name} ({len(symbols)})", ha="right", va="center_baseline", size=8)
        _symbol_band(sheet, top, symbols, LEFT + starts * scale, LEFT + ends * scale, colours)
        top += BAND + 0.07
    for fold in folded:
        _fold(sheet, fold, top - BAND - 0.07, scale)
    tick_seconds(sheet.bare(LEFT, top - 0.05, WIDE, 0.001, "bottom"), clip.seconds)
    sheet.text(LEFT - 0.2, top + 0.1, "seconds", size=7.5, color=FAINT, ha="right")
    _string(sheet, clip, colours, string)
    return sheet.figure


def _symbol_band(
    sheet: Sheet, top: float, symbols: IntArray, starts: Float64Array, stops: Float64Array, colours: Float64Array
) -> None:
    """Boxes from `starts[i]` to `stops[i]` inches, with numbers where there is room."""
    for symbol, start, stop in zip(symbols.tolist(), starts, stops, strict=True):
        sheet.box(start, top, max(stop - start - 0.008, 0.004), BAND, colours[symbol])
        if width_of(str(symbol), SIZE) + 0.03 < stop - start:
            sheet.text(
                (start + stop) / 2, top + BAND / 2, str(symbol), size=SIZE, color=ink_on(colours[symbol]),
                ha="center", va="center_baseline",
            )  # fmt: skip


def _fold(sheet: Sheet, fold: Fold, top: float, scale: float) -> None:
    left, width = LEFT + fold.start * scale, (fold.stop - fold.start) * scale
    sheet.box(left, top, max(width - 0.008, 0.004), BAND, "#efefef")
    sheet.canvas.plot([left, left + width], [top + BAND] * 2, color=FAINT, linewidth=0.8, zorder=3)
    if fold.period:
        again = fold.symbols // fold.period
        said = [f"the last {fold.period} symbols {again}× again", f"{fold.period} sym. +{again}×"]
    else:
        said = [f"{fold.symbols} symbols of repeats", f"{fold.symbols} folded"]
    for text in (*said, f"+{fold.symbols}"):
        if width_of(text, 7) <= width - 0.05:
            sheet.text(left + width / 2, top + BAND / 2, text, size=7, ha="center", va="center_baseline")
            return


def _string(sheet: Sheet, clip: StripOfSymbols, colours: Float64Array, top: float) -> None:
    shown = min(len(clip.symbols), A_LINE * MOST_LINES)
    view = postures_view(clip.bodies[:shown])
    highest = float(np.nanmax(view[..., 1], initial=1.2))
    column = WIDE / A_LINE
    row, place = np.divmod(np.arange(shown), A_LINE)
    x, ground = LEFT + (place + 0.5) * column, top + 0.82 + row * 1.1
    sheet.text(LEFT - 0.1, top + 0.5, "(b) string", ha="right", size=8.5, weight="bold")
    draw_bodies(sheet, view, x, ground, min(FIGURE, 0.86 / (highest + 0.1)))
    chips(sheet, x, ground + 0.17, clip.symbols[:shown], colours)
    joined = np.flatnonzero(place[: shown - 1] < A_LINE - 1)
    ends, y = np.stack([x[joined] + 0.17, x[joined] + column - 0.17]), ground[joined] + 0.17
    sheet.canvas.plot(ends, np.stack([y, y]), color="#c8c8c8", linewidth=0.8, zorder=0)
    if shown < len(clip.symbols):
        sheet.text(LEFT - 0.1, top + 0.7, f"the first {shown}", ha="right", size=8, color=FAINT)


PATH: Final = "#CC3311"
OTHER: Final = "#0077BB"
WIDEST: Final = 11.0  # inches of the matrix
TALLEST: Final = 8.4
CELL: Final = 0.46
LEAST_APART: Final = 0.34  # inches from figure to figure
SIDE: Final = 1.1
DISTANCES: Final = ("#ffffff", "#d9dde3", "#9aa3b0", "#5a6370")


@dataclass(frozen=True)
class SymbolRow:
    """A stretch of a string.

    Attributes:
        name: of the clip.
        when: its frames and seconds, in words.
        symbols: [n].
        bodies: [n, 21, 3] a posture for each.
        cuts: places at which another clip begins.
    """

    name: str
    when: str
    symbols: IntArray
    bodies: FloatArray
    cuts: Sequence[int] = ()


@dataclass(frozen=True)
class AlignedPath:
    """What is aligned to what.

    Attributes:
        name: in the legend, such as "hit 1, cost 3.2".
        pairs: [L, 2] (row of the query, column of the other string) in ascending order.
        compared: by another method, beside the path that is spoken of.
    """

    name: str
    pairs: IntArray
    compared: bool = False

    def strided(self, axis: int) -> Int64Array:
        """Symbols of the query (axis 0) or the other string (1) between the path's ends that it leaves out."""
        own = self.pairs[:, axis]
        return np.setdiff1d(np.arange(own[0], own[-1] + 1), own)


@styled
def alignment_matrix(
    query: SymbolRow, found: SymbolRow, distances: FloatArray, paths: Sequence[AlignedPath],
    colours: Float64Array, title: str, note: str = "",
) -> Figure:  # fmt: skip
    """The query down the left side, the other string along the bottom; the lighter a cell, the nearer two postures.

    Symbols that the first path strides over are boxed.

    Args:
        query: X symbols.
        found: Y symbols.
        distances: [X, Y] of their symbols.
        paths: the one spoken of first, then others, dashed, and those of other methods, dotted.
        colours: [m, 3] of symbols.
    """
    rows, columns = distances.shape
    cell = min(CELL, WIDEST / columns, TALLEST / rows)
    wide, tall = columns * cell, rows * cell
    foot = TOP + tall + 1.12
    sheet = Sheet(max(wide + SIDE + 0.3, 8.6), foot + 0.15 + (2 + len(paths)) * LINE, title, note)
    top = TOP + 0.08
    most = float(distances.max())
    sheet.image(SIDE, top, wide, tall, shades(np.asarray(distances) / max(most, 1e-12), *DISTANCES))
    sheet.outline(SIDE, top, wide, tall, edgecolor=FAINT, linewidth=0.7, zorder=2)
    for cut in found.cuts:
        sheet.canvas.plot([SIDE + cut * cell] * 2, [top - 0.06, top + tall + 0.06], color=INK, linewidth=1.4, zorder=3)
    for i, path in enumerate(paths):
        x, y = SIDE + (path.pairs[:, 1] + 0.5) * cell, top + (path.pairs[:, 0] + 0.5) * cell
        sheet.canvas.plot(x, y, markersize=float(np.clip(cell * 14, 1.5, 5.0)), zorder=4, **_look(i, path))
    _symbols(sheet, query, found, paths, colours, top, cell)
    _legend(sheet, query, found, paths, most, foot)
    return sheet.figure


def _look(place: int, path: AlignedPath) -> dict[str, Any]:
    if path.compared:
        return {"linewidth": 1.4, "marker": "", "color": INK, "linestyle": (0, (1, 1.2))}
    look: dict[str, Any] = {"color": OTHER, "linestyle": (0, (4, 2))} if place else {"color": PATH}
    return {"linewidth": 1.6, "marker": "o"} | look


def _symbols(
    sheet: Sheet, query: SymbolRow, found: SymbolRow, paths: Sequence[AlignedPath], colours: Float64Array, top: float,
    cell: float,
) -> None:  # fmt: skip
    """Chips and bodies of as many symbols as there is room for, boxes around those that are strided over."""
    scale = float(np.clip(cell, LEAST_APART, 0.41)) / 0.82
    across = _ceil(LEAST_APART / cell)
    down = max(across, _ceil(scale * 0.9 / cell))
    shown = np.arange(0, len(query.symbols), down)
    height, y = min(scale, down * cell / 1.28), top + (shown + 0.5) * cell
    draw_bodies(sheet, postures_view(query.bodies[shown]), 0.42, y + height / 2, height, 1.2)
    chips(sheet, SIDE - 0.24, y, query.symbols[shown], colours)
    shown = np.arange(0, len(found.symbols), across)
    bottom, x = top + len(query.symbols) * cell, SIDE + (shown + 0.5) * cell
    draw_bodies(sheet, postures_view(found.bodies[shown]), x, bottom + 0.82, scale, 1.2)
    chips(sheet, x, bottom + 0.09 + CHIP / 2, found.symbols[shown], colours)
    for path in paths[:1]:
        for i in path.strided(0).tolist():
            left, width, gap = (0.08, SIDE - 0.11, 0.01) if down == 1 else (SIDE - 0.07, 0.06, 0)
            _boxed(sheet, left, top + i * cell + gap, width, cell - 2 * gap)
        for i in path.strided(1).tolist():
            above, height, gap = (0.03, 0.88, 0.01) if across == 1 else (0.01, 0.06, 0)
            _boxed(sheet, SIDE + i * cell + gap, bottom + above, cell - 2 * gap, height)


def _ceil(value: float) -> int:
    return int(np.ceil(value - 1e-9))


def _boxed(sheet: Sheet, left: float, top: float, width: float, height: float) -> None:
    sheet.outline(left, top, width, height, edgecolor=PATH, linewidth=1.1, linestyle=(0, (3, 1.5)), zorder=5)


def _legend(
    sheet: Sheet, query: SymbolRow, found: SymbolRow, paths: Sequence[AlignedPath], most: float, top: float
) -> None:
    for i, (side, row) in enumerate((("left: the query ", query), ("below: ", found))):
        when = f", {row.when}"
        name = fitted(row.name, sheet.width - 2.6 - width_of(side + when, 8), 8)
        sheet.text(0.12, top + 0.12 + i * LINE, side + name + when, size=8, room=sheet.width - 2.5)
    for i, path in enumerate(paths):
        y = top + 0.12 + (2 + i) * LINE
        sheet.canvas.plot([0.12, 0.5], [y - 0.04] * 2, markersize=3, **_look(i, path))
        sheet.text(0.6, y, path.name, size=8, room=sheet.width - 3.0)
    left = sheet.width - 2.1
    sheet.image(left, top + 0.03, 1.2, 0.12, shades(np.linspace(0, 1, 60), *DISTANCES)[None])
    sheet.outline(left, top + 0.03, 1.2, 0.12, edgecolor=FAINT, linewidth=0.5)
    sheet.text(left + 1.26, top + 0.12, f"{most:.2f}", size=7.5, color=FAINT)
    sheet.text(left - 0.05, top + 0.12, "0", size=7.5, color=FAINT, ha="right")
    sheet.text(left, top + 0.3, "distance of postures", size=7.5, color=FAINT)
    if paths and any(len(paths[0].strided(axis)) for axis in (0, 1)):
        _boxed(sheet, left, top + 0.4, 0.16, 0.12)
        sheet.text(left + 0.22, top + 0.5, "skipped", size=7.5, color=FAINT)
