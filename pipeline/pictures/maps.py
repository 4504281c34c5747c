"""Maps: clips by their distances (Deep Motifs, figures 7 and 8) or vectors (thesis, figure 4.7), a posture dictionary
(PESTA, figure 2b).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from motionlake.arrays import BoolArray, Float64Array, FloatArray, Int64Array, IntArray
from motionlake.deep_motifs.classification import mds
from motionlake.deep_motifs.clip_map import tsne
from motionlake.pictures.stick_figures import draw_bodies, postures_view
from motionlake.pictures.style import LINE, TOP, ClassStyle, Sheet, class_styles, styled
from motionlake.pictures.symbol_figures import chips

if TYPE_CHECKING:
    from motionlake.glogen.generator import EmbeddedMotions

LEFT: Final = 0.15
WIDE: Final = 6.7
TALL: Final = 5.5
SIDE: Final = 4.0  # column on the right: the smaller map, then the legend
SMALL: Final = 2.9
MAX_LINES: Final = 28
EDGES: Final = ("left", "right", "top", "bottom")
MAPPED: Final = 12  # classes of a map in frames
FRAME: Final = 4.1


def plane_of(distances: Float64Array) -> tuple[Float64Array, float]:
    """[n, 2] points of a plane whose distances come close to those given [n, n], n at least 3 (metric MDS).

    And Kruskal's stress: the error of the distances over the distances, root mean square.
    """
    if not distances.any():
        return np.zeros((len(distances), 2)), 0.0
    points = mds(distances, 2)
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    return points, float(np.sqrt(np.square(apart - distances).sum() / np.square(distances).sum()))


@styled
def clip_map(
    points: Float64Array, classes: Sequence[str], title: str, note: str = "",
    other: tuple[str, Float64Array] | None = None,
) -> Figure:  # fmt: skip
    """A map of clips, each a point [n, 2] in the colour and marker of its class [n].

    `other` is the name of a smaller map of the same clips by another distance, and its points [n, 2].
    """
    counts = Counter(classes)
    styles = class_styles(sorted(counts))
    columns = 1 if other is None and len(styles) <= MAX_LINES else 2
    lines = -(-len(styles) // columns)
    above = 0.0 if other is None else SMALL + 0.35
    right = LEFT + WIDE + 0.25
    sheet = Sheet(right + SIDE, TOP + max(TALL, above + lines * LINE) + 0.15, title, note)
    maps = [(sheet.bare(LEFT, TOP, WIDE, TALL, *EDGES), points, 1.0)]
    if other is not None:
        sheet.text(right, TOP + 0.1, other[0], room=SIDE - 0.15)
        maps.append((sheet.bare(right, TOP + 0.18, SIDE - 0.15, SMALL, *EDGES), other[1], 0.5))
    for axes, places, scale in maps:
        _scatter(axes, places, classes, styles, float(np.clip(5200 / max(len(points), 1), 26, 60)) * scale)
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.05)
    said = {f"{name} ({counts[name]})": style for name, style in styles.items()}
    _legend(sheet, said, right, TOP + above, SIDE, lines)
    return sheet.figure


def _scatter(
    axes: Axes, points: FloatArray, classes: Sequence[str], styles: Mapping[str, ClassStyle], size: float
) -> None:
    for name, style in styles.items():
        x, y = points[[c == name for c in classes]].T
        axes.scatter(
            x, y, size, color=style.colour, marker=style.marker, edgecolors="white", linewidths=0.5, alpha=0.9
        )  # fmt: skip


def _legend(sheet: Sheet, styles: Mapping[str, ClassStyle], left: float, top: float, width: float, lines: int) -> None:
    """Markers of classes with their names, in columns of so many lines."""
    column = width / -(-len(styles) // lines)
    for i, (name, style) in enumerate(styles.items()):
        x, y = left + column * (i // lines) + 0.1, top + 0.1 + LINE * (i % lines)
        _scatter(sheet.canvas, np.array([[x, y]]), [name], {name: style}, 34)
        sheet.text(x + 0.14, y, name, size=8, va="center_baseline", room=column - 0.38)


@styled
def beside_map(
    real: FloatArray, real_classes: Sequence[str], made: FloatArray, made_classes: Sequence[str],
    title: str, note: str = "",
) -> Figure:  # fmt: skip
    """Vectors of real [r, d] and of made motions [m, d] in one plane, drawn in two frames of the same scale.

    Raises:
        ValueError: fewer than four vectors of the classes shown.
    """
    classes = [*real_classes, *made_classes]
    shown, rows = _spread_classes(classes)
    points = _fitted(tsne(np.concatenate([real, made])[rows]))
    labels = [classes[i] for i in rows]
    first = int(np.searchsorted(rows, len(real)))
    frames = {"real": (points[:first], labels[:first]), "made": (points[first:], labels[first:])}
    return _frames(frames, shown, title, note)


@styled
def generator_map(embedded: EmbeddedMotions, title: str, note: str = "") -> Figure:
    """Real motions as a generator reads them: with their class prior, and by their poses alone.

    Raises:
        ValueError: fewer than four motions of the classes shown.
    """
    shown, rows = _spread_classes(embedded.labels)
    labels = [embedded.labels[i] for i in rows]
    vectors = {"with the class prior": embedded.with_class, "poses alone": embedded.alone}
    frames = {name: (_fitted(tsne(own[rows])), labels) for name, own in vectors.items()}
    return _frames(frames, shown, title, note)


def _spread_classes(classes: Sequence[str]) -> tuple[list[str], Int64Array]:
    """Up to `MAPPED` classes, spread over their names, and which of the motions are of them."""
    names = sorted(set(classes))
    at = np.unique(np.linspace(0, len(names) - 1, min(MAPPED, len(names))).round().astype(int))
    shown = [names[i] for i in at.tolist()]
    return shown, np.flatnonzero([name in shown for name in classes])


def _fitted(points: FloatArray) -> FloatArray:
    """Points [n, 2] moved and stretched into the unit square, with an edge."""
    low, high = points.min(axis=0), points.max(axis=0)
    fitted: FloatArray = 0.05 + 0.9 * (points - low) / np.maximum(high - low, 1e-9)
    return fitted


def _frames(
    frames: Mapping[str, tuple[FloatArray, Sequence[str]]], shown: Sequence[str], title: str, note: str
) -> Figure:
    """Points [n, 2] of the unit square and their classes [n], in frames beside one another, and one legend."""
    styles = class_styles(shown)
    right = LEFT + len(frames) * (FRAME + 0.2)
    sheet = Sheet(right + 2.5, TOP + 0.25 + max(FRAME, len(shown) * LINE) + 0.15, title, note)
    for place, (name, (points, classes)) in enumerate(frames.items()):
        left = LEFT + place * (FRAME + 0.2)
        sheet.text(left, TOP + 0.12, f"{name} ({len(points)})", size=9)
        axes = sheet.bare(left, TOP + 0.22, FRAME, FRAME, *EDGES)
        _scatter(axes, points, classes, styles, 30)
        axes.set(xlim=(0, 1), ylim=(0, 1))
    _legend(sheet, styles, right, TOP + 0.22, 2.5, len(shown))
    return sheet.figure


POSTURES_WIDE: Final = 7.4
HEADS: Final = 5.6
SAMPLE: Final = 5.4
FIGURES: Final = 26
APART: Final = 0.78  # inches from figure to figure
SCALE: Final = 0.5


@styled
def posture_map(
    heads: Float64Array, share: FloatArray, bodies: Float64Array, sample: Float64Array, symbols: IntArray,
    colours: Float64Array, title: str, note: str = "",
) -> Figure:  # fmt: skip
    """The heads above, some with their postures; a sample of postures below, in the colours of their symbols.

    Args:
        heads: [m, 2] on the page (`tsne`).
        share: [m] of frames; a head's disc grows with it.
        bodies: [m, 21, 3] a posture for each symbol, not finite where there is none.
        sample: [n, 2] on the page.
        symbols: [n] of the sample.
        colours: [m, 3] of symbols.
    """
    sheet = Sheet(POSTURES_WIDE + 2 * LEFT, TOP + HEADS + SAMPLE + 0.75, title, note)
    sheet.text(LEFT, TOP + 0.08, f"heads ({len(heads)}): a disc grows with its symbol's share of frames", size=8.5)
    axes = _square(sheet, heads, TOP + 0.2, HEADS)
    sizes = 8 + 150 * share / max(float(np.max(share)), 1e-12)
    axes.scatter(heads[:, 0], heads[:, 1], sizes, color=colours, linewidths=0.4, edgecolors="white", alpha=0.85)
    axes.set_zorder(-1)
    _some_bodies(sheet, axes, heads, share, bodies, colours)
    below = TOP + HEADS + 0.42
    sheet.text(LEFT, below + 0.08, f"coded postures ({len(sample)}), each in the colour of its symbol", size=8.5)
    axes = _square(sheet, sample, below + 0.2, SAMPLE)
    axes.scatter(sample[:, 0], sample[:, 1], 9, color=colours[symbols], linewidths=0)
    return sheet.figure


def _square(sheet: Sheet, points: Float64Array, top: float, height: float) -> Axes:
    """Axes whose one unit is as long across as upwards."""
    axes = sheet.bare(LEFT, top, POSTURES_WIDE, height, *EDGES)
    low, high = points.min(axis=0), points.max(axis=0)
    unit = max(*((high - low) / (POSTURES_WIDE - 0.9, height - 1.0)), 1e-9)
    middle, half = (low + high) / 2, np.array([POSTURES_WIDE, height]) * unit / 2
    (left, bottom), (right, above) = middle - half, middle + half
    axes.set(xlim=(left, right), ylim=(bottom, above))
    return axes


def _some_bodies(
    sheet: Sheet, axes: Axes, heads: Float64Array, share: FloatArray, bodies: Float64Array, colours: Float64Array
) -> None:
    """Bodies and numbers of the heads that have room."""
    page = sheet.canvas.transData.inverted().transform(axes.transData.transform(heads))
    chosen = _spread_out(page, share, np.asarray(np.isfinite(bodies).all(axis=(1, 2))))
    view = postures_view(bodies[chosen])
    x, ground = page[chosen, 0], page[chosen, 1] + view[..., 1].max(axis=1, initial=0) * SCALE / 2
    draw_bodies(sheet, view, x, ground, SCALE, 1.3)
    chips(sheet, x, ground + 0.11, chosen, colours, 6)


def _spread_out(page: Float64Array, share: FloatArray, possible: BoolArray) -> Int64Array:
    """Symbols whose figures have room: the most frequent first, each a figure's width or more from those before."""
    chosen: list[int] = []
    for symbol in np.argsort(-np.asarray(share), kind="stable").tolist():
        apart = np.abs(page[chosen] - page[symbol])
        if possible[symbol] and not (apart < (APART * 0.75, APART * 1.05)).all(axis=1).any() and len(chosen) < FIGURES:
            chosen.append(symbol)
    return np.array(sorted(chosen), dtype=np.int64)
