"""A motion as an animated GIF, or two side by side; the camera follows the body."""

from __future__ import annotations

import io
from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from typing import Final

import numpy as np
from matplotlib.font_manager import FontProperties, findfont
from motionlake.arrays import Float64Array
from motionlake.motion.rotations import turn_about_y
from motionlake.motion.skeleton import INDEX, JOINTS, PARENTS
from motionlake.pictures.player_material import PlayerClip
from motionlake.pictures.stick_figures import LEFT, RIGHT, TILT, TURN
from motionlake.pictures.style import FAINT, INK, NONE, class_styles, fitted
from PIL import Image, ImageDraw, ImageFont

MOST_SECONDS: Final = 30.0
FPS: Final = 25  # a GIF counts hundredths of a second, so that 30 frames a second cannot be said
SIZE: Final = 340  # pixels of a pane, wide and high
FOOT: Final = 62  # pixels of the lines below it
SHARP: Final = 2  # drawn so many times as large, then reduced
COLOURS: Final = 96
GRID: Final = 0.5  # metres
REACH: Final = 2.6  # metres of the grid around the body
_BONES: Final = [(i, p) for i, p in enumerate(PARENTS) if p >= 0]
_SIDES: Final = [LEFT if j.startswith("left") else RIGHT if j.startswith("right") else INK for j in JOINTS]


def motion_gif(clips: Sequence[PlayerClip]) -> bytes:
    """The file: 25 frames a second of the first 30 s of the longest clip; shorter ones keep their last frame.

    Raises:
        ValueError: no clips, or one without frames.
    """
    if not clips or not all(len(clip.positions) for clip in clips):
        raise ValueError("a GIF needs clips with frames")
    count = gif_frames(clips)
    panes = [_Pane(clip, clips) for clip in clips]
    sample = np.unique(np.linspace(0, count - 1, 9).round().astype(int)).tolist()
    palette = _stacked([_frame(panes, i) for i in sample]).quantize(COLOURS, Image.Quantize.MEDIANCUT)
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


class _Pane:
    """One clip; `draw` gives it at a moment."""

    def __init__(self, clip: PlayerClip, clips: Sequence[PlayerClip]) -> None:
        self.clip = clip
        points = np.asarray(clip.positions, np.float64) - (0, clip.floor, 0)
        self.points = turn_about_y(points, TURN - clip.heading)
        self.scale = 0.6 * SIZE * SHARP / max(c.height for c in clips)
        self.styles = class_styles(sorted({s.label for c in clips for _, spans in c.bands for s in spans}))

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
        lines = np.arange(-REACH, REACH + GRID, GRID)
        ends = np.array([-REACH, REACH])
        for off in lines:
            for x, z in ((off, ends), (ends, off)):
                points = np.stack(np.broadcast_arrays(near[0] + x, 0.0, near[2] + z), axis=-1)
                ink.line(self._seen(points, target)[:, :2].ravel().tolist(), fill=NONE, width=SHARP)

    def _body(self, ink: ImageDraw.ImageDraw, body: Float64Array, target: Float64Array) -> None:
        unit = self.clip.height * self.scale
        shadow = self._seen(body * (1, 0, 1), target)
        for i, parent in _BONES:
            _bone(ink, shadow[parent], shadow[i], "#dadada", 0.03 * unit)
        neck, head = body[INDEX["neck"]], body[INDEX["head"]]
        points = np.concatenate([body, (head + (head - neck) * 0.25)[None]])
        seen = self._seen(points, target)
        order = sorted([*_BONES, (len(body), len(body))], key=lambda bone: -(seen[bone[0], 2] + seen[bone[1], 2]))
        for i, parent in order:
            if i < len(body):
                _bone(ink, seen[parent], seen[i], _SIDES[i], 0.02 * unit)
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
        time = " · ".join([f"{now:.2f} s", *played])
        known = dict(clip.facts)
        facts = [known[name] for name in ("label", "dataset") if name in known]
        facts += [f"distance {known['distance']}"] if "distance" in known else []
        licence = f"licence: {known['licence']}" if "licence" in known else ""
        for text, place, size, colour in (
            (time, (8, 6), 13, INK), (clip.name, (8, SIZE + 9), 12, INK),
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


def _frame(panes: Sequence[_Pane], frame: int) -> Image.Image:
    drawn = [pane.draw(frame / FPS) for pane in panes]
    image = Image.new("RGB", (sum(p.width for p in drawn) + 6 * (len(drawn) - 1), drawn[0].height), "white")
    edges = np.cumsum([0, *(p.width + 6 for p in drawn)]).tolist()
    for pane, (left, _) in zip(drawn, pairwise(edges), strict=True):
        image.paste(pane, (left, 0))
    return image


def _stacked(images: Sequence[Image.Image]) -> Image.Image:
    stack = Image.new("RGB", (images[0].width, sum(i.height for i in images)))
    for at, image in enumerate(images):
        stack.paste(image, (0, at * image.height))
    return stack


@cache
def _font(size: int) -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(findfont(FontProperties(family="DejaVu Sans")), size)
