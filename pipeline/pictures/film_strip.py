"""A motion on paper: moments of it as stick figures over time, its labels, and its path on the ground from above."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.figure import Figure
from motionlake.arrays import Float64Array, FloatArray
from motionlake.motion.rotations import turn_on_ground
from motionlake.motion.skeleton import INDEX
from motionlake.pictures.bands import Segment, lanes_of, second_ticks
from motionlake.pictures.player_material import PlayerClip
from motionlake.pictures.stick_figures import draw_bodies, draw_strip, three_quarter_view
from motionlake.pictures.style import (
    FAINT,
    INK,
    TOP,
    ClassStyle,
    Sheet,
    bare,
    class_styles,
    fitted,
    ink_on,
    percent,
    styled,
    width_of,
)

MOMENTS: Final = 12
MOST_LANES: Final = 6
LEFT: Final = 0.25
WIDE: Final = 10.5
FIGURES: Final = 1.25  # inches that a row of stick figures is high
BAND: Final = 0.2
PATH: Final = 1.5  # inches of the square of a path
GAP: Final = 0.35
_LENGTHS: Final = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)


@styled
def film_strip(clips: Sequence[PlayerClip]) -> Figure:
    """A row a clip: figures at evenly spaced moments above the time they stand for, left limbs blue, right orange.

    On the right the path of the hips, from above, turned so that the body faces up at first; dots are the moments.

    Raises:
        ValueError: no clips, or one without frames.
    """
    if not clips or not all(len(clip.positions) for clip in clips):
        raise ValueError("a film strip needs clips with frames")
    rows = [_height(clip) for clip in clips]
    styles = class_styles(sorted({span.label for clip in clips for _, spans in clip.bands for span in spans}))
    title = " beside ".join(clip.name.rpartition("/")[2] for clip in clips)
    sheet = Sheet(LEFT + WIDE + GAP + PATH + 0.2, TOP + sum(rows), title)
    top = TOP - 0.2
    for clip, height in zip(clips, rows, strict=True):
        _row(sheet, top, clip, styles)
        top += height
    return sheet.figure


def _height(clip: PlayerClip) -> float:
    lanes = sum(_lanes(spans) for _, spans in clip.bands)
    return max(0.45 + FIGURES + BAND * lanes + 0.5, PATH + 0.8)


def _lanes(spans: Sequence[Segment]) -> int:
    return min(MOST_LANES, max(lanes_of(spans), default=-1) + 1)


def _row(sheet: Sheet, top: float, clip: PlayerClip, styles: dict[str, ClassStyle]) -> None:
    said = ", ".join(f"{name} {value}" for name, value in clip.facts)
    sheet.text(LEFT, top + 0.14, clip.name, size=9, weight="bold", room=sheet.width - LEFT - 0.2)
    sheet.text(LEFT, top + 0.31, said, size=8, color=FAINT, room=sheet.width - LEFT - 0.2)
    top += 0.4
    moments = ((np.arange(MOMENTS) + 0.5) * len(clip.positions) / MOMENTS).astype(int)
    view = three_quarter_view(clip.positions[moments]) / clip.height
    scale = min(0.85, 0.95 * FIGURES / max(1.3, float(view[..., 1].max()) + 0.12))
    ground = top + FIGURES
    places = LEFT + (np.arange(MOMENTS) + 0.5) * WIDE / MOMENTS
    sheet.canvas.plot([LEFT, LEFT + WIDE], [ground] * 2, color="#c8c8c8", linewidth=0.8, zorder=1)
    draw_bodies(sheet, view, np.stack([places, np.full(MOMENTS, ground)], axis=-1), scale)
    below = ground + 0.08
    for _, spans in clip.bands:
        below = _band(sheet, below, clip, spans, styles)
    axis = bare(sheet.axes(LEFT, below, WIDE, 0.001), "bottom")
    axis.set_xlim(0, clip.duration)
    axis.xaxis.set_major_locator(second_ticks())
    axis.tick_params(labelsize=7.5, length=2, pad=1.5)
    sheet.text(LEFT + WIDE, below + 0.3, "seconds", size=7.5, color=FAINT, ha="right")
    _path(sheet, top, clip, moments)


def _band(
    sheet: Sheet, top: float, clip: PlayerClip, spans: Sequence[Segment], styles: dict[str, ClassStyle]
) -> float:  # fmt: skip
    for span, lane in zip(spans, lanes_of(spans), strict=True):
        if lane < MOST_LANES:
            left, wide = (value * WIDE / clip.duration for value in (span.start, span.stop - span.start))
            colour = styles[span.label].colour
            sheet.box(LEFT + left, top + BAND * lane, max(wide - 0.01, 0.01), BAND - 0.02, colour)
            text = fitted(span.label, wide - 0.08, 7.5)
            if text:
                middle = top + BAND * (lane + 0.5) - 0.01
                sheet.text(LEFT + left + 0.04, middle, text, size=7.5, color=ink_on(colour), va="center_baseline")
    return top + BAND * _lanes(spans) + 0.04


def _path(sheet: Sheet, top: float, clip: PlayerClip, moments: np.ndarray) -> None:
    root = np.asarray(clip.positions[:, INDEX["hips"]], np.float64)
    # Seen from above with the heading up, the body's left is left: +x of the body points to the left of the page.
    x, _, z = (root - root[0]).T
    left, ahead = turn_on_ground(x, z, -clip.heading)
    across = -left
    half = max(np.ptp(across), np.ptp(ahead), 0.3) * 0.56
    middle = [(v.min() + v.max()) / 2 for v in (across, ahead)]
    axes = bare(sheet.axes(LEFT + WIDE + GAP, top, PATH, PATH), "left", "right", "top", "bottom")
    for side in axes.spines.values():
        side.set_color("#dcdcdc")
    axes.set_xlim(middle[0] - half, middle[0] + half)
    axes.set_ylim(middle[1] - half, middle[1] + half)
    axes.plot(across, ahead, color=FAINT, linewidth=1)
    axes.scatter(across[moments], ahead[moments], s=9, color=INK, linewidths=0, zorder=3)
    axes.scatter(across[:1], ahead[:1], s=26, facecolor="white", edgecolor=INK, linewidths=1, zorder=4)
    length = max(value for value in _LENGTHS if value <= max(0.8 * half, _LENGTHS[0]))
    start, low = middle[0] - 0.92 * half, middle[1] - 0.9 * half
    axes.plot([start, start + length], [low, low], color=INK, linewidth=1.2)
    axes.text(start, low + 0.05 * half, f"{length:g} m", fontsize=7)
    sheet.text(LEFT + WIDE + GAP, top + PATH + 0.15, "path from above, ring: start", size=7, color=FAINT)


ROW: Final = 1.22
STRIP: Final = 2.65
SHEET_LEFT: Final = 1.55
SHARES: Final = 2.5
BARS: Final = 4


@dataclass(frozen=True)
class WordStrip:
    """A word: the clip it is from, when in that clip, and [n, 21, 3] moments of it."""

    clip: str
    when: str
    poses: FloatArray


@dataclass(frozen=True)
class MotifRow:
    """One motif of a contact sheet.

    Attributes:
        motif: its number.
        reason: why it is shown, such as the class that it stands for.
        colour: [3], its colour in bands.
        words: the closest to its centroid first, each from another clip.
        shares: (class, share of the words of that class that belong to the motif).
    """

    motif: int
    reason: str
    colour: Float64Array
    words: Sequence[WordStrip]
    shares: Sequence[tuple[str, float]]


@styled
def contact_sheet(rows: Sequence[MotifRow], title: str, note: str = "", shares_title: str = "") -> Figure:
    """One row a motif: its words as stick figures in time, and its share in the classes where it is most common."""
    columns = max((len(row.words) for row in rows), default=1)
    bars = SHEET_LEFT + columns * STRIP + 0.2
    sheet = Sheet(bars + SHARES + 0.15, TOP + 0.25 + ROW * len(rows), title, note)
    sheet.text(SHEET_LEFT, TOP + 0.08, "closest to the motif's centre", size=8, color=FAINT)
    if columns > 1:
        sheet.text(SHEET_LEFT + STRIP, TOP + 0.08, "next closest, from other clips", size=8, color=FAINT)
    sheet.text(bars, TOP + 0.08, shares_title, size=8, color=FAINT)
    for i, row in enumerate(rows):
        _draw_row(sheet, row, TOP + 0.2 + ROW * i, bars)
    return sheet.figure


def _draw_row(sheet: Sheet, row: MotifRow, top: float, bars: float) -> None:
    sheet.box(0.12, top + 0.28, 0.16, 0.16, tuple(row.colour))
    sheet.text(0.36, top + 0.42, f"motif {row.motif}", size=9, weight="bold")
    sheet.text(0.12, top + 0.66, row.reason, size=8, room=SHEET_LEFT - 0.2)
    for i, word in enumerate(row.words):
        left = SHEET_LEFT + i * STRIP
        draw_strip(sheet, left, top, STRIP - 0.15, ROW - 0.24, word.poses)
        name = fitted(word.clip, STRIP - 0.2 - width_of(word.when, 7), 7)
        sheet.text(left + STRIP / 2 - 0.06, top + ROW - 0.14, name + word.when, size=7, color=FAINT, ha="center")
    held = [(name, share) for name, share in row.shares if share > 0]
    shown = sorted(held, key=lambda s: (-s[1], s[0]))[:BARS]
    if len(held) == 1:
        sheet.text(bars, top + 0.46, "nowhere else", size=8, color=FAINT)
    most = max((share for _, share in shown), default=0.0) or 1.0
    for i, (name, share) in enumerate(shown):
        y = top + 0.2 + 0.22 * i
        sheet.text(bars, y + 0.04, name, size=8, room=1.15)
        sheet.box(bars + 1.2, y - 0.07, 0.8 * share / most, 0.13, tuple(row.colour))
        sheet.text(bars + 2.05, y + 0.04, percent(share), size=8)
