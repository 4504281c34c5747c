"""Symbols on a page: their number on a chip of their colour, runs of them along a line of time."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.pictures.style import Float64Array, Sheet, ink_on, width_of
from numpy.typing import NDArray

CHIP: Final = 0.15
SIZE: Final = 6.5


def chip(sheet: Sheet, x: float, y: float, symbol: int, colour: Float64Array, size: float = SIZE) -> None:
    """The number of a symbol on its colour, around `x`, `y` inches."""
    width = width_of(str(symbol), size) + 0.05
    sheet.box(x - width / 2, y - CHIP / 2, width, CHIP, tuple(colour))
    sheet.text(x, y, str(symbol), size=size, color=ink_on(colour), ha="center", va="center_baseline")


def symbol_band(
    sheet: Sheet, top: float, height: float, symbols: NDArray[np.integer], starts: Float64Array, stops: Float64Array,
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
