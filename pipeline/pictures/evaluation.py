"""Figures of retrieval (PESTA, figures 6 to 8), and pictures of what `evaluate_descriptor`, `evaluate_pesta` found."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from motionlake.arrays import Float64Array
from motionlake.deep_motifs.clip_map import LEAST, PERPLEXITY, tsne
from motionlake.evaluation.descriptor import DescriptorEvaluation
from motionlake.evaluation.pesta.whole import ONE_WAY
from motionlake.pictures.html import Picture, picture
from motionlake.pictures.maps import clip_map
from motionlake.pictures.style import (
    FAINT,
    INK,
    LINE,
    TOP,
    Line,
    Sheet,
    class_styles,
    fitted,
    ink_on,
    shades,
    styled,
    widest,
    width_of,
)
from numpy.typing import ArrayLike

PLOT: Final = (4.6, 3.68)
LEGEND: Final = 2.8  # at most
POINTS: Final = 101  # of recall at which the mean is taken
CELL: Final = 0.46
SMALLEST: Final = 0.24
MATRIX: Final = 7.2
NAME: Final = 2.2
SHARE: Final = ("#ffffff", "#9ecae1", "#2171b5", "#08306b")
# Classes beyond the palette's colours differ in their dashes.
DASHES: Final = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (5, 1.5, 1.2, 1.5)))
MEAN: Final = "mean of the classes"


@styled
def precision_recall_figure(
    curves: Mapping[str, tuple[ArrayLike, ArrayLike]], title: str = "Precision and recall", note: str = "", *,
    mean: bool = True,
) -> Figure:  # fmt: skip
    """One curve a class and the mean of all of them, or one a method.

    Args:
        curves: (recall [n], precision [n]) by name, recall ascending from 0 to 1 at most.
        mean: draw it, where all curves are known, interpolated linearly; it is left out of a single one.

    Raises:
        ValueError: no curves, arrays of other lengths than each other, recall that falls.
    """
    if not curves:
        raise ValueError("no curves to draw")
    known = {name: _curve(name, *pair) for name, pair in curves.items()}
    styles = class_styles(known)
    lines: list[Line] = [
        (name, {"color": styles[name].colour, "linewidth": 1.2, "linestyle": DASHES[i // 9 % len(DASHES)]})
        for i, name in enumerate(known)
    ]
    drawn = list(known.values())
    if mean and len(known) > 1:
        at = np.linspace(max(recall[0] for recall, _ in drawn), min(recall[-1] for recall, _ in drawn), POINTS)
        drawn.append((at, np.mean([np.interp(at, recall, precision) for recall, precision in drawn], axis=0)))
        lines.append((MEAN, {"color": INK, "linewidth": 2.4}))
    sheet, axes = _plot(title, note, "recall", "precision", lines)
    for (_, look), (recall, precision) in zip(lines, drawn, strict=True):
        axes.plot(recall, precision, **look)
    axes.set(xlim=(0, 1), ylim=(0, 1.02))
    return sheet.figure


def _curve(name: str, recall: ArrayLike, precision: ArrayLike) -> tuple[Float64Array, Float64Array]:
    x, y = np.asarray(recall, dtype=np.float64), np.asarray(precision, dtype=np.float64)
    if x.ndim != 1 or x.shape != y.shape or not len(x):
        raise ValueError(f"{name}: recall {x.shape} and precision {y.shape} are not two rows of one length")
    if np.any(np.diff(x) < 0):
        raise ValueError(f"{name}: recall falls; sort the curve by recall")
    return x, y


def _plot(title: str, note: str, across: str, up: str, lines: Sequence[Line]) -> tuple[Sheet, Axes]:
    """A sheet with axes and, beside them, the legend of lines that are drawn with these keywords."""
    wide, tall = PLOT
    left = 0.65 + wide + 0.25
    legend = 0.6 + widest((name for name, _ in lines), 8, LEGEND)
    sheet = Sheet(left + legend, TOP + max(tall, len(lines) * LINE) + 0.55, title, note)
    axes = sheet.plot(0.65, TOP + 0.05, wide, tall, across, up)
    sheet.line_legend(left, lines)
    return sheet, axes


@styled
def confusion_figure(
    matrix: ArrayLike, classes: Sequence[str], title: str = "Confusion matrix", note: str = ""
) -> Figure:
    """Of the answers to queries of each class (a row), the share that is of each class (a column): darker is more.

    `matrix` [c, c] holds counts or shares of the [c] `classes`; rows are made shares of their sum.

    Raises:
        ValueError: a matrix that is not square, does not fit the classes, or has a negative entry.
    """
    counts = np.asarray(matrix, dtype=np.float64)
    if counts.shape != (len(classes), len(classes)) or not len(classes):
        raise ValueError(f"a matrix of shape {counts.shape} does not fit {len(classes)} classes")
    if not np.all(counts >= 0):
        raise ValueError("a confusion matrix has no negative entries")
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1e-300)
    colours = shades(shares, *SHARE)
    size = float(np.clip(MATRIX / len(classes), SMALLEST, CELL))
    letters = min(8.0, size * 38)
    left = 0.15 + widest(classes, letters, NAME) + 0.45
    side = size * len(classes)
    sheet = Sheet(max(left + side + 0.3, 5.2), TOP + 0.3 + side + 0.35, title, note)
    top = TOP + 0.26
    sheet.image(left, top, side, side, colours)
    for i, name in enumerate(classes):
        middle = (i + 0.5) * size
        number = str(i + 1)
        label = fitted(name, NAME, letters)
        sheet.text(left - 0.36, top + middle, label, size=letters, ha="right", va="center_baseline")
        sheet.text(left - 0.06, top + middle, number, size=letters, color=FAINT, ha="right", va="center_baseline")
        sheet.text(left + middle, top - 0.06, number, size=letters, color=FAINT, ha="center")
        for j in np.flatnonzero(shares[i] >= 0.005).tolist():
            said, ink = f"{100 * shares[i, j]:.0f}", ink_on(colours[i, j])
            if width_of(said, 7) < size - 0.03:
                x, y = left + (j + 0.5) * size, top + middle
                sheet.text(x, y, said, size=7, color=ink, ha="center", va="center_baseline")
    said = "rows: class of the query; columns: class of the answers; per cent of the row"
    sheet.text(0.15, top + side + 0.22, said, size=7.5, color=FAINT, room=sheet.width - 0.3)
    return sheet.figure


@styled
def robustness_figure(
    by_rate: Mapping[str, Mapping[float, float | Sequence[float]]], title: str = "Robustness", note: str = ""
) -> Figure:
    """How MAP falls as more of the clips is replaced (figure 8): a line a method.

    `by_rate` has of each method MAP by the share replaced (0 to 1); of several values, such as those of seeds, the
    mean is drawn, and their range as a band.

    Raises:
        ValueError: no methods, or a method without rates.
    """
    if not by_rate or not all(by_rate.values()):
        raise ValueError("no rates to draw")
    styles = class_styles(by_rate)
    lines: list[Line] = [(name, {"color": styles[name].colour, "linewidth": 1.5}) for name in by_rate]
    across = "per cent of pieces replaced by pieces of other classes"
    sheet, axes = _plot(title, note, across, "MAP", lines)
    for i, ((_, look), values) in enumerate(zip(lines, by_rate.values(), strict=True)):
        rates = sorted(values)
        found = [np.atleast_1d(np.asarray(values[rate], dtype=np.float64)) for rate in rates]
        low, mean, high = np.array([(v.min(), v.mean(), v.max()) for v in found]).T
        x = 100 * np.array(rates)
        axes.plot(x, mean, marker="osD^vPX"[i % 7], markersize=4.5, **look)
        axes.fill_between(x, low, high, color=look["color"], alpha=0.15, linewidth=0)
    return sheet.figure


@styled
def sizes_figure(
    by_size: Mapping[str, Mapping[int, float]],
    up: str,
    title: str = "Sizes of the dictionary",
    note: str = "",
    *,
    span: float = 0.1,
) -> Figure:
    """What changes with the number of symbols of a dictionary (table 6): a line for each measure, by m.

    Args:
        by_size: each measure, none below 0.
        up: what all measures are in.
        title, note: above it.
        span: the axis of the measures reaches over so much at least, or to 0, so that small differences look small.

    Raises:
        ValueError: no measures, or a measure without sizes.
    """
    if not by_size or not all(by_size.values()):
        raise ValueError("no sizes to draw")
    styles = class_styles(by_size)
    lines: list[Line] = [(name, {"color": styles[name].colour, "linewidth": 1.5}) for name in by_size]
    sheet, axes = _plot(title, note, "symbols of the dictionary", up, lines)
    for i, ((_, look), values) in enumerate(zip(lines, by_size.values(), strict=True)):
        sizes = sorted(values)
        axes.plot(sizes, [values[m] for m in sizes], marker="osD^vPX"[i % 7], markersize=4.5, **look)
    low, high = axes.get_ylim()
    bottom = max(0.0, min(low, high - span))
    axes.set_ylim(bottom, high + 0.03 * (high - bottom))
    axes.set_xlim(left=0)
    return sheet.figure


@styled
def loss_figure(losses: Sequence[float], name: str, title: str, note: str = "") -> Figure:
    """The loss of a training after each epoch, as a share of that of the first.

    A loss of zero, which has no place on the scale, is a gap.

    Raises:
        ValueError: no losses.
    """
    if not len(losses):
        raise ValueError("no losses to draw")
    shares = np.asarray(losses, dtype=np.float64) / max(losses[0], 1e-12)
    look: dict[str, Any] = {"color": class_styles([name])[name].colour, "linewidth": 1.6}
    sheet, axes = _plot(title, note, "epoch", "loss, share of the first epoch", [(name, look)])
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    epochs = np.arange(1, len(shares) + 1)
    axes.plot(epochs, np.where(shares > 0, shares, np.nan), marker="o" if len(shares) == 1 else "", **look)
    return sheet.figure


def descriptor_pictures(measured: DescriptorEvaluation) -> list[Picture]:
    """Precision and recall of all methods, the t-SNE map of the queries, the network's loss where it was recorded."""
    found = measured.found
    model = found["model"]["model"]
    note = f"{found['protocol']}: {found['n']} queries, {found['repository']} clips to find"
    rows = {"descriptor": found} | {name: row for name, row in found["methods"].items() if row is not None}
    curves = _curves({f"{name}, area {row['pr_area']:.3f}": row for name, row in rows.items()}.items())
    title = "Precision and recall by method"
    figure = precision_recall_figure(curves, title, note, mean=False)
    made = [picture("precision-recall", title, "Mean over the queries.", figure)]
    if len(measured.labels) >= LEAST:
        title = "Descriptors of the queries"
        said = f"{model}; t-SNE, perplexity {PERPLEXITY:.0f}; the axes have no meaning of their own"
        figure = clip_map(tsne(measured.descriptors), measured.labels, title, said)
        made.append(picture("descriptors-tsne", title, "Each point a clip; near points, near descriptors.", figure))
    if measured.loss:
        title = f"Training of {model}"
        figure = loss_figure(measured.loss, model, title)
        made.append(picture("learning-curve", title, "Loss as a share of its first value.", figure))
    return made


