"""Figures 6 and 7 of PESTA from what `evaluate_pesta` found: precision-recall curves and confusion matrices."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from motionlake.pictures.html import Picture, picture
from motionlake.pictures.retrieval_figures import confusion_figure, precision_recall_figure


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
