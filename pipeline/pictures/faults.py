"""Faults of recordings as bands over time, with the body at the worst frame of each kind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.figure import Figure
from motionlake.motion.canonicalise import CanonicalMotion
from motionlake.motion.quality import KINDS, Fault, Quality
from motionlake.pictures.stick_figures import draw_moments
from motionlake.pictures.style import FAINT, INK, TOP, Sheet, class_styles, styled, tick_seconds

MOST_CLIPS: Final = 12
MOST_BODIES: Final = 5
LEFT: Final = 3.9
WIDE: Final = 7.2
LANE: Final = 0.2
BODY: Final = 0.95
NAMES: Final = 1.25
SHORTEST: Final = 0.004  # of a clip, so that one frame is seen
VERDICT_COLOURS: Final = {"ok": "#117733", "doubtful": "#B07800", "bad": "#CC3311"}


@dataclass(frozen=True)
class CheckedClip:
    """A clip, its motion, and what the checks found."""

    name: str
    motion: CanonicalMotion
    quality: Quality


@styled
def fault_bands(clips: Sequence[CheckedClip], title: str, note: str = "") -> Figure:
    """For each clip a lane a kind of fault, below the body at the worst frame of each."""
    heights = [_height(clip) for clip in clips]
    sheet = Sheet(LEFT + WIDE + 0.3, TOP + sum(heights) + 0.1, title, note)
    top = TOP
    for clip, height in zip(clips, heights, strict=True):
        _draw_clip(sheet, clip, top)
        top += height
    return sheet.figure


def _kinds(clip: CheckedClip) -> list[str]:
    return [kind for kind in KINDS if any(fault.kind == kind for fault in clip.quality.faults)]


def _height(clip: CheckedClip) -> float:
    return BODY + LANE * max(1, len(_kinds(clip))) + 0.55


def worst(faults: Sequence[Fault], kind: str) -> Fault:
    """The most severe fault of a kind; of frame rates, what is farthest from 1 either way."""
    found = [fault for fault in faults if fault.kind == kind]
    return max(found, key=lambda f: abs(np.log(max(f.severity, 1e-9))) if kind == "fps" else f.severity)


def _draw_clip(sheet: Sheet, clip: CheckedClip, top: float) -> None:
    quality, kinds = clip.quality, _kinds(clip)
    seconds = quality.frames / quality.fps
    sheet.text(0.12, top + 0.2, clip.name, weight="bold", room=LEFT - NAMES - 0.3)
    sheet.text(0.12, top + 0.38, quality.verdict, color=VERDICT_COLOURS[quality.verdict], weight="bold")
    sheet.text(0.12, top + 0.55, f"{seconds:.1f} s, {quality.fps:g} frames a second", size=7.5, color=FAINT)
    shown = kinds[:MOST_BODIES] or ["as it is"]
    frames = [
        (worst(quality.faults, kind).start + worst(quality.faults, kind).stop) // 2 if kinds else quality.frames // 2
        for kind in shown
    ]
    poses = clip.motion.positions[np.clip(frames, 0, quality.frames - 1)]
    places = draw_moments(sheet, LEFT, top + BODY - 0.05, WIDE, BODY - 0.15, poses, 0.7)
    for kind, place, frame in zip(shown, places, frames, strict=True):
        said = f"{kind.replace('_', ' ')}, {frame / quality.fps:.2f} s"
        sheet.text(float(place), top + BODY + 0.1, said, size=7, color=FAINT, ha="center", room=WIDE / len(shown))
    styles = class_styles(KINDS)
    lanes = max(1, len(kinds))
    axes = sheet.bare(LEFT, top + BODY + 0.16, WIDE, LANE * lanes, "bottom")
    axes.set_facecolor("#f4f4f4")
    axes.set_ylim(lanes, 0)
    for lane, kind in enumerate(kinds):
        middle = top + BODY + 0.16 + LANE * (lane + 0.5)
        sheet.text(LEFT - 0.1, middle, kind.replace("_", " "), size=8, color=INK, ha="right", va="center")
        for fault in quality.faults:
            if fault.kind == kind:
                width = max((fault.stop - fault.start) / quality.fps, SHORTEST * seconds)
                start = min(fault.start / quality.fps, seconds - width)
                axes.bar(
                    start, 0.8, width, lane + 0.1, align="edge", color=styles[kind].colour, hatch=styles[kind].hatch
                )
    tick_seconds(axes, seconds)
