"""Pictures of what `evaluate_synthesis` found: errors over time, maps, strips, bars (figure 4.7 of the thesis)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from motionlake.deep_motifs.clip_map import LEAST, PERPLEXITY
from motionlake.evaluation.synthesis import SynthesisEvaluation
from motionlake.evaluation.synthesis.trials import Trial
from motionlake.pictures.html import Picture, picture
from motionlake.pictures.maps import beside_map, generator_map
from motionlake.pictures.stick_figures import draw_strip, spread
from motionlake.pictures.style import FAINT, TOP, Line, Sheet, styled

MADE: Final = "#0072B2"
REAL: Final = "#9a9a9a"
STRIPS: Final = 5
MOMENTS: Final = 13
ROW: Final = 1.35
BAR: Final = 0.11


def synthesis_pictures(measured: SynthesisEvaluation) -> list[Picture]:
    """Errors over time, maps where there are enough motions, strips, bars."""
    found, trials, embedded = measured.found, measured.trials, measured.embedded
    note = f"{found.get('protocol', 'test clips')}: {found['n']['test']} to go on from, {found['n']['classes']} classes"
    title = "Error after the seed"
    made = [picture("errors", title, "Mean per-joint error.", _error_figure(found, title, note))]
    if len(measured.real) + len(measured.made) >= LEAST:
        title = "Made and real motion by descriptor"
        figure = beside_map(
            measured.real, measured.real_classes, measured.made, [trial.wanted for trial in trials], title,
            f"t-SNE of both together, perplexity {PERPLEXITY:.0f}; the axes have no meaning of their own",
        )  # fmt: skip
        made.append(picture("made-and-real", title, "Each point a motion; near points, near descriptors.", figure))
    if embedded is not None and len(embedded.labels) >= LEAST:
        title = "Test clips as the generator reads them"
        figure = generator_map(
            embedded, title,
            "t-SNE of the embeddings of four times five sparse poses (figure 4.7); each frame a plane of its own",
        )  # fmt: skip
        made.append(picture("generator", title, "Each point a real clip; near points are read alike.", figure))
    title = "Made motion below real motion of its class"
    figure = _strips_figure(_chosen(trials, measured.own), title)
    made.append(picture("strips", title, "Left limbs blue, right limbs orange.", figure))
    title = "Made motion beside real motion"
    made.append(picture("measures", title, "Means over the motions.", _measures_figure(found, title, note)))
    if found["recognised"]:
        title = "Class recognised, seeds of other classes"
        shares = {name: row["recognised"] for name, row in found["by_class"].items() if row["recognised"]}
        figure = recognised_figure({n: (r["made"], r["real"]) for n, r in shares.items()}, title, note)
        made.append(picture("recognised", title, "By a descriptor that knows nothing of the generator.", figure))
    return made


def _chosen(trials: Sequence[Trial], own: int) -> list[Trial]:
    """Up to `STRIPS` trials of different classes, spread over the classes; those with other seeds where there are."""
    by_class = {trial.wanted: trial for trial in reversed(trials[own:] or trials)}
    names = sorted(by_class)
    at = np.unique(np.linspace(0, len(names) - 1, min(STRIPS, len(names))).round().astype(int))
    return [by_class[names[i]] for i in at.tolist()]


@styled
def _error_figure(found: Mapping[str, Any], title: str, note: str) -> Figure:
    """Mean per-joint error over milliseconds after the seed, of made motion and of the last pose held."""
    sheet = Sheet(7.4, TOP + 3.9, title, note)
    axes = sheet.plot(0.7, TOP + 0.05, 4.6, 3.3, "ms after the seed", "mean per-joint error, mm")
    lines: list[Line] = [
        (name, {"color": colour, "marker": marker, "markersize": 4, "linewidth": 1.6})
        for name, colour, marker in (("made", MADE, "o"), ("last pose held", REAL, "s"))
    ]
    for (_, look), rows in zip(lines, (found, found["zero_velocity"]), strict=True):
        known = {int(t): error for t, error in rows["errors_ms"].items() if error is not None}
        axes.plot([*known], [*known.values()], **look)
    axes.set_xticks([int(t) for t in found["errors_ms"]])
    axes.set_xlim(0, None)
    axes.set_ylim(0, None)
    sheet.line_legend(5.5, lines)
    return sheet.figure


@styled
def _strips_figure(trials: Sequence[Trial], title: str) -> Figure:
    """Moments of made motions, at even times, each below a real one of its class."""
    block = 2 * ROW + 0.4
    note = "each as long as the real clip goes on; the seeds are not shown"
    sheet = Sheet(9.2, TOP + block * len(trials) + 0.1, title, note)
    for i, trial in enumerate(trials):
        top = TOP + i * block
        start = "its own seed" if trial.seed is trial.real else f"a seed of {trial.seed.motion.label}"
        said = f"{trial.wanted}, {len(trial.made.positions) / trial.made.fps:.1f} s, from {start}"
        sheet.text(0.12, top + 0.14, said, size=9, weight="bold", room=sheet.width - 0.3)
        for j, (name, positions) in enumerate((("real", trial.real.after), ("made", trial.made.positions))):
            place = top + 0.25 + j * ROW
            sheet.text(0.12, place + 0.75, name, size=8, color=FAINT)
            draw_strip(sheet, 0.6, place, sheet.width - 0.75, ROW - 0.08, spread(np.asarray(positions), MOMENTS))
    return sheet.figure


@styled
def _measures_figure(found: Mapping[str, Any], title: str, note: str) -> Figure:
    """Made beside real, where both are known."""
    panels = [
        (name, unit, found[key]["made"], found[key]["real"])
        for key, name, unit in (
            ("skate_ratio", "skate ratio", "share of frames"), ("energy", "energy", "m²/s²"),
            ("travel_speed", "travel speed", "m/s"), ("diversity", "diversity", "distance of descriptors"),
            ("pose_spread", "pose spread", "body lengths"), ("recognised", "class recognised", "share"),
        )
        if found[key] and None not in (found[key]["made"], found[key]["real"])
    ]  # fmt: skip
    if found["nearest_real"]:
        near = found["nearest_real"]
        unit = "body lengths, median"
        panels.append(("nearest training clip", unit, near["made"]["median"], near["test"]["median"]))
    made, known = found["likeness"]["made"], found["likeness"]["training"]
    for key, name in (("fid", "FID"), ("coverage", "coverage")) if made and known else ():
        panels.append((name, "real: training clips against test clips", made[key], known[key]))
    columns, wide, tall = 3, 2.45, 1.15
    sheet = Sheet(columns * wide + 0.3, TOP + tall * -(-len(panels) // columns) + 0.1, title, note)
    for i, (name, unit, *values) in enumerate(panels):
        left, top = 0.15 + i % columns * wide, TOP + i // columns * tall
        sheet.text(left, top + 0.14, name, size=9, weight="bold", room=wide - 0.2)
        sheet.text(left, top + 0.31, unit, size=7.5, color=FAINT, room=wide - 0.2)
        unit_width = (wide - 1.2) / max(1e-12, *values)
        for j, (what, value, colour) in enumerate(zip(("made", "real"), values, (MADE, REAL), strict=True)):
            x, y = left + 0.42, top + 0.42 + j * 0.26
            sheet.box(x, y, max(unit_width * value, 0.01), 0.19, colour)
            sheet.text(x - 0.06, y + 0.1, what, size=7.5, ha="right", va="center_baseline")
            sheet.text(x + unit_width * value + 0.06, y + 0.1, f"{value:.3g}", size=7.5, va="center_baseline")
    return sheet.figure


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
