"""A self-contained HTML page that plays one motion, or up to four side by side: no network, no other file."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterable, Sequence
from importlib import resources
from typing import Any, Final

import numpy as np
from motionlake.arrays import FloatArray
from motionlake.motion.skeleton import FEET, INDEX, JOINTS, PARENTS
from motionlake.names import html, printable
from motionlake.pictures.bands import Segment, in_few_lanes, lane_count, lanes_of
from motionlake.pictures.html import document
from motionlake.pictures.player_material import MOST_SECONDS, PlayerClip, styles_of
from motionlake.pictures.stick_figures import LEFT, RIGHT
from motionlake.pictures.style import FAINT, INK, NONE, ClassStyle, ink_on

_TOKENS: Final = {"ink": INK, "faint": FAINT, "none": NONE, "left": LEFT, "right": RIGHT}
MOST_CLIPS: Final = 4
# The script, in the order in which its parts use one another.
_PARTS: Final = ("motion", "scene", "marks", "body", "curves")
_TRAILS: Final = ("head", "left_wrist", "right_wrist", "left_ankle", "right_ankle")
_SHOWN: Final = (
    ("body", "capsules"), ("contacts", "standing feet"), ("trails", "trails"), ("onion", "onion skin"),
    ("curved", "curves"),
)  # fmt: skip
_MEASURES: Final = ("height", "speed", "ground speed")
_SPEEDS: Final = ("0.1", "0.25", "0.5", "1", "2", "4")
_HELP: Final = (
    ("<kbd>Space</kbd>", "play or pause"), ("<kbd>← →</kbd>", "a frame back or on, with Shift a second"),
    ("<kbd>Home End</kbd>", "first or last frame"), ("<kbd>F</kbd>", "the camera follows the body or stays"),
    ("<kbd>R</kbd>", "the view as it was"), ("<kbd>B</kbd>", "sticks or capsules"), ("<kbd>C</kbd>", "standing feet"),
    ("<kbd>T</kbd>", "trails"), ("<kbd>N</kbd>", "onion skin"), ("<kbd>J</kbd>", "curves of a joint"),
    ("<kbd>O</kbd>", "the other clips over the first"), ("<kbd>+ −</kbd>", "nearer or farther"),
    ("drag", "turns the view; arrow keys do while a figure has the focus"), ("wheel, pinch", "nearer or farther"),
    ("double click", "the view as it was"),
)  # fmt: skip


def player_page(clips: Sequence[PlayerClip]) -> str:
    """The page.

    Names, labels and facts may hold anything: they are escaped in HTML and in the embedded JSON, and the page's
    Content-Security-Policy lets no script run but its own.

    Args:
        clips: one to four; the first sets the rate of the timeline.

    Raises:
        ValueError: none, or more than four clips.
    """
    if not 1 <= len(clips) <= MOST_CLIPS:
        raise ValueError(f"{len(clips)} clips: one to {MOST_CLIPS} are shown side by side")
    tokens = " ".join(f"--{name}: {value};" for name, value in _TOKENS.items())
    style, script = f":root {{ {tokens} }}\n{_asset('player.css')}", _script()
    policy = f"default-src 'none'; script-src {_hash(script)}; style-src {_hash(style)}; img-src data:"
    body = [
        f"<h1>{html(clips[0].name.rpartition('/')[2])}</h1>",
        *(f'<p class="note">{html(_cut(clip))}</p>' for clip in clips if clip.duration > MOST_SECONDS),
        f'<main><div class="panes" data-count="{len(clips)}">{"".join(map(_pane, clips))}</div>',
        _controls(several=len(clips) > 1),
        _choices(several=len(clips) > 1),
        _timeline(clips),
        f"</main>{_help()}",
        f'<script type="application/json" id="motion">{_json(_motion(clips))}</script>',
        f"<script>{script}</script>",
    ]
    return document(clips[0].name, style, body, f'<meta http-equiv="Content-Security-Policy" content="{policy}">')


def _asset(name: str) -> str:
    return resources.files("motionlake.pictures").joinpath(name).read_text(encoding="utf-8")


def _script() -> str:
    """The parts in one scope, which nothing else of the page sees."""
    parts = [_asset(f"player_{name}.js") for name in _PARTS] + [_asset("player.js")]
    return '"use strict";\n(() => {\n' + "\n".join(parts) + "})();\n"


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _json(value: Any) -> str:
    """JSON that no text can close the script element of, or open a comment in."""
    text = json.dumps(value, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026").replace("\x7f", "\\u007f")


def _cut(clip: PlayerClip) -> str:
    return (
        f"{clip.name}: the first {MOST_SECONDS:.0f} s of {clip.duration:.0f} s are shown; --from and --to show others."
    )


def _pane(clip: PlayerClip) -> str:
    facts = _terms((html(name), html(value)) for name, value in clip.facts)
    return (
        f'<figure><canvas tabindex="0" role="img" aria-label="Stick figure of {html(clip.name)}; drag or arrow keys '
        f'turn it"></canvas><figcaption><h2>{html(clip.name)}</h2>{facts}<div class="now"></div>'
        "</figcaption></figure>"
    )


def _terms(pairs: Iterable[tuple[str, str]]) -> str:
    return f"<dl>{''.join(f'<div><dt>{term}</dt><dd>{said}</dd></div>' for term, said in pairs)}</dl>"


def _controls(*, several: bool) -> str:
    speeds = "".join(f'<option value="{s}"{" selected" if s == "1" else ""}>{s}×</option>' for s in _SPEEDS)
    stretch = '<label><input type="checkbox" id="stretch">stretch to equal length</label>' if several else ""
    return (
        '<div class="controls" role="group" aria-label="Player"><button id="play" type="button">Play</button>'
        f'<label>Speed <select id="speed">{speeds}</select></label>'
        '<label><input type="checkbox" id="loop" checked>loop</label>'
        '<label><input type="checkbox" id="follow" checked>camera follows</label>'
        f'{stretch}<button id="home" type="button">Reset view</button><output id="time"></output></div>'
    )


def _choices(*, several: bool) -> str:
    """What may be shown with the bodies."""
    shown = [*_SHOWN, *([("overlay", "all in the first")] if several else [])]
    boxes = "".join(f'<label><input type="checkbox" id="{name}">{said}</label>' for name, said in shown)
    return f'<div class="controls shown" role="group" aria-label="Shown">{boxes}</div>'


def _curves(clips: Sequence[PlayerClip]) -> str:
    """A plot of a joint, which is shown where it is asked for."""
    chosen = INDEX["left_ankle"]
    joints = "".join(
        f'<option value="{i}"{" selected" if i == chosen else ""}>{name.replace("_", " ")}</option>'
        for i, name in enumerate(JOINTS)
    )
    measures = "".join(f'<option value="{name}">{name}</option>' for name in _MEASURES)
    keys = "".join(
        f'<span><span class="key key{i}"></span>{html(clip.name.rpartition("/")[2])}</span>'
        for i, clip in enumerate(clips)
    )
    return (
        f'<div id="curves" hidden><div class="controls"><label>Joint <select id="joint">{joints}</select></label>'
        f'<label>Curve <select id="measure">{measures}</select></label>{keys}<output id="values"></output></div>'
        "</div>"
    )


def _timeline(clips: Sequence[PlayerClip]) -> str:
    bands = []
    for i, clip in enumerate(clips):
        for j, (name, spans) in enumerate(clip.bands):
            of = f" of {html(clip.name)}"
            missing = len(spans) - len(in_few_lanes(spans))
            left_out = f" ({missing} overlapping ones are left out)" if missing else ""
            bands.append(
                f"<h3>{html(name)}{of if len(clips) > 1 else ''}{left_out}</h3>"
                f'<ul data-pane="{i}" data-band="{j}" aria-label="{html(name)}{of}"></ul>'
            )
    shown = f'<div class="bands"><div id="needle"></div>{"".join(bands)}</div>' if bands else ""
    return (
        '<div class="timeline"><input type="range" id="scrub" aria-label="Frame" min="0" max="0" value="0" step="1">'
        f"{shown}</div>{_curves(clips)}"
    )


def _help() -> str:
    return (
        f"<details><summary>Keys and mouse</summary>{_terms(_HELP)}"
        "<p>Left limbs are blue, right limbs orange. The grid has squares of half a metre, wider where a path is long; "
        "the line on the ground is the path of the hips. All figures are turned to face the same way at first. A green "
        "mark is under a joint of a foot that stands, and shows how far it slid. Onion skin: grey before, blue after."
        "</p>"
        "</details>"
    )


def _motion(clips: Sequence[PlayerClip]) -> dict[str, Any]:
    """What the script needs."""
    styles = styles_of(clips)
    return {
        "parents": PARENTS,
        "sides": [next((s for s in ("left", "right") if name.startswith(s)), "ink") for name in JOINTS],
        "head": INDEX["head"],
        "neck": INDEX["neck"],
        "names": JOINTS,
        "feet": FEET,
        "trails": [INDEX[name] for name in _TRAILS],
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
                "bands": [_band(spans, len(clip.shown) / clip.shown_fps, styles) for _, spans in clip.bands],
                "motion": pack(clip.shown),
            }
            for clip in clips
        ],
    }


def _band(spans: Sequence[Segment], seconds: float, styles: dict[str, ClassStyle]) -> dict[str, Any]:
    shown = [span for span in in_few_lanes(spans) if span.start < seconds]
    return {
        "lanes": lane_count(shown),
        "spans": [
            {
                "label": span.label,
                "shown": printable(span.label),
                "start": round(span.start, 4),
                "stop": round(min(span.stop, seconds), 4),
                "lane": lane,
                "colour": styles[span.label].colour,
                "ink": ink_on(styles[span.label].colour),
            }
            for span, lane in zip(shown, lanes_of(shown), strict=True)
        ],
    }


def pack(positions: FloatArray) -> str:
    """Positions [n, 21, 3] in whole millimetres as base64: [n, 3] int32 roots, then [n, 20, 3] int16 joints off them.

    Numbers are little-endian. Joints are rounded off the rounded root, so that no coordinate is off by more than half
    a millimetre; joints more than 32 m from their root are moved to there.
    """
    millimetres = np.asarray(positions, np.float64) * 1000
    root = np.round(millimetres[:, 0])
    joints = np.round(millimetres[:, 1:] - root[:, None])
    limits = np.iinfo(np.int16)
    packed = root.astype("<i4").tobytes() + np.clip(joints, limits.min, limits.max).astype("<i2").tobytes()
    return base64.b64encode(packed).decode("ascii")
