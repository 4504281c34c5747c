"""Pictures of what `evaluate_descriptor` found: precision-recall curves, map of descriptors, loss (DeepHuMS, 3.3)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from motionlake.evaluation.descriptor import DescriptorEvaluation
from motionlake.pictures.html import Picture, picture
from motionlake.pictures.learning_curves import LearningCurve, learning_curves_figure
from motionlake.pictures.maps import PERPLEXITY, descriptor_map
from motionlake.pictures.retrieval_figures import confusion_figure, precision_recall_figure

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
