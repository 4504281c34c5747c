"""Maps of a posture dictionary (PESTA, figure 2b): its heads, and below them a sample of coded postures."""

from __future__ import annotations

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from motionlake.arrays import BoolArray, Float64Array, FloatArray, Int64Array, IntArray
from motionlake.pictures.stick_figures import draw_bodies, postures_view
from motionlake.pictures.style import TOP, Sheet, bare, styled
from motionlake.pictures.symbol_strip import chip
from threadpoolctl import threadpool_limits

WIDE: Final = 7.4
HEADS: Final = 5.6
SAMPLE: Final = 5.4
LEFT: Final = 0.12
PERPLEXITY: Final = 30.0
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

    perplexity = min(PERPLEXITY, (len(points) - 1) / 3)
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
    sheet = Sheet(WIDE + 2 * LEFT, TOP + HEADS + SAMPLE + 0.75, title, note)
    sheet.text(LEFT, TOP + 0.08, f"heads ({len(heads)}): a disc grows with its symbol's share of frames", size=8.5)
    _heads(sheet, heads, share, bodies, colours, TOP + 0.2)
    below = TOP + HEADS + 0.42
    sheet.text(LEFT, below + 0.08, f"coded postures ({len(sample)}), each in the colour of its symbol", size=8.5)
    axes = _axes(sheet, sample, below + 0.2, SAMPLE)
    axes.scatter(sample[:, 0], sample[:, 1], 9, color=colours[symbols], linewidths=0)
    return sheet.figure


def _axes(sheet: Sheet, points: Float64Array, top: float, height: float) -> Axes:
    """Axes whose one unit is as long across as upwards."""
    axes = bare(sheet.axes(LEFT, top, WIDE, height), "left", "right", "top", "bottom")
    (left, low), (right, high) = points.min(axis=0), points.max(axis=0)
    unit = max((right - left) / (WIDE - 0.9), (high - low) / (height - 1.0), 1e-9)
    axes.set_xlim((left + right - WIDE * unit) / 2, (left + right + WIDE * unit) / 2)
    axes.set_ylim((low + high - height * unit) / 2, (low + high + height * unit) / 2)
    return axes


def _heads(
    sheet: Sheet, heads: Float64Array, share: FloatArray, bodies: Float64Array, colours: Float64Array,
    top: float,
) -> None:  # fmt: skip
    axes = _axes(sheet, heads, top, HEADS)
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    page = np.stack(
        [LEFT + (heads[:, 0] - left) / (right - left) * WIDE, top + (high - heads[:, 1]) / (high - low) * HEADS], axis=1
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
