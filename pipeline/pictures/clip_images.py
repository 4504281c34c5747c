"""A motion as an image file: an animated GIF, or moments of it on paper; of several motions, side by side."""

from __future__ import annotations

import io
from collections.abc import Sequence
from functools import cache
from typing import Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont
from motionlake.arrays import Float64Array, IntArray
from motionlake.motion.rotations import turn_about_y, turn_on_ground
from motionlake.motion.skeleton import INDEX
from motionlake.pictures.bands import Segment, draw_segments, in_few_lanes, lane_count
from motionlake.pictures.player_material import PlayerClip, styles_of
from motionlake.pictures.stick_figures import BONES, SIDES, TILT, TURN, draw_moments
from motionlake.pictures.style import FAINT, INK, NONE, TOP, ClassStyle, Sheet, fitted, styled, tick_seconds
from PIL import Image, ImageDraw, ImageFont

MOST_SECONDS: Final = 30.0
FPS: Final = 25  # a GIF counts hundredths of a second, so that 30 frames a second cannot be said
SIZE: Final = 340  # pixels of a pane, wide and high
FOOT: Final = 62  # pixels of the lines below it
APART: Final = 6  # pixels from pane to pane
SHARP: Final = 2  # drawn so many times as large, then reduced
COLOURS: Final = 96
GRID: Final = 0.5  # metres
REACH: Final = 2.6  # metres of the grid around the body


def motion_gif(clips: Sequence[PlayerClip]) -> bytes:
    """The file: 25 frames a second of the first 30 s of the longest clip; shorter ones keep their last frame.

    The camera follows the body.
    """
    count = gif_frames(clips)
    panes = [_Pane(clip, clips) for clip in clips]
    sample = np.linspace(0, count - 1, 9).round().astype(int)
    stack = np.concatenate([np.asarray(_frame(panes, i)) for i in np.unique(sample).tolist()])
    palette = Image.fromarray(stack).quantize(COLOURS, Image.Quantize.MEDIANCUT)
    frames = (_frame(panes, i).quantize(palette=palette, dither=Image.Dither.NONE) for i in range(count))
    first = next(frames)
    buffer = io.BytesIO()
    first.save(
        buffer, "GIF", save_all=True, append_images=frames, duration=1000 // FPS, loop=0, optimize=False, disposal=1
    )
    return buffer.getvalue()


def gif_frames(clips: Sequence[PlayerClip]) -> int:
    """How many frames the GIF has."""
    return max(1, round(min(MOST_SECONDS, max(clip.duration for clip in clips)) * FPS))


def _frame(panes: Sequence[_Pane], frame: int) -> Image.Image:
    image = Image.new("RGB", ((SIZE + APART) * len(panes) - APART, SIZE + FOOT), "white")
    for i, pane in enumerate(panes):
        image.paste(pane.draw(frame / FPS), ((SIZE + APART) * i, 0))
    return image


