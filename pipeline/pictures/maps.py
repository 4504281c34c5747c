"""Maps of clips by their distances (Deep Motifs, figures 7 and 8), and of a posture dictionary (PESTA, figure 2b)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from motionlake.arrays import BoolArray, Float64Array, FloatArray, Int64Array, IntArray
from motionlake.deep_motifs.classification import mds
from motionlake.pictures.stick_figures import draw_bodies, postures_view
from motionlake.pictures.style import TOP, UNLABELLED, ClassStyle, Sheet, bare, class_styles, styled
from motionlake.pictures.symbol_strip import chip
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
    points = mds(distances, 2)
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


POSTURES_WIDE: Final = 7.4
HEADS: Final = 5.6
SAMPLE: Final = 5.4
LEFT: Final = 0.12
POSTURES_PERPLEXITY: Final = 30.0
LEAST: Final = 5  # points that a map is made of
FIGURES: Final = 26
APART: Final = 0.78  # inches from figure to figure
SCALE: Final = 0.5


def plane(points: FloatArray, seed: int = 0) -> Float64Array:
    """[n, 2] t-SNE of points [n, d], begun from their principal components; the same for the same seed.

    Raises:
        ValueError: fewer than 5 points.
    """
    if len(points) < LEAST:
        raise ValueError(f"a map needs at least {LEAST} points, not {len(points)}")
    from sklearn.manifold import TSNE

    perplexity = min(POSTURES_PERPLEXITY, (len(points) - 1) / 3)
    init = "pca" if points.shape[1] > 1 else "random"
    with threadpool_limits(limits=1):  # sums of threads differ from run to run
        found = TSNE(2, perplexity=perplexity, init=init, random_state=seed, n_jobs=1).fit_transform(
            points.astype(np.float64)
        )
    return np.asarray(found, dtype=np.float64)


@styled
def posture_map(
    heads: Float64Array,
    share: FloatArray,
    bodies: Float64Array,
    sample: Float64Array,
    symbols: IntArray,
    colours: Float64Array,
    title: str,
    note: str = "",
) -> Figure:
    """The heads above, some with their postures; a sample of postures below, in the colours of their symbols.

    Args:
        heads: [m, 2] on the page (`plane`).
        share: [m] of frames; a head's disc grows with it.
        bodies: [m, 21, 3] a posture for each symbol, not finite where there is none.
        sample: [n, 2] on the page.
        symbols: [n] of the sample.
        colours: [m, 3] of symbols.
        title: one line.
        note: one line below it.
    """
    sheet = Sheet(POSTURES_WIDE + 2 * LEFT, TOP + HEADS + SAMPLE + 0.75, title, note)
    sheet.text(LEFT, TOP + 0.08, f"heads ({len(heads)}): a disc grows with its symbol's share of frames", size=8.5)
    _heads(sheet, heads, share, bodies, colours, TOP + 0.2)
    below = TOP + HEADS + 0.42
    sheet.text(LEFT, below + 0.08, f"coded postures ({len(sample)}), each in the colour of its symbol", size=8.5)
    axes = _axes(sheet, sample, below + 0.2, SAMPLE)
    axes.scatter(sample[:, 0], sample[:, 1], 9, color=colours[symbols], linewidths=0)
    return sheet.figure


def _axes(sheet: Sheet, points: Float64Array, top: float, height: float) -> Axes:
    """Axes whose one unit is as long across as upwards."""
    axes = bare(sheet.axes(LEFT, top, POSTURES_WIDE, height), "left", "right", "top", "bottom")
    (left, low), (right, high) = points.min(axis=0), points.max(axis=0)
    unit = max((right - left) / (POSTURES_WIDE - 0.9), (high - low) / (height - 1.0), 1e-9)
    axes.set_xlim((left + right - POSTURES_WIDE * unit) / 2, (left + right + POSTURES_WIDE * unit) / 2)
    axes.set_ylim((low + high - height * unit) / 2, (low + high + height * unit) / 2)
    return axes


def _heads(
    sheet: Sheet, heads: Float64Array, share: FloatArray, bodies: Float64Array, colours: Float64Array,
    top: float,
) -> None:  # fmt: skip
    axes = _axes(sheet, heads, top, HEADS)
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    page = np.stack(
        [
            LEFT + (heads[:, 0] - left) / (right - left) * POSTURES_WIDE,
            top + (high - heads[:, 1]) / (high - low) * HEADS,
        ],
        axis=1,
    )
    sizes = 8 + 150 * share / max(float(np.max(share)), 1e-12)
    axes.scatter(heads[:, 0], heads[:, 1], sizes, color=colours, linewidths=0.4, edgecolors="white", alpha=0.85)
    axes.set_zorder(-1)
    possible: BoolArray = np.asarray(np.isfinite(bodies).all(axis=(1, 2)))
    chosen = spread_out(page, share, possible)
    view = postures_view(bodies[chosen])
    tall = view[..., 1].max(axis=1) * SCALE if len(chosen) else np.zeros(0)
    draw_bodies(sheet, view, np.stack([page[chosen, 0], page[chosen, 1] + tall / 2], axis=1), SCALE, 1.3)
    for i, symbol in enumerate(chosen.tolist()):
        chip(sheet, float(page[symbol, 0]), float(page[symbol, 1] + tall[i] / 2) + 0.11, symbol, colours[symbol], 6)


def spread_out(page: Float64Array, share: FloatArray, possible: BoolArray) -> Int64Array:
    """Symbols whose figures have room: the most frequent first, each a figure's width or more from those before."""
    chosen: list[int] = []
    for symbol in np.lexsort((np.arange(len(page)), -np.asarray(share))).tolist():
        apart = np.abs(page[chosen] - page[symbol]) if chosen else np.full((1, 2), np.inf)
        if possible[symbol] and not (apart < (APART * 0.75, APART * 1.05)).all(axis=1).any() and len(chosen) < FIGURES:
            chosen.append(symbol)
    return np.array(sorted(chosen), dtype=np.int64)
