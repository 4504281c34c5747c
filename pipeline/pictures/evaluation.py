"""Pictures of what `evaluate_descriptor` found: precision-recall curves, map of descriptors, loss (DeepHuMS, 3.3)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from motionlake.arrays import Float64Array
from motionlake.evaluation.descriptor import DescriptorEvaluation
from motionlake.pictures.html import Picture, picture
from motionlake.pictures.maps import PERPLEXITY, descriptor_map
from motionlake.pictures.retrieval_figures import confusion_figure, precision_recall_figure
from motionlake.pictures.style import TOP, Sheet, class_styles, plain, styled, width_of

PANEL: Final = (3.7, 3.0)
GAP: Final = 0.75
LINE: Final = 0.2
LEGEND: Final = 3.0  # at most


@dataclass(frozen=True)
class LearningCurve:
    """Of one training: a value an epoch; what was not measured is left empty.

    Attributes:
        loss: of training.
        validation: top-1 of the clips that training did not see, from 0 to 1.
    """

    loss: Sequence[float]
    validation: Sequence[float] = ()


@styled
def learning_curves_figure(
    curves: Mapping[str, Sequence[LearningCurve]],
    title: str = "Learning curves",
    note: str = "",
    *,
    unit: str = "epoch",
    measure: str = "validation top-1",
) -> Figure:
    """Loss, as a share of that of the first epoch, and beside it the validation, where any method has it.

    Losses of different methods have no common unit; hence the share.

    Args:
        curves: of each method, one a seed; the mean is drawn, and the range of several as a band.
        title: one line.
        note: one line below it.
        unit: what is counted to the right.
        measure: name of the validation.

    Raises:
        ValueError: no methods, or a method without a loss.
    """
    if not curves or not all(runs and all(len(run.loss) for run in runs) for runs in curves.values()):
        raise ValueError("no learning curves to draw")
    validated = any(len(run.validation) for runs in curves.values() for run in runs)
    panels = 2 if validated else 1
    styles = class_styles(list(curves))
    legend = min(LEGEND, 0.6 + max(width_of(plain(name), 8) for name in curves))
    left = 0.65 + panels * PANEL[0] + (panels - 1) * GAP + 0.25
    height = max(PANEL[1], len(curves) * LINE)
    sheet = Sheet(left + legend, TOP + height + 0.55, title, note)
    losses = _panel(sheet, 0, f"loss, share of the first {unit}", unit)
    losses.set_yscale("log")
    losses.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    losses.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    losses.yaxis.set_minor_formatter(NullFormatter())
    for name, runs in curves.items():
        _draw(losses, [_shares(run.loss) for run in runs], styles[name].colour)
    if validated:
        axes = _panel(sheet, 1, measure, unit)
        axes.set_ylim(0, 1.02)
        for name, runs in curves.items():
            _draw(axes, [np.asarray(run.validation) for run in runs if len(run.validation)], styles[name].colour)
    for i, name in enumerate(curves):
        y = TOP + 0.15 + i * LINE
        sheet.canvas.plot([left, left + 0.35], [y, y], color=styles[name].colour, linewidth=1.6)
        sheet.text(left + 0.43, y, name, size=8, va="center_baseline", room=sheet.width - left - 0.5)
    return sheet.figure


def _panel(sheet: Sheet, place: int, name: str, unit: str) -> Axes:
    axes = sheet.axes(0.65 + place * (PANEL[0] + GAP), TOP + 0.05, *PANEL)
    axes.tick_params(labelsize=7.5, length=2, which="both")
    axes.grid(color="#ececec", linewidth=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.set_xlabel(unit, fontsize=8)
    axes.set_ylabel(name, fontsize=8)
    return axes


def _shares(losses: Sequence[float]) -> Float64Array:
    """Of the first; a loss of zero, which has no place on the scale, is a gap."""
    values = np.asarray(losses, dtype=np.float64) / max(losses[0], 1e-12)
    return np.where(values > 0, values, np.nan)


def _draw(axes: Axes, runs: Sequence[Float64Array], colour: str) -> None:
    """Runs of different lengths are drawn as far as all of them go."""
    if not runs:
        return
    length = min(map(len, runs))
    rows = np.array([run[:length] for run in runs], dtype=np.float64)
    at = np.arange(1, length + 1)
    axes.plot(at, rows.mean(axis=0), color=colour, linewidth=1.6, marker="o" if length == 1 else "")
    if len(rows) > 1:
        axes.fill_between(at, rows.min(axis=0), rows.max(axis=0), color=colour, alpha=0.18, linewidth=0)


LEAST_MAPPED: Final = 4


def descriptor_pictures(measured: DescriptorEvaluation) -> list[Picture]:
    """Precision and recall of all methods, the t-SNE map of the queries, the network's loss where it was recorded."""
    found = measured.found
    model = found["model"]["model"]
    note = f"{found['protocol']}: {found['n']} queries, {found['repository']} clips to find"
    rows = {"descriptor": found} | {name: row for name, row in found["methods"].items() if row is not None}
    curves = {
        f"{name}, area {row['pr_area']:.3f}": (row["curve"]["recall"], row["curve"]["precision"])
        for name, row in rows.items()
    }
    figure = precision_recall_figure(curves, "Precision and recall by method", note, mean=False)
    made = [picture("precision-recall", "Precision and recall by method", "Mean over the queries.", figure)]
    if len(measured.labels) >= LEAST_MAPPED:
        title = "Descriptors of the queries"
        said = f"{model}; t-SNE, perplexity {PERPLEXITY:.0f}; the axes have no meaning of their own"
        figure = descriptor_map(measured.descriptors, measured.labels, title, said)
        made.append(picture("descriptors-tsne", title, "Each point a clip; near points, near descriptors.", figure))
    if measured.loss:
        title = f"Training of {model}"
        figure = learning_curves_figure({model: [LearningCurve(measured.loss)]}, title, unit="epoch")
        made.append(picture("learning-curve", title, "Loss as a share of its first value.", figure))
    return made


def evaluation_pictures(found: Mapping[str, Any]) -> list[Picture]:
    """Precision and recall of all methods, of strided alignment by class, and the confusion of each method.

    Args:
        found: what `evaluate_pesta` returns.

    Returns:
        No pictures where no clips have labels that others share.
    """
    rows = {name: row for name, row in found.items() if row is not None and "curve" in row}
    if not rows:
        return []
    curves = {name: (row["curve"]["recall"], row["curve"]["precision"]) for name, row in rows.items()}
    strided = rows["sta"]["curve"]
    by_class = {label: (strided["recall"], precision) for label, precision in strided["by_class"].items()}
    made = [
        ("precision-recall", "Precision and recall by method", precision_recall_figure(curves, mean=False)),
        ("precision-recall-sta", "Strided alignment by class", precision_recall_figure(by_class, "Strided alignment")),
    ]
    for name, row in rows.items():
        confused, title = row["confusion"], f"First 20 hits: {name}"
        made.append((f"confusion-{name}", title, confusion_figure(confused["counts"], confused["classes"], title)))
    return [picture(name, title, "Each labelled clip queries all others.", figure) for name, title, figure in made]
