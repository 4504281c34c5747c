"""A self-contained HTML page that plays one motion, or two side by side: no network, no other file."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Sequence
from html import escape
from importlib import resources
from typing import Any, Final

from motionlake.motion.skeleton import INDEX, JOINTS, PARENTS
from motionlake.pictures.bands import Segment, lanes_of
from motionlake.pictures.player_material import MOST_SECONDS, PlayerClip, pack
from motionlake.pictures.stick_figures import LEFT, RIGHT
from motionlake.pictures.style import FAINT, INK, NONE, class_styles, ink_on

MOST_LANES: Final = 6
_TOKENS: Final = {"ink": INK, "faint": FAINT, "none": NONE, "left": LEFT, "right": RIGHT}
_SPEEDS: Final = ("0.1", "0.25", "0.5", "1", "2", "4")
_KEYS: Final = (
    ("Space", "play or pause"), ("← →", "a frame back or on, with Shift a second"), ("Home End", "first or last frame"),
    ("F", "the camera follows the body or stays"), ("R", "the view as it was"), ("+ −", "nearer or farther"),
)  # fmt: skip


def player_page(clips: Sequence[PlayerClip], notes: Sequence[str] = ()) -> str:
    """The page.

    Names, labels and facts may hold anything: they are escaped in HTML and in the embedded JSON, and the page's
    Content-Security-Policy lets no script run but its own.

    Args:
        clips: one or two; the first sets the rate of the timeline.
        notes: lines above the player.

    Raises:
        ValueError: neither one nor two clips, or one without frames.
    """
    if len(clips) not in (1, 2):
        raise ValueError(f"{len(clips)} clips: one or two are shown side by side")
    for clip in clips:
        if not len(clip.positions):
            raise ValueError(f"{clip.name}: has no frames")
    tokens = " ".join(f"--{name}: {value};" for name, value in _TOKENS.items())
    style = f":root {{ {tokens} }}\n{_asset('player.css')}"
    script = _asset("player.js")
    policy = f"default-src 'none'; script-src {_hash(script)}; style-src {_hash(style)}; img-src data:"
    return "\n".join(
        [
            '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{escape(clips[0].name)}</title><style>{style}</style></head><body>",
            f"<h1>{escape(clips[0].name.rpartition('/')[2])}</h1>",
            *(f'<p class="note">{escape(line)}</p>' for line in [*notes, *_cuts(clips)]),
            f'<main><div class="panes">{"".join(map(_pane, clips))}</div>',
            _controls(two=len(clips) == 2),
            _timeline(clips),
            f"</main>{_help()}",
            f'<script type="application/json" id="motion">{_json(_motion(clips))}</script>',
            f"<script>{script}</script></body></html>\n",
        ]
    )


def _asset(name: str) -> str:
    return resources.files("motionlake.pictures").joinpath(name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _json(value: Any) -> str:
    """JSON that no text can close the script element of, or open a comment in."""
    text = json.dumps(value, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _cuts(clips: Sequence[PlayerClip]) -> list[str]:
    return [
        f"{clip.name}: the first {MOST_SECONDS:.0f} s of {clip.duration:.0f} s are shown; --from and --to show others."
        for clip in clips
        if clip.cut
    ]


def _pane(clip: PlayerClip) -> str:
    facts = "".join(f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>" for name, value in clip.facts)
    return (
        f'<figure><canvas tabindex="0" role="img" aria-label="Stick figure of {escape(clip.name)}; drag or arrow keys '
        f'turn it"></canvas><figcaption><h2>{escape(clip.name)}</h2><dl>{facts}</dl><div class="now"></div>'
        "</figcaption></figure>"
    )


def _controls(*, two: bool) -> str:
    speeds = "".join(
        f'<option value="{speed}"{" selected" if speed == "1" else ""}>{speed}×</option>' for speed in _SPEEDS
    )
    stretch = '<label><input type="checkbox" id="stretch">stretch to equal length</label>' if two else ""
    return (
        '<div class="controls" role="group" aria-label="Player"><button id="play" type="button">Play</button>'
        f'<label>Speed <select id="speed">{speeds}</select></label>'
        '<label><input type="checkbox" id="loop" checked>loop</label>'
        '<label><input type="checkbox" id="follow" checked>camera follows</label>'
        f'{stretch}<button id="home" type="button">Reset view</button><output id="time"></output></div>'
    )


def _timeline(clips: Sequence[PlayerClip]) -> str:
    bands = [
        f"<h3>{escape(name)}{f' of {escape(clip.name)}' if len(clips) > 1 else ''}{_left_out(spans)}</h3>"
        f'<ul data-pane="{i}" data-band="{j}" aria-label="{escape(name)} of {escape(clip.name)}"></ul>'
        for i, clip in enumerate(clips)
        for j, (name, spans) in enumerate(clip.bands)
    ]
    shown = f'<div class="bands"><div id="needle"></div>{"".join(bands)}</div>' if bands else ""
    return (
        '<div class="timeline"><input type="range" id="scrub" aria-label="Frame" min="0" max="0" value="0" step="1">'
        f"{shown}</div>"
    )


def _left_out(spans: Sequence[Segment]) -> str:
    missing = sum(lane >= MOST_LANES for lane in lanes_of(spans))
    return f" ({missing} overlapping ones are left out)" if missing else ""


def _help() -> str:
    keys = "".join(f"<div><dt><kbd>{keys}</kbd></dt><dd>{what}</dd></div>" for keys, what in _KEYS)
    return (
        f"<details><summary>Keys and mouse</summary><dl>{keys}"
        "<div><dt>drag</dt><dd>turns the view; arrow keys do while a figure has the focus</dd></div>"
        "<div><dt>wheel, pinch</dt><dd>nearer or farther</dd></div>"
        "<div><dt>double click</dt><dd>the view as it was</dd></div></dl>"
        "<p>Left limbs are blue, right limbs orange. The grid has squares of half a metre, wider where a path is long; "
        "the line on the ground is the path of the hips. Both figures are turned to face the same way at first.</p>"
        "</details>"
    )


def _motion(clips: Sequence[PlayerClip]) -> dict[str, Any]:
    """What the script needs."""
    styles = class_styles(sorted({span.label for clip in clips for _, spans in clip.bands for span in spans}))

    def band(spans: Sequence[Segment], seconds: float) -> dict[str, Any]:
        drawn = [
            (span, lane)
            for span, lane in zip(spans, lanes_of(spans), strict=True)
            if lane < MOST_LANES and span.start < seconds
        ]
        return {
            "lanes": max((lane for _, lane in drawn), default=-1) + 1,
            "spans": [
                {
                    "label": span.label,
                    "start": round(span.start, 4),
                    "stop": round(min(span.stop, seconds), 4),
                    "lane": lane,
                    "colour": styles[span.label].colour,
                    "ink": ink_on(styles[span.label].colour),
                }
                for span, lane in drawn
            ],
        }

    return {
        "parents": PARENTS,
        "sides": [next((s for s in ("left", "right") if name.startswith(s)), "ink") for name in JOINTS],
        "head": INDEX["head"],
        "neck": INDEX["neck"],
        "clips": [
            {
                "name": clip.name,
                "frames": clip.frames,
                "first": clip.first,
                "step": clip.step,
                "fps": clip.shown_fps,
                "count": len(clip.shown),
                "seconds": round(min(clip.duration, MOST_SECONDS), 3),
                "floor": round(clip.floor, 4),
                "heading": round(clip.heading, 5),
                "height": round(clip.height, 4),
                "bands": [band(spans, clip.seconds) for _, spans in clip.bands],
                "motion": pack(clip.shown),
            }
            for clip in clips
        ],
    }
