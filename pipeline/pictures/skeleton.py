"""The skeleton of a file, drawn from two sides with every joint named, and which canonical joint each one is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from motionlake.arrays import Float64Array
from motionlake.motion.rig_joints import RigJoint
from motionlake.motion.skeleton import JOINTS
from motionlake.pictures.stick_figures import LEFT, RIGHT
from motionlake.pictures.style import FAINT, INK, TOP, Sheet, fitted, styled

SURE: Final = 0.5  # a joint that is less sure is marked
DOUBT: Final = "#AA1144"
_BONE: Final = "#b8b8b8"
_NAMES: Final = 3.0  # inches that a column of names takes
_ROW: Final = 0.165
_FRONT: Final = 3.6  # inches that the drawing between the names is wide
_SIDE: Final = 3.0
_LEAST: Final = 5.0  # inches that it is tall
_FRAMES: Final = 64
_MARGIN: Final = 0.25
_BROADER: Final = 2.0  # times as broad, the view from the side comes first, as of an animal


@dataclass(frozen=True)
class DrawnSkeleton:
    """A body of a file in one frame.

    Attributes:
        names, parents: of its J joints, then of end sites, which have no name.
        front, side: [J, 2] places on the page in two views, x right and y up; the names stand around the first.
        seen: what the views are called.
        joints: what each joint is.
    """

    names: Sequence[str | None]
    parents: Sequence[int]
    front: Float64Array
    side: Float64Array
    seen: tuple[str, str]
    joints: Sequence[RigJoint]


def seen_from(
    positions: Float64Array, found: Mapping[str, int], up: Float64Array | None = None
) -> tuple[Float64Array, Float64Array, tuple[str, str]]:
    """The two views of a body in the frame in which it is widest, the broader first, and what they are called.

    Args:
        positions: [F, J, 3] of the joints of a file.
        found: canonical joint -> joint of the file. Without hips, knees and shoulders among them the body is seen along
            the axes of the file.
        up: [3] the file's up axis; None: the body is drawn upright.
    """
    frames = positions[np.unique(np.linspace(0, len(positions) - 1, _FRAMES).round().astype(int))]
    needed = [f"{side}_{part}" for part in ("hip", "knee", "shoulder") for side in ("left", "right")]
    if not all(joint in found for joint in needed):
        views = [(frames[..., [0, 1]], "along the file's z axis"), (frames[..., [2, 1]], "along its x axis")]
    else:
        hips, knees, shoulders = (frames[:, [found[needed[i]], found[needed[i + 1]]]] for i in (0, 2, 4))
        left = hips[:, 0] - hips[:, 1] + shoulders[:, 0] - shoulders[:, 1]
        above = shoulders.mean(axis=1) - knees.mean(axis=1) if up is None else np.tile(up, (len(frames), 1))
        above = _unit(above)
        left = _unit(left - (left * above).sum(axis=-1, keepdims=True) * above)
        across, height, ahead = (np.einsum("fjk,fk->fj", frames, axis) for axis in (left, above, np.cross(left, above)))
        views = [
            (np.stack([across, height], axis=-1), "from the front"),
            (np.stack([ahead, height], axis=-1), "from its left, facing right"),
        ]
    areas = [np.prod(np.ptp(view, axis=1), axis=-1) for view, _ in views]
    frame = int(np.argmax(areas[0]))
    if areas[1][frame] > _BROADER * areas[0][frame]:
        views.reverse()
    return views[0][0][frame], views[1][0][frame], (views[0][1], views[1][1])


def _unit(vectors: Float64Array) -> Float64Array:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12))


@styled
def skeleton_figure(drawn: DrawnSkeleton, title: str, note: str = "", doubt: str = "") -> Figure:
    """Canonical joints are filled in the colour of their side, others hollow; `doubt` says why there is no map."""
    roles = {joint.joint: joint for joint in drawn.joints if joint.joint is not None}
    lacking = [_words(joint.canonical) for joint in drawn.joints if joint.joint is None and joint.canonical]
    columns = _columns(drawn.front[: sum(name is not None for name in drawn.names)])
    rows = max(len(column) for column in columns)
    lines = _lines(doubt, lacking)
    top, height = TOP + 0.3 + 0.17 * len(lines), max(_LEAST, rows * _ROW)
    width = 2 * _NAMES + _FRONT + _SIDE + 0.3
    sheet = Sheet(width, top + height + 0.45, title, note)
    for at, (text, colour) in enumerate(lines):
        sheet.text(0.12, 0.66 + 0.17 * at, text, size=8, color=colour, room=width - 0.2)
    (wide, tall), (deep, _) = (np.maximum(np.ptp(view, axis=0), 1e-9) for view in (drawn.front, drawn.side))
    room, front_room, side_room = (inches - 2 * _MARGIN for inches in (height, _FRONT, _SIDE))
    scale = min(room / tall, front_room / wide, side_room / deep)
    middles = _NAMES + 0.15 + _FRONT / 2, 2 * _NAMES + _FRONT + 0.15 + _SIDE / 2
    views = [
        _placed(view, x, top + height / 2, scale) for view, x in zip((drawn.front, drawn.side), middles, strict=True)
    ]
    for points, called, x in zip(views, drawn.seen, middles, strict=True):
        _draw_body(sheet, drawn, points, roles)
        sheet.text(x, top - 0.08, called, size=8, color=FAINT, ha="center")
    for column, edge, ha in zip(columns, (_NAMES, _NAMES + _FRONT + 0.3), ("right", "left"), strict=True):
        _name(sheet, drawn, views[0], column, roles, (edge, top, height, ha))
    _legend(sheet, top + height + 0.28)
    return sheet.figure


def _lines(doubt: str, lacking: Sequence[str]) -> list[tuple[str, str]]:
    lines = [(f"Not solved: {doubt}", DOUBT)] if doubt else []
    if lacking and len(lacking) < len(JOINTS):
        lines.append((f"{'No joint is' if doubt else 'Filled in'}: {', '.join(lacking)}", INK))
    return lines


def _words(canonical: str | None) -> str:
    return (canonical or "").replace("_", " ")


def _columns(front: Float64Array) -> tuple[list[int], list[int]]:
    """Joints named on the left and on the right, from the top down; those of the middle go where there are fewer."""
    middle = (front[:, 0].min() + front[:, 0].max()) / 2
    order = sorted(range(len(front)), key=lambda joint: (front[joint, 0], -front[joint, 1], joint))
    cut = len(order) // 2
    near = np.ptp(front[:, 0]) * 0.02
    while cut < len(order) and front[order[cut], 0] < middle - near:
        cut += 1
    while cut > 0 and front[order[cut - 1], 0] > middle + near:
        cut -= 1
    first, second = (sorted(part, key=lambda joint: (-front[joint, 1], joint)) for part in (order[:cut], order[cut:]))
    return first, second


def _placed(points: Float64Array, x: float, y: float, scale: float) -> Float64Array:
    """Inches from the top left of points that stand around a middle."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    return np.asarray((points - middle) * scale * [1, -1] + [x, y])


