"""Two symbol strings and what is aligned to what (PESTA, figure 4): a matrix of posture distances, a path on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from motionlake.arrays import Float64Array, FloatArray, Int64Array, IntArray
from motionlake.pictures.stick_figures import draw_bodies, postures_view
from motionlake.pictures.style import FAINT, INK, TOP, Sheet, fitted, styled, width_of
from motionlake.pictures.symbol_strip import CHIP, chip

PATH: Final = "#CC3311"
OTHER: Final = "#0077BB"
WIDEST: Final = 11.0  # inches of the matrix
TALLEST: Final = 8.4
CELL: Final = 0.46
FIGURE: Final = 0.34  # least inches from figure to figure
LEFT: Final = 1.1
LINE: Final = 0.19


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
    """

    name: str
    pairs: IntArray

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
        paths: the one spoken of first, then others, dashed.
        colours: [m, 3] of symbols.
        title: one line.
        note: one line below it.
    """
    rows, columns = distances.shape
    cell = min(CELL, WIDEST / columns, TALLEST / rows)
    wide, tall = columns * cell, rows * cell
    room = max(wide + LEFT + 0.3, 8.6)
    legend = 2 + len(paths)
    foot = TOP + tall + 1.12
    sheet = Sheet(room, foot + 0.15 + legend * LINE, title, note)
    top = TOP + 0.08
    _matrix(sheet, distances, top, wide, tall)
    for cut in found.cuts:
        sheet.canvas.plot([LEFT + cut * cell] * 2, [top - 0.06, top + tall + 0.06], color=INK, linewidth=1.4, zorder=3)
    for path, colour in zip(paths, [PATH, *[OTHER] * len(paths)], strict=False):
        _path(sheet, path, top, cell, colour)
    strided = [paths[0].strided(axis) if paths else np.zeros(0, dtype=np.int64) for axis in (0, 1)]
    scale = float(np.clip(cell, FIGURE, 0.41)) / 0.82
    _side(sheet, query, colours, top, cell, scale, strided[0])
    _bottom(sheet, found, colours, top + tall, cell, scale, strided[1])
    _legend(sheet, query, found, paths, float(distances.max()), foot)
    return sheet.figure


def _shade() -> LinearSegmentedColormap:
    return LinearSegmentedColormap.from_list("distance", ["#ffffff", "#d9dde3", "#9aa3b0", "#5a6370"])


def _matrix(sheet: Sheet, distances: FloatArray, top: float, wide: float, tall: float) -> None:
    most = max(float(distances.max()), 1e-12)
    sheet.image(LEFT, top, wide, tall, np.asarray(_shade()(distances / most))[..., :3])
    sheet.canvas.add_patch(Rectangle((LEFT, top), wide, tall, fill=False, edgecolor=FAINT, linewidth=0.7, zorder=2))


def _path(sheet: Sheet, path: AlignedPath, top: float, cell: float, colour: str) -> None:
    x, y = LEFT + (path.pairs[:, 1] + 0.5) * cell, top + (path.pairs[:, 0] + 0.5) * cell
    dashes = "-" if colour == PATH else (0, (4, 2))
    size = float(np.clip(cell * 14, 1.5, 5.0))
    sheet.canvas.plot(x, y, color=colour, linewidth=1.6, linestyle=dashes, marker="o", markersize=size, zorder=4)


def _every(cell: float) -> int:
    """A figure at every so many symbols."""
    return int(np.ceil(FIGURE / cell - 1e-9))


def _side(
    sheet: Sheet, row: SymbolRow, colours: Float64Array, top: float, cell: float, scale: float,
    strided: Int64Array,
) -> None:  # fmt: skip
    step = max(_every(cell), int(np.ceil(scale * 0.9 / cell - 1e-9)))
    shown = np.arange(0, len(row.symbols), step)
    height = min(scale, step * cell / 1.28)
    middle = top + (shown + 0.5) * cell
    draw_bodies(
        sheet, postures_view(row.bodies[shown]), np.stack([np.full(len(shown), 0.42), middle + height / 2], axis=-1),
        height, 1.2,
    )  # fmt: skip
    for y, i in zip(middle, shown, strict=True):
        chip(sheet, LEFT - 0.24, float(y), int(row.symbols[i]), colours[row.symbols[i]])
    for i in strided.tolist():
        if step == 1:
            _boxed(sheet, 0.08, top + i * cell + 0.01, LEFT - 0.11, cell - 0.02)
        else:
            _boxed(sheet, LEFT - 0.07, top + i * cell, 0.06, cell)


def _bottom(
    sheet: Sheet, row: SymbolRow, colours: Float64Array, top: float, cell: float, scale: float,
    strided: Int64Array,
) -> None:  # fmt: skip
    step = _every(cell)
    shown = np.arange(0, len(row.symbols), step)
    middle = LEFT + (shown + 0.5) * cell
    draw_bodies(
        sheet,
        postures_view(row.bodies[shown]),
        np.stack([middle, np.full(len(shown), top + 0.82)], axis=-1),
        scale,
        1.2,
    )
    for x, i in zip(middle, shown, strict=True):
        chip(sheet, float(x), top + 0.09 + CHIP / 2, int(row.symbols[i]), colours[row.symbols[i]])
    for i in strided.tolist():
        if step == 1:
            _boxed(sheet, LEFT + i * cell + 0.01, top + 0.03, cell - 0.02, 0.88)
        else:
            _boxed(sheet, LEFT + i * cell, top + 0.01, cell, 0.06)


def _boxed(sheet: Sheet, left: float, top: float, width: float, height: float) -> None:
    sheet.canvas.add_patch(
        Rectangle(
            (left, top), width, height, fill=False, edgecolor=PATH, linewidth=1.1, linestyle=(0, (3, 1.5)), zorder=5
        )
    )


def _legend(
    sheet: Sheet, query: SymbolRow, found: SymbolRow, paths: Sequence[AlignedPath], most: float, top: float
) -> None:
    y = top + 0.12
    for side, row in (("left: the query ", query), ("below: ", found)):
        when = f", {row.when}"
        name = fitted(row.name, sheet.width - 2.6 - width_of(side + when, 8), 8)
        sheet.text(0.12, y, side + name + when, size=8, room=sheet.width - 2.5)
        y += LINE
    for path, colour in zip(paths, [PATH, *[OTHER] * len(paths)], strict=False):
        dashes = "-" if colour == PATH else (0, (4, 2))
        sheet.canvas.plot(
            [0.12, 0.5], [y - 0.04] * 2, color=colour, linewidth=1.6, linestyle=dashes, marker="o", markersize=3
        )
        sheet.text(0.6, y, path.name, size=8, color=INK, room=sheet.width - 3.0)
        y += LINE
    left = sheet.width - 2.1
    sheet.image(left, top + 0.03, 1.2, 0.12, np.asarray(_shade()(np.linspace(0, 1, 60)))[None, :, :3])
    sheet.canvas.add_patch(Rectangle((left, top + 0.03), 1.2, 0.12, fill=False, edgecolor=FAINT, linewidth=0.5))
    sheet.text(left + 1.26, top + 0.12, f"{most:.2f}", size=7.5, color=FAINT)
    sheet.text(left - 0.05, top + 0.12, "0", size=7.5, color=FAINT, ha="right")
    sheet.text(left, top + 0.3, "distance of postures", size=7.5, color=FAINT)
    if paths and any(len(paths[0].strided(axis)) for axis in (0, 1)):
        _boxed(sheet, left, top + 0.4, 0.16, 0.12)
        sheet.text(left + 0.22, top + 0.5, "skipped", size=7.5, color=FAINT)
