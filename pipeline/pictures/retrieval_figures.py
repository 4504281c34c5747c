"""Figures of retrieval (PESTA, figures 6 to 8): precision-recall curves, confusion matrices, robustness."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from motionlake.arrays import Float64Array
from motionlake.pictures.style import (
    FAINT,
    INK,
    TOP,
    ClassStyle,
    Sheet,
    class_styles,
    fitted,
    ink_on,
    plain,
    styled,
    width_of,
)
from numpy.typing import ArrayLike

PLOT: Final = 4.6
LEGEND: Final = 3.4  # at most
LINE: Final = 0.2
POINTS: Final = 101  # of recall at which the mean is taken
CELL: Final = 0.46
SMALLEST: Final = 0.24
MATRIX: Final = 7.2
NAME: Final = 2.2
# Classes beyond the palette's colours differ in their dashes.
DASHES: Final = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (5, 1.5, 1.2, 1.5)))
MEAN: Final = "mean of the classes"


@styled
def precision_recall_figure(
    curves: Mapping[str, tuple[ArrayLike, ArrayLike]],
    title: str = "Precision and recall",
    note: str = "",
    *,
    mean: bool = True,
) -> Figure:
    """One curve a class and the mean of all of them, or one a method.

    Args:
        curves: (recall [n], precision [n]) by name, recall ascending from 0 to 1 at most; the mean is interpolated
            linearly where all curves are known, and left out of a single one.
        title: one line.
        note: one line below it.
        mean: draw it.

    Raises:
        ValueError: no curves, arrays of other lengths than each other, recall that falls.
    """
    if not curves:
        raise ValueError("no curves to draw")
    known = {name: _curve(name, *pair) for name, pair in curves.items()}
    styles = class_styles(list(known))
    averaged = mean and len(known) > 1
    sheet, axes = _plot(title, note, [*known, MEAN] if averaged else list(known))
    marks: list[tuple[str, str, object, float]] = []
    for i, (name, (recall, precision)) in enumerate(known.items()):
        dashes = DASHES[i // 9 % len(DASHES)]
        axes.plot(recall, precision, color=styles[name].colour, linewidth=1.2, linestyle=dashes)
        marks.append((name, styles[name].colour, dashes, 1.2))
    if averaged:
        low = max(float(recall[0]) for recall, _ in known.values())
        high = min(float(recall[-1]) for recall, _ in known.values())
        at = np.linspace(low, high, POINTS)
        middle = np.mean([np.interp(at, recall, precision) for recall, precision in known.values()], axis=0)
        axes.plot(at, middle, color=INK, linewidth=2.4)
        marks.append((MEAN, INK, "-", 2.4))
    axes.set_xlabel("recall", fontsize=8)
    axes.set_ylabel("precision", fontsize=8)
    axes.set_xlim(0, 1)
    axes.set_ylim(0, 1.02)
    _line_legend(sheet, marks)
    return sheet.figure


def _curve(name: str, recall: ArrayLike, precision: ArrayLike) -> tuple[Float64Array, Float64Array]:
    x, y = np.asarray(recall, dtype=np.float64), np.asarray(precision, dtype=np.float64)
    if x.ndim != 1 or x.shape != y.shape or not len(x):
        raise ValueError(f"{name}: recall {x.shape} and precision {y.shape} are not two rows of one length")
    if np.any(np.diff(x) < 0):
        raise ValueError(f"{name}: recall falls; sort the curve by recall")
    return x, y


@styled
def confusion_figure(
    matrix: ArrayLike, classes: Sequence[str], title: str = "Confusion matrix", note: str = ""
) -> Figure:
    """Of the answers to queries of each class (a row), the share that is of each class (a column): darker is more.

    Args:
        matrix: [c, c] counts or shares; rows are made shares of their sum.
        classes: [c] names, in the order of the rows.
        title: one line.
        note: one line below it.

    Raises:
        ValueError: a matrix that is not square, does not fit the classes, or has a negative entry.
    """
    counts = np.asarray(matrix, dtype=np.float64)
    if counts.shape != (len(classes), len(classes)) or not len(classes):
        raise ValueError(f"a matrix of shape {counts.shape} does not fit {len(classes)} classes")
    if not np.all(counts >= 0):
        raise ValueError("a confusion matrix has no negative entries")
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1e-300)
    size = float(np.clip(MATRIX / len(classes), SMALLEST, CELL))
    letters = min(8.0, size * 38)
    left = 0.15 + min(NAME, max(width_of(plain(name), letters) for name in classes)) + 0.45
    side = size * len(classes)
    sheet = Sheet(max(left + side + 0.3, 5.2), TOP + 0.3 + side + 0.35, title, note)
    top = TOP + 0.26
    shade = LinearSegmentedColormap.from_list("share", ["#ffffff", "#9ecae1", "#2171b5", "#08306b"])
    sheet.image(left, top, side, side, np.asarray(shade(shares))[..., :3])
    for i, name in enumerate(classes):
        middle = (i + 0.5) * size
        number = str(i + 1)
        label = fitted(name, NAME, letters)
        sheet.text(left - 0.36, top + middle, label, size=letters, ha="right", va="center_baseline")
        sheet.text(left - 0.06, top + middle, number, size=letters, color=FAINT, ha="right", va="center_baseline")
        sheet.text(left + middle, top - 0.06, number, size=letters, color=FAINT, ha="center")
        for j in np.flatnonzero(shares[i] >= 0.005).tolist():
            said = f"{100 * shares[i, j]:.0f}"
            if width_of(said, 7) < size - 0.03:
                colour = np.asarray(shade(shares[i, j]))[:3]
                sheet.text(
                    left + (j + 0.5) * size, top + middle, said, size=7, color=ink_on(colour), ha="center",
                    va="center_baseline",
                )  # fmt: skip
    said = "rows: class of the query; columns: class of the answers; per cent of the row"
    sheet.text(0.15, top + side + 0.22, said, size=7.5, color=FAINT, room=sheet.width - 0.3)
    return sheet.figure


@styled
def robustness_figure(
    by_rate: Mapping[str, Mapping[float, float | Sequence[float]]],
    title: str = "Robustness",
    note: str = "",
    measure: str = "MAP",
) -> Figure:
    """How a measure falls as more of the clips is replaced (figure 8): a line a method.

    Args:
        by_rate: of each method, the measure by the share replaced (0 to 1); of several values, such as those of
            seeds, the mean is drawn, and their range as a band.
        title: one line.
        note: one line below it.
        measure: its name.

    Raises:
        ValueError: no methods, or a method without rates.
    """
    if not by_rate or not all(by_rate.values()):
        raise ValueError("no rates to draw")
    styles = class_styles(list(by_rate))
    sheet, axes = _plot(title, note, list(by_rate))
    marks: list[tuple[str, str, object, float]] = []
    for name, values in by_rate.items():
        rates = np.array(sorted(values), dtype=np.float64)
        found = [np.atleast_1d(np.asarray(values[rate], dtype=np.float64)) for rate in sorted(values)]
        style: ClassStyle = styles[name]
        means = [float(v.mean()) for v in found]
        axes.plot(
            100 * rates, means, color=style.colour, marker="osD^vPX"[len(marks) % 7], markersize=4.5, linewidth=1.5
        )
        axes.fill_between(
            100 * rates, [float(v.min()) for v in found], [float(v.max()) for v in found], color=style.colour,
            alpha=0.15, linewidth=0,
        )  # fmt: skip
        marks.append((name, style.colour, "-", 1.5))
    axes.set_xlabel("per cent of 10-frame pieces replaced by pieces of other classes", fontsize=8)
    axes.set_ylabel(measure, fontsize=8)
    _line_legend(sheet, marks)
    return sheet.figure


def _plot(title: str, note: str, names: Sequence[str]) -> tuple[Sheet, Axes]:
    height = max(PLOT * 0.8, len(names) * LINE)
    legend = min(LEGEND, 0.6 + max(width_of(plain(name), 8) for name in names))
    sheet = Sheet(0.65 + PLOT + 0.25 + legend, TOP + height + 0.55, title, note)
    axes = sheet.axes(0.65, TOP + 0.05, PLOT, PLOT * 0.8)
    axes.tick_params(labelsize=7.5, length=2)
    axes.grid(color="#ececec", linewidth=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return sheet, axes


def _line_legend(sheet: Sheet, marks: Sequence[tuple[str, str, object, float]]) -> None:
    left = 0.65 + PLOT + 0.25
    for i, (name, colour, dashes, width) in enumerate(marks):
        y = TOP + 0.15 + i * LINE
        sheet.canvas.plot([left, left + 0.35], [y, y], color=colour, linewidth=width, linestyle=dashes)
        sheet.text(left + 0.43, y, name, size=8, va="center_baseline", room=sheet.width - left - 0.5)