class _Pane:
    """One clip; `draw` gives it at a moment."""

    def __init__(self, clip: PlayerClip, clips: Sequence[PlayerClip]) -> None:
        self.clip = clip
        points = np.asarray(clip.positions, np.float64) - (0, clip.floor, 0)
        self.points = turn_about_y(points, TURN - clip.heading)
        self.scale = 0.6 * SIZE * SHARP / max(c.height for c in clips)
        self.styles = styles_of(clips)

    def draw(self, seconds: float) -> Image.Image:
        clip = self.clip
        frame = min(len(self.points) - 1, int(seconds * clip.fps + 1e-6))
        image = Image.new("RGB", (SIZE * SHARP, SIZE * SHARP), "#f6f6f6")
        ink = ImageDraw.Draw(image)
        target = self.points[frame, 0] * (1, 0, 1)
        self._ground(ink, target)
        path = self.points[:, 0] * (1, 0, 1)
        every = max(1, round(clip.fps / 30))
        for part, colour, wide in ((path[::every], "#c4c4c4", 2), (path[: frame + 1 : every], FAINT, 4)):
            if len(part) > 1:
                ink.line(self._seen(part, target)[:, :2].ravel().tolist(), fill=colour, width=wide, joint="curve")
        self._body(ink, self.points[frame], target)
        return self._captioned(image.reduce(SHARP), frame)

    def _seen(self, points: Float64Array, target: Float64Array) -> Float64Array:
        """[..., 3]: pixels to the right and down, metres away from the viewer."""
        x, y, z = np.moveaxis(points - target, -1, 0)
        across = SIZE * SHARP / 2 + x * self.scale
        down = 0.8 * SIZE * SHARP - (y * np.cos(TILT) - z * np.sin(TILT)) * self.scale
        return np.stack([across, down, -z * np.cos(TILT) - y * np.sin(TILT)], axis=-1)

    def _ground(self, ink: ImageDraw.ImageDraw, target: Float64Array) -> None:
        near = np.round(target / GRID) * GRID
        ends = np.array([-REACH, REACH])
        for off in np.arange(-REACH, REACH + GRID, GRID):
            for x, z in ((off, ends), (ends, off)):
                points = np.stack(np.broadcast_arrays(near[0] + x, 0.0, near[2] + z), axis=-1)
                ink.line(self._seen(points, target)[:, :2].ravel().tolist(), fill=NONE, width=SHARP)

    def _body(self, ink: ImageDraw.ImageDraw, body: Float64Array, target: Float64Array) -> None:
        unit = self.clip.height * self.scale
        shadow = self._seen(body * (1, 0, 1), target)
        for i, parent in BONES:
            _bone(ink, shadow[parent], shadow[i], "#dadada", 0.03 * unit)
        neck, head = body[INDEX["neck"]], body[INDEX["head"]]
        crown = len(body)
        seen = self._seen(np.concatenate([body, (head + (head - neck) * 0.25)[None]]), target)
        order = sorted([*BONES.tolist(), (crown, crown)], key=lambda bone: -(seen[bone[0], 2] + seen[bone[1], 2]))
        for i, parent in order:
            if i != crown:
                _bone(ink, seen[parent], seen[i], SIDES[i], 0.02 * unit)
                continue
            (x, y), radius = seen[i, :2], 0.055 * unit
            ink.ellipse((x - radius, y - radius, x + radius, y + radius), "#f6f6f6", INK, round(0.013 * unit))

    def _captioned(self, pane: Image.Image, frame: int) -> Image.Image:
        clip, now = self.clip, frame / self.clip.fps
        image = Image.new("RGB", (SIZE, SIZE + FOOT), "white")
        image.paste(pane)
        ink = ImageDraw.Draw(image)
        spans = [span for _, spans in clip.bands for span in spans]
        played = dict.fromkeys(span.label for span in spans if span.start <= now + 1e-6 < span.stop)
        known = dict(clip.facts)
        facts = [known[name] for name in ("label", "dataset") if name in known]
        facts += [f"distance {known['distance']}"] if "distance" in known else []
        licence = f"licence: {known['licence']}" if "licence" in known else ""
        for text, place, size, colour in (
            (" · ".join([f"{now:.2f} s", *played]), (8, 6), 13, INK), (clip.name, (8, SIZE + 9), 12, INK),
            (" · ".join(facts), (8, SIZE + 26), 11, FAINT), (licence, (8, SIZE + 42), 11, FAINT),
        ):  # fmt: skip
            ink.text(place, fitted(text, (SIZE - 16) / 72, size), fill=colour, font=_font(size))
        whole = min(clip.duration, MOST_SECONDS)
        ink.rectangle((0, SIZE, SIZE, SIZE + 4), fill=NONE)
        for span in spans:
            left, right = (min(1.0, at / whole) * SIZE for at in (span.start, span.stop))
            if right > left:
                ink.rectangle((left, SIZE, right, SIZE + 4), fill=self.styles[span.label].colour)
        at = SIZE * min(1.0, now / whole)
        ink.rectangle((at - 1, SIZE - 2, at + 1, SIZE + 6), fill=INK)
        return image


def _bone(ink: ImageDraw.ImageDraw, start: Float64Array, stop: Float64Array, colour: str, width: float) -> None:
    ink.line([*start[:2], *stop[:2]], fill=colour, width=max(2, round(width)))
    for x, y, _ in (start, stop):
        ink.ellipse((x - width / 2, y - width / 2, x + width / 2, y + width / 2), fill=colour)