def _colour(role: RigJoint | None) -> str:
    if role is None or role.canonical is None:
        return FAINT
    return LEFT if role.canonical.startswith("left") else RIGHT if role.canonical.startswith("right") else INK


def _draw_body(sheet: Sheet, drawn: DrawnSkeleton, points: Float64Array, roles: Mapping[str, RigJoint]) -> None:
    bones = [points[[parent, joint]] for joint, parent in enumerate(drawn.parents) if parent >= 0]
    sheet.canvas.add_collection(LineCollection(bones, colors=_BONE, linewidths=1.6, zorder=2), autolim=False)
    for joint, name in enumerate(drawn.names):
        if name is None:
            continue
        role = roles.get(name)
        colour, known = _colour(role), role is not None and role.canonical is not None
        sheet.canvas.plot(
            *points[joint], marker="o", markersize=5 if known else 3.4, color=colour, zorder=4 if known else 3,
            markerfacecolor=colour if known else "white", markeredgewidth=0.8,
        )  # fmt: skip


def _name(
    sheet: Sheet, drawn: DrawnSkeleton, points: Float64Array, column: Sequence[int], roles: Mapping[str, RigJoint],
    box: tuple[float, float, float, str],
) -> None:  # fmt: skip
    """The names of a column beside the drawing, each with a line to its joint."""
    edge, top, height, ha = box
    rows = _spaced([float(points[joint, 1]) for joint in column], top + _ROW / 2, top + height - _ROW / 2)
    for joint, y in zip(column, rows, strict=True):
        name = drawn.names[joint] or ""
        role = roles.get(name)
        doubtful = role is not None and role.confidence is not None and role.confidence < SURE
        said = _said(name, role)
        known = role is not None and role.canonical is not None
        colour = DOUBT if doubtful else _colour(role)
        sheet.text(
            edge, y, fitted(said, _NAMES - 0.2, 7.5), size=7.5, color=colour, ha=ha, va="center",
            weight="bold" if known else "normal",
        )  # fmt: skip
        start = edge + (0.05 if ha == "right" else -0.05)
        sheet.canvas.plot([start, points[joint, 0]], [y, points[joint, 1]], color="#dddddd", linewidth=0.5, zorder=1)


def _said(name: str, role: RigJoint | None) -> str:
    if role is None or role.canonical is None:
        return name
    sure = "" if role.confidence is None else f" {role.confidence:.0%}{' ?' if role.confidence < SURE else ''}"
    return f"{name} = {_words(role.canonical)}{sure}"


def _spaced(wanted: Sequence[float], low: float, high: float) -> list[float]:
    """Heights as near as may be to those wanted, in their order, that are a row apart and within bounds."""
    rows: list[float] = []
    for y in wanted:
        rows.append(max(y, low, rows[-1] + _ROW if rows else low))
    limit = high
    for at in range(len(rows) - 1, -1, -1):
        rows[at] = min(rows[at], limit)
        limit = rows[at] - _ROW
    return rows


def _legend(sheet: Sheet, y: float) -> None:
    x = 0.3
    for text, colour, known in (
        ("left", LEFT, True), ("right", RIGHT, True), ("middle", INK, True), ("no canonical joint", FAINT, False),
    ):  # fmt: skip
        face = colour if known else "white"
        sheet.canvas.plot(x, y, marker="o", markersize=5 if known else 3.4, color=colour, markerfacecolor=face)
        sheet.text(x + 0.12, y, text, size=8, va="center_baseline")
        x += 0.5 + 0.075 * len(text)
    sheet.text(x, y, "% is how sure a solved joint is", size=8, color=FAINT, va="center_baseline")
