"""Maps of clips by the distance of their signatures (Deep Motifs, figures 7 and 8)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from motionlake.arrays import Float64Array, FloatArray
from motionlake.deep_motifs.classification import places_of
from motionlake.pictures.style import TOP, UNLABELLED, ClassStyle, Sheet, bare, class_styles, styled
from threadpoolctl import threadpool_limits

WIDE: Final = 6.7
TALL: Final = 5.5
SIDE: Final = 4.0  # column on the right: the smaller map, then the legend
SMALL: Final = 2.9
LINE: Final = 0.19
MAX_LINES: Final = 28


def plane_of(distances: Float64Array) -> tuple[Float64Array, float]:
    """A plane of points whose distances come close to those given (metric MDS).

    Args:
        distances: [n, n] symmetric, n at least 3.

    Returns:
        [n, 2] points, and Kruskal's stress: the error of the distances over the distances, root mean square.
    """
    if not distances.any():
        return np.zeros((len(distances), 2)), 0.0
    points = places_of(distances, 2)
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    return points, float(np.sqrt(np.square(apart - distances).sum() / np.square(distances).sum()))


@styled
def clip_map(
    points: Float64Array,
    classes: Sequence[str],
    title: str,
    note: str = "",
    other: tuple[str, Float64Array] | None = None,
) -> Figure:
    """A map of clips, each a point in its class's colour and marker.

    Args:
        points: [n, 2].
        classes: [n] class of each clip; the legend lists them in the order of their names.
        title: one line.
        note: one line below it.
        other: name and [n, 2] points of a smaller map of the same clips by another distance.
    """
    counts = Counter(classes)
    names = sorted(counts, key=lambda name: (name == UNLABELLED, name))
    styles = class_styles(names)
    columns = 1 if other is None and len(names) <= MAX_LINES else 2
    lines = -(-len(names) // columns)
    above = 0.0 if other is None else SMALL + 0.35
    right = 0.15 + WIDE + 0.25
    sheet = Sheet(right + SIDE, TOP + max(TALL, above + lines * LINE) + 0.15, title, note)
    _scatter(sheet.axes(0.15, TOP, WIDE, TALL), points, classes, styles, 1.0)
    if other is not None:
        sheet.text(right, TOP + 0.1, other[0], room=SIDE - 0.15)
        _scatter(sheet.axes(right, TOP + 0.18, SIDE - 0.15, SMALL), other[1], classes, styles, 0.5)
    for i, name in enumerate(names):
        x, y = right + SIDE / columns * (i // lines) + 0.1, TOP + above + 0.1 + LINE * (i % lines)
        _mark(sheet.canvas, np.array([[x, y]]), styles[name], 34)
        text = f" ({counts[name]})"
        sheet.text(x + 0.14, y, name + text, size=8, va="center_baseline", room=SIDE / columns - 0.38)
    return sheet.figure


def _scatter(
    axes: Axes, points: Float64Array, classes: Sequence[str], styles: dict[str, ClassStyle], scale: float
) -> None:
    size = float(np.clip(5200 / max(len(points), 1), 26, 60)) * scale
    bare(axes, "left", "right", "top", "bottom")
    for name, style in styles.items():
        _mark(axes, points[[c == name for c in classes]], style, size)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.05)


def _mark(axes: Axes, points: Float64Array, style: ClassStyle, size: float) -> None:
    axes.scatter(
        points[:, 0], points[:, 1], size, color=style.colour, marker=style.marker, edgecolors="white",
        linewidths=0.5, alpha=0.9,
    )  # fmt: skip


PERPLEXITY: Final = 20.0
SEED: Final = 0


def tsne(descriptors: FloatArray) -> Float64Array:
    """[n, 2] places of n descriptors [n, d], the same for the same descriptors.

    Raises:
        ValueError: fewer than four.
    """
    from sklearn.manifold import TSNE

    if len(descriptors) < 4:
        raise ValueError(f"{len(descriptors)} descriptors are too few for a map")
    perplexity = min(PERPLEXITY, (len(descriptors) - 1) / 3)
    with threadpool_limits(limits=1):  # else sums differ from run to run
        found = TSNE(perplexity=perplexity, init="pca", random_state=SEED).fit_transform(
            np.asarray(descriptors, dtype=np.float32)
        )
    return np.asarray(found, dtype=np.float64)


def descriptor_map(descriptors: FloatArray, classes: Sequence[str], title: str, note: str = "") -> Figure:
    """Each clip a point in the colour and marker of its class; near points have near descriptors.

    Args:
        descriptors: [n, d], n at least 4.
        classes: [n].
        title: one line.
        note: one line below it.
    """
    return clip_map(tsne(descriptors), classes, title, note)