def evaluation_pictures(found: Mapping[str, Any]) -> list[Picture]:
    """Precision and recall of all methods, of strided alignment by class, and the confusion of each method.

    Of holistic queries the same; of replaced pieces how MAP falls; of sizes of the dictionary what they find and cost.
    None where nothing of it was measured.
    """
    made = _ranked_pictures(
        {name: row for name, row in found.items() if row is not None and "curve" in row and not name.endswith(ONE_WAY)}
    )
    if holistic := found.get("holistic"):
        made += _ranked_pictures(holistic, "holistic-", "Each segment is looked for in the other clips.", 10)
    if robust := found.get("robustness"):
        by_share = {
            method: {float(share): row["map"] for share, row in rows.items()} for method, rows in robust.items()
        }
        said = "MAP of whole clips by the share of their pieces that was replaced."
        made.append(picture("robustness", "Robustness", said, robustness_figure(by_share)))
    if sizes := found.get("sizes"):
        made += _sizes_pictures({int(m): row for m, row in sizes.items()})
    return made


def _sizes_pictures(rows: Mapping[int, Mapping[str, Any]]) -> list[Picture]:
    least = rows[min(rows)]
    found = {name: {m: row[key] for m, row in rows.items()} for name, key in (("MAP", "map"), ("P@5", "p_at_5"))}
    grown = {
        name: {m: row[key] / least[key] for m, row in rows.items()}
        for name, key in (("length of the repository", "symbols"), ("time of a query", "milliseconds"))
    }
    title, dearer = "Sizes of the dictionary", "What larger dictionaries cost"
    note = f"times that of {min(rows)} symbols: {least['symbols']} symbols, {least['milliseconds']:.2g} ms"
    costs = sizes_figure(grown, f"times that of {min(rows)} symbols", dearer, note, span=np.inf)
    return [
        picture("sizes", title, "Each labelled clip queries all others.", sizes_figure(found, "MAP, P@5", title)),
        picture("sizes-cost", dearer, note, costs),
    ]


def _ranked_pictures(
    rows: Mapping[str, Any], prefix: str = "", about: str = "Each labelled clip queries all others.", first: int = 20
) -> list[Picture]:
    rows = {name: row for name, row in rows.items() if row["curve"]["recall"]}
    if not rows:
        return []
    by_method = precision_recall_figure(_curves(rows.items()), mean=False)
    made = [("precision-recall", "Precision and recall by method", by_method)]
    if "sta" in rows:
        strided = rows["sta"]["curve"]
        by_class = {label: (strided["recall"], precision) for label, precision in strided["by_class"].items()}
        figure = precision_recall_figure(by_class, "Strided alignment")
        made.append(("precision-recall-sta", "Strided alignment by class", figure))
    for name, row in rows.items():
        confused, title = row["confusion"], f"First {first} hits: {name}"
        made.append((f"confusion-{name}", title, confusion_figure(confused["counts"], confused["classes"], title)))
    return [picture(f"{prefix}{name}", title, about, figure) for name, title, figure in made]


def _curves(rows: Iterable[tuple[str, Mapping[str, Any]]]) -> dict[str, tuple[ArrayLike, ArrayLike]]:
    return {name: (row["curve"]["recall"], row["curve"]["precision"]) for name, row in rows}
