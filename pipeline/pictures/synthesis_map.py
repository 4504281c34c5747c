"""Maps of real motion beside made motion, and of how a generator reads real motion (figure 4.7 of the thesis)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.figure import Figure
from motionlake.arrays import FloatArray, Int64Array
from motionlake.glogen.generator import EmbeddedMotions
from motionlake.pictures.maps import tsne
from motionlake.pictures.style import TOP, Sheet, bare, class_styles, styled

MAPPED: Final = 12  # classes that a map shows
SIDE: Final = 4.1
LINE: Final = 0.19
LEGEND: Final = 2.3
# What a frame is called, its points in a plane [n, 2], and their classes.
Frame = tuple[str, FloatArray, Sequence[str]]


@styled
def beside_map(
    real: FloatArray, real_classes: Sequence[str], made: FloatArray, made_classes: Sequence[str],
    title: str, note: str = "",
) -> Figure:  # fmt: skip
    """Vectors of real and of made motions in one plane, drawn in two frames of the same scale.

    Args:
        real: [r, d].
        real_classes: [r].
        made: [m, d].
        made_classes: [m] wanted classes.
        title: one line.
        note: one line below it.

    Raises:
        ValueError: fewer than four vectors of the classes shown.
    """
    shown = _shown([*real_classes, *made_classes])
    of_real, of_made = (_of(classes, shown) for classes in (real_classes, made_classes))
    points = _fitted(tsne(np.concatenate([real[of_real], made[of_made]])))
    return _map(
        [
            ("real", points[: len(of_real)], [real_classes[i] for i in of_real]),
            ("made", points[len(of_real) :], [made_classes[i] for i in of_made]),
        ],
        shown, title, note,
    )  # fmt: skip


@styled
def generator_map(embedded: EmbeddedMotions, title: str, note: str = "") -> Figure:
    """Real motions as a generator reads them: with their class prior, and by their poses alone.

    Args:
        embedded: the motions.
        title: one line.
        note: one line below it.

    Raises:
        ValueError: fewer than four motions of the classes shown.
    """
    shown = _shown(embedded.labels)
    rows = _of(embedded.labels, shown)
    labels = [embedded.labels[i] for i in rows]
    return _map(
        [
            (name, _fitted(tsne(vectors[rows])), labels)
            for name, vectors in (("with the class prior", embedded.with_class), ("poses alone", embedded.alone))
        ],
        shown, title, note,
    )  # fmt: skip


def _shown(classes: Sequence[str]) -> list[str]:
    """Up to `MAPPED` classes, spread over their names."""
    names = sorted(set(classes))
    at = np.unique(np.linspace(0, len(names) - 1, min(MAPPED, len(names))).round().astype(int))
    return [names[i] for i in at.tolist()]


def _of(classes: Sequence[str], shown: Sequence[str]) -> Int64Array:
    return np.array([i for i, name in enumerate(classes) if name in shown], dtype=np.int64)


def _fitted(points: FloatArray) -> FloatArray:
    """Points [n, 2] moved and stretched into the unit square, with an edge."""
    low, high = points.min(axis=0), points.max(axis=0)
    fitted: FloatArray = 0.05 + 0.9 * (points - low) / np.maximum(high - low, 1e-9)
    return fitted


def _map(frames: Sequence[Frame], shown: Sequence[str], title: str, note: str) -> Figure:
    """Frames beside one another, and a legend that tells their classes."""
    styles = class_styles(list(shown))
    wide = len(frames) * (SIDE + 0.2)
    sheet = Sheet(0.15 + wide + 0.2 + LEGEND, TOP + 0.25 + max(SIDE, len(shown) * LINE) + 0.15, title, note)
    for place, (name, points, classes) in enumerate(frames):
        left = 0.15 + place * (SIDE + 0.2)
        sheet.text(left, TOP + 0.12, f"{name} ({len(points)})", size=9)
        axes = bare(sheet.axes(left, TOP + 0.22, SIDE, SIDE), "left", "right", "top", "bottom")
        for label, style in styles.items():
            own = points[[c == label for c in classes]]
            axes.scatter(
                own[:, 0], own[:, 1], 30, color=style.colour, marker=style.marker, edgecolors="white", linewidths=0.5
            )  # fmt: skip
        axes.set_xlim(0, 1)
        axes.set_ylim(0, 1)
    left = 0.15 + wide
    for i, (name, style) in enumerate(styles.items()):
        y = TOP + 0.32 + LINE * i
        sheet.canvas.scatter(
            [left + 0.1], [y], 34, color=style.colour, marker=style.marker, edgecolors="white", linewidths=0.5
        )  # fmt: skip
        sheet.text(left + 0.24, y, name, size=8, va="center_baseline", room=LEGEND - 0.35)
    return sheet.figure