@cache
def _font(size: int) -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(findfont(FontProperties(family="DejaVu Sans")), size)


MOMENTS: Final = 12
LEFT: Final = 0.25
WIDE: Final = 10.5
FIGURES: Final = 1.25  # inches that a row of stick figures is high
LANE: Final = 0.2
PATH: Final = 1.5  # inches of the square of a path
GAP: Final = 0.35
_LENGTHS: Final = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)


@styled
def film_strip(clips: Sequence[PlayerClip]) -> Figure:
    """A row a clip: figures at evenly spaced moments above the time they stand for, left limbs blue, right orange.

    On the right the path of the hips, from above, turned so that the body faces up at first; dots are the moments.
    """
    bands = [[in_few_lanes(spans) for _, spans in clip.bands] for clip in clips]
    heights = [max(0.95 + FIGURES + LANE * sum(map(lane_count, rows)), PATH + 0.8) for rows in bands]
    title = " beside ".join(clip.name.rpartition("/")[2] for clip in clips)
    sheet = Sheet(LEFT + WIDE + GAP + PATH + 0.2, TOP + sum(heights), title)
    top = TOP - 0.2
    for clip, rows, height in zip(clips, bands, heights, strict=True):
        _strip(sheet, top, clip, rows, styles_of(clips))
        top += height
    return sheet.figure


def _strip(
    sheet: Sheet, top: float, clip: PlayerClip, bands: Sequence[Sequence[Segment]], styles: dict[str, ClassStyle]
) -> None:
    said = ", ".join(f"{name} {value}" for name, value in clip.facts)
    sheet.text(LEFT, top + 0.14, clip.name, size=9, weight="bold", room=sheet.width - LEFT - 0.2)
    sheet.text(LEFT, top + 0.31, said, size=8, color=FAINT, room=sheet.width - LEFT - 0.2)
    top += 0.4
    moments = ((np.arange(MOMENTS) + 0.5) * len(clip.positions) / MOMENTS).astype(int)
    draw_moments(sheet, LEFT, top + FIGURES, WIDE, 0.95 * FIGURES, clip.positions[moments], 0.85)
    below = top + FIGURES + 0.08
    for spans in bands:
        height = LANE * lane_count(spans)
        draw_segments(sheet, LEFT, below, WIDE, height, spans, clip.duration, styles)
        below += height + 0.04
    tick_seconds(sheet.bare(LEFT, below, WIDE, 0.001, "bottom"), clip.duration)
    sheet.text(LEFT + WIDE, below + 0.3, "seconds", size=7.5, color=FAINT, ha="right")
    _path(sheet, top, clip, moments)


def _path(sheet: Sheet, top: float, clip: PlayerClip, moments: IntArray) -> None:
    root = np.asarray(clip.positions[:, INDEX["hips"]], np.float64)
    # Seen from above with the heading up, the body's left is left: +x of the body points to the left of the page.
    x, _, z = (root - root[0]).T
    left, ahead = turn_on_ground(x, z, -clip.heading)
    across = -left
    half = max(np.ptp(across), np.ptp(ahead), 0.3) * 0.56
    middle = [(v.min() + v.max()) / 2 for v in (across, ahead)]
    axes = sheet.bare(LEFT + WIDE + GAP, top, PATH, PATH, "left", "right", "top", "bottom")
    axes.spines[:].set_color("#dcdcdc")
    axes.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half))
    axes.plot(across, ahead, color=FAINT, linewidth=1)
    axes.scatter(across[moments], ahead[moments], s=9, color=INK, linewidths=0, zorder=3)
    axes.scatter(across[:1], ahead[:1], s=26, facecolor="white", edgecolor=INK, linewidths=1, zorder=4)
    length = max(value for value in _LENGTHS if value <= max(0.8 * half, _LENGTHS[0]))
    start, low = middle[0] - 0.92 * half, middle[1] - 0.9 * half
    axes.plot([start, start + length], [low, low], color=INK, linewidth=1.2)
    axes.text(start, low + 0.05 * half, f"{length:g} m", fontsize=7)
    sheet.text(LEFT + WIDE + GAP, top + PATH + 0.15, "path from above, ring: start", size=7, color=FAINT)
