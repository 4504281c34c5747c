"""Pictures of what `evaluate_synthesis` found: errors over time, maps, strips, bars (figure 4.7 of the thesis)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from motionlake.arrays import FloatArray, Int64Array
from motionlake.evaluation.synthesis import SynthesisEvaluation
from motionlake.evaluation.synthesis_trials import Trial
from motionlake.glogen.generator import EmbeddedMotions
from motionlake.pictures.html import Picture, picture
from motionlake.pictures.maps import PERPLEXITY, tsne
from motionlake.pictures.stick_figures import draw_strip
from motionlake.pictures.style import FAINT, INK, TOP, Sheet, bare, class_styles, styled

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


MADE: Final = "#0072B2"
REAL: Final = "#9a9a9a"
STRIPS: Final = 5
MOMENTS: Final = 13
ROW: Final = 1.35
BAR: Final = 0.11


def synthesis_pictures(measured: SynthesisEvaluation) -> list[Picture]:
    """Errors over time, maps where there are enough motions, strips, bars."""
    found, trials = measured.found, measured.trials
    note = f"{found.get('protocol', 'test clips')}: {found['n']['test']} to go on from, {found['n']['classes']} classes"
    title = "Error after the seed"
    made = [picture("errors", title, "Mean per-joint error.", error_figure(found, title, note))]
    if len(measured.real) + len(measured.made) >= 4:
        title = "Made and real motion by descriptor"
        figure = beside_map(
            measured.real, measured.real_classes, measured.made, [trial.wanted for trial in trials], title,
            f"t-SNE of both together, perplexity {PERPLEXITY:.0f}; the axes have no meaning of their own",
        )  # fmt: skip
        made.append(picture("made-and-real", title, "Each point a motion; near points, near descriptors.", figure))
    embedded = measured.embedded
    if embedded is not None and len(embedded.labels) >= 4:
        title = "Test clips as the generator reads them"
        figure = generator_map(
            embedded, title,
            "t-SNE of the embeddings of four times five sparse poses (figure 4.7); each frame a plane of its own",
        )  # fmt: skip
        made.append(picture("generator", title, "Each point a real clip; near points are read alike.", figure))
    title = "Made motion below real motion of its class"
    shown = [trials[i] for i in chosen(trials, measured.own)]
    figure = strips_figure(shown, title, "each as long as the real clip goes on; the seeds are not shown")
    made.append(picture("strips", title, "Left limbs blue, right limbs orange.", figure))
    title = "Made motion beside real motion"
    made.append(picture("measures", title, "Means over the motions.", measures_figure(found, title, note)))
    if found["recognised"]:
        title = "Class recognised, seeds of other classes"
        shares = {name: row["recognised"] for name, row in found["by_class"].items() if row["recognised"]}
        figure = recognised_figure({n: (r["made"], r["real"]) for n, r in shares.items()}, title, note)
        made.append(picture("recognised", title, "By a descriptor that knows nothing of the generator.", figure))
    return made


def chosen(trials: Sequence[Trial], own: int) -> list[int]:
    """Up to `STRIPS` trials of different classes, spread over the classes; those with other seeds where there are."""
    first = own if len(trials) > own else 0
    by_class: dict[str, int] = {}
    for i in range(first, len(trials)):
        by_class.setdefault(trials[i].wanted, i)
    names = sorted(by_class)
    at = np.unique(np.linspace(0, len(names) - 1, min(STRIPS, len(names))).round().astype(int))
    return [by_class[names[i]] for i in at.tolist()]


@styled
def error_figure(found: Mapping[str, Any], title: str, note: str = "") -> Figure:
    """Mean per-joint error over milliseconds after the seed, of made motion and of the last pose held."""
    sheet = Sheet(7.4, TOP + 3.9, title, note)
    axes = sheet.axes(0.7, TOP + 0.05, 4.6, 3.3)
    axes.tick_params(labelsize=7.5, length=2)
    axes.grid(color="#ececec", linewidth=0.6)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for place, (name, rows, colour, marker) in enumerate(
        (("made", found, MADE, "o"), ("last pose held", found["zero_velocity"], REAL, "s"))
    ):
        pairs = [(int(t), v) for t, v in rows["errors_ms"].items() if v is not None]
        axes.plot(
            [t for t, _ in pairs], [v for _, v in pairs], color=colour, marker=marker, markersize=4, linewidth=1.6
        )
        y = TOP + 0.2 + place * 0.22
        sheet.canvas.plot([5.5, 5.85], [y, y], color=colour, marker=marker, markersize=4, linewidth=1.6)
        sheet.text(5.93, y, name, size=8, va="center_baseline", room=1.4)
    axes.set_xticks([int(t) for t in found["errors_ms"]])
    axes.set_xlim(0, None)
    axes.set_ylim(0, None)
    axes.set_xlabel("ms after the seed", fontsize=8)
    axes.set_ylabel("mean per-joint error, mm", fontsize=8)
    return sheet.figure


@styled
def strips_figure(trials: Sequence[Trial], title: str, note: str = "") -> Figure:
    """Moments of made motions, at even times, each below a real one of its class.

    Raises:
        ValueError: no motions.
    """
    if not trials:
        raise ValueError("no motions to draw")
    block = 2 * ROW + 0.4
    sheet = Sheet(9.2, TOP + block * len(trials) + 0.1, title, note)
    for i, trial in enumerate(trials):
        top = TOP + i * block
        own = trial.seed is trial.real
        start = "its own seed" if own else f"a seed of {trial.seed.motion.label}"
        said = f"{trial.wanted}, {len(trial.made.positions) / trial.made.fps:.1f} s, from {start}"
        sheet.text(0.12, top + 0.14, said, size=9, weight="bold", room=sheet.width - 0.3)
        rows = (("real", trial.real.after), ("made", trial.made.positions))
        for j, (name, positions) in enumerate(rows):
            place = top + 0.25 + j * ROW
            sheet.text(0.12, place + 0.75, name, size=8, color=FAINT)
            moments = np.linspace(0, len(positions) - 1, MOMENTS).round().astype(int)
            draw_strip(sheet, 0.6, place, sheet.width - 0.75, ROW - 0.08, np.asarray(positions)[moments])
    return sheet.figure


@styled
def measures_figure(found: Mapping[str, Any], title: str, note: str = "") -> Figure:
    """Made beside real: foot sliding, energy, travel speed, class recognised, nearest training clip."""
    panels: list[tuple[str, str, float, float, str]] = [
        (name, unit, found[key]["made"], found[key]["real"], "real")
        for key, name, unit in (
            ("foot_sliding", "foot sliding", "m/s"), ("energy", "energy", "m²/s²"),
            ("travel_speed", "travel speed", "m/s"),
        )
    ]  # fmt: skip
    if found["recognised"]:
        panels.append(("class recognised", "share", found["recognised"]["made"], found["recognised"]["real"], "real"))
    if found["nearest_real"]:
        near = found["nearest_real"]
        unit = "body lengths, median"
        panels.append(("nearest training clip", unit, near["made"]["median"], near["test"]["median"], "real"))
    if found["fid"] is not None:
        panels.append(
            ("FID", "real: training clips against test clips", found["fid"], found["fid_real"] or 0.0, "real")
        )
    columns, wide, tall = 3, 2.45, 1.15
    sheet = Sheet(columns * wide + 0.3, TOP + tall * -(-len(panels) // columns) + 0.1, title, note)
    for i, (name, unit, made, real, other) in enumerate(panels):
        left, top = 0.15 + i % columns * wide, TOP + i // columns * tall
        sheet.text(left, top + 0.14, name, size=9, weight="bold", room=wide - 0.2)
        sheet.text(left, top + 0.31, unit, size=7.5, color=FAINT, room=wide - 0.2)
        _bars(sheet, left + 0.42, top + 0.42, wide - 1.2, [("made", made, MADE), (other, real, REAL)])
    return sheet.figure


def _bars(sheet: Sheet, left: float, top: float, width: float, rows: Sequence[tuple[str, float, str]]) -> None:
    most = max(1e-12, *(value for _, value, _ in rows))
    for j, (name, value, colour) in enumerate(rows):
        y = top + j * 0.26
        sheet.box(left, y, max(width * value / most, 0.01), 0.19, colour)
        sheet.text(left - 0.06, y + 0.1, name, size=7.5, color=INK, ha="right", va="center_baseline")
        sheet.text(left + width * value / most + 0.06, y + 0.1, f"{value:.3g}", size=7.5, va="center_baseline")


@styled
def recognised_figure(shares: Mapping[str, tuple[float, float]], title: str, note: str = "") -> Figure:
    """By class, the share of made motions (above) and of real ones (below) that are recognised."""
    tall = 2 * BAR + 0.12
    name_room, wide = 2.2, 3.6
    sheet = Sheet(0.2 + name_room + wide + 0.7, TOP + 0.25 + tall * len(shares) + 0.15, title, note)
    left = 0.15 + name_room
    for x, (name, colour) in zip((left, left + 1.0), (("made", MADE), ("real", REAL)), strict=True):
        sheet.box(x, TOP + 0.02, 0.14, 0.12, colour)
        sheet.text(x + 0.2, TOP + 0.08, name, size=8, va="center_baseline")
    for i, (name, pair) in enumerate(sorted(shares.items())):
        top = TOP + 0.27 + i * tall
        sheet.text(left - 0.08, top + BAR, name, size=8, ha="right", va="center_baseline", room=name_room - 0.1)
        for j, (value, colour) in enumerate(zip(pair, (MADE, REAL), strict=True)):
            sheet.box(left, top + j * BAR, max(wide * value, 0.01), BAR - 0.01, colour)
        sheet.text(
            left + wide * max(pair) + 0.06, top + BAR, f"{100 * pair[0]:.0f} / {100 * pair[1]:.0f} %", size=7,
            color=FAINT, va="center_baseline",
        )  # fmt: skip
    return sheet.figure
