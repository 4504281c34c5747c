"""Joint positions of clips of a lake."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from functools import lru_cache
from typing import Final

import numpy as np
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.colors import to_rgb
from matplotlib.patches import Circle
from motionlake.arrays import Float32Array, Float64Array, FloatArray
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.frames import POSITION_CHANNELS, ROOT_CHANNELS, read_rows
from motionlake.lake.layout import Lake
from motionlake.motion.rotations import turn_on_ground
from motionlake.motion.skeleton import INDEX, JOINTS, PARENTS, facing
from motionlake.pictures.style import INK, Sheet

CACHED: Final = 64
_CHANNELS: Final = (*ROOT_CHANNELS, *POSITION_CHANNELS)


class PoseReader:
    """Reads the canonical positions of clips; the last few stay in memory.

    Attributes:
        positions: of a clip by its name, [F, 21, 3] metres.
    """

    def __init__(self, con: Connection, lake: Lake) -> None:
        self._con, self._lake = con, lake
        self.positions = lru_cache(maxsize=CACHED)(lambda clip: self.many([clip])[clip])

    def many(self, clips: Sequence[str]) -> dict[str, Float32Array]:
        """Positions of several clips, each part of the lake read once."""
        parts: dict[tuple[str, str], list[str]] = defaultdict(list)
        for row in fetch(self._con, "parts_of", {"clips": list(clips)}):
            parts[row["dataset"], row["part"]].append(row["clip"])
        found: dict[str, Float32Array] = {}
        for (dataset, part), members in parts.items():
            path = self._lake.path(self._lake.frames_part(dataset, part))
            for clip, rows in read_rows(path, members, _CHANNELS):
                matrix = np.column_stack([rows.column(name).to_numpy() for name in _CHANNELS])
                found[clip] = matrix.reshape(rows.num_rows, -1, 3)
        return found

    def sample(self, clip: str, start: int, stop: int, count: int) -> Float32Array:
        """[count, 21, 3] frames evenly spread over the half-open range of a clip's frames, its ends included."""
        return spread(self.positions(clip)[start:stop], count)

    def whole(self, clip: str, count: int) -> Float32Array:
        """[count, 21, 3] frames evenly spread over a clip."""
        return spread(self.positions(clip), count)


def spread(positions: Float32Array, count: int) -> Float32Array:
    """[count, 21, 3] of [F, 21, 3], from the first frame to the last; frames repeat where there are too few."""
    return np.asarray(positions[np.linspace(0, len(positions) - 1, count).round().astype(int)])


LEFT: Final = "#0072B2"
RIGHT: Final = "#D55E00"
TURN: Final = np.deg2rad(40)  # of the body from facing the viewer to the viewer's right
TILT: Final = np.deg2rad(12)  # of the view, from above
APART: Final = 0.68  # body heights between two figures
MARGIN: Final = 0.45  # body heights before the first and after the last one
_BONES: Final = [(i, p) for i, p in enumerate(PARENTS) if p >= 0]


def three_quarter_view(positions: FloatArray) -> Float64Array:
    """Bodies on the page: horizontal and vertical in metres, the ground at 0.

    The whole strip is turned as one so that its middle moment faces the same way in every picture; each moment
    stands in its own place, so steps do not run it into its neighbour, and heights stay as they were.

    Args:
        positions: [n, 21, 3] moments of one motion, metres, y up.

    Returns:
        [n, 21, 3]: x to the right, y up, depth away from the viewer.
    """
    points = positions.astype(np.float64) - positions[:, :1] * np.array([1.0, 0.0, 1.0])
    heading = facing(positions)[len(positions) // 2]
    x, z = turn_on_ground(points[..., 0], points[..., 2], TURN - heading)
    y = points[..., 1] - points[..., 1].min()
    return np.stack([x, y * np.cos(TILT) - z * np.sin(TILT), -z * np.cos(TILT) - y * np.sin(TILT)], axis=-1)


def postures_view(positions: FloatArray) -> Float64Array:
    """Postures that are no moments of one motion: each faces the same way and stands on its own ground.

    Args:
        positions: [n, 21, 3], y up, of one scale; a body that is not finite stays so.

    Returns:
        [n, 21, 3] as `three_quarter_view`, in heights of the bodies.
    """
    known = np.isfinite(positions).all(axis=(1, 2))
    view = np.full(positions.shape, np.nan)
    if known.any():
        height = body_height(positions[known])
        view[known] = [three_quarter_view(body[None])[0] / height for body in positions[known]]
        view[known, :, 1] -= view[known, :, 1].min(axis=1, keepdims=True)
        view[known, :, 0] -= (
            view[known, :, 0].min(axis=1, keepdims=True) + view[known, :, 0].max(axis=1, keepdims=True)
        ) / 2
    return view


def draw_strip(
    sheet: Sheet, left: float, top: float, width: float, height: float, positions: FloatArray,
    room: int | None = None,
) -> None:  # fmt: skip
    """Draw the moments of a motion from left to right, left limbs blue, right limbs orange.

    Args:
        sheet: drawn on.
        left: inches from the left of the sheet; `top`, `width` and `height` likewise.
        positions: [n, 21, 3] moments of one motion, metres, y up.
        room: how many moments the width is meant for, if not n, so that strips keep one scale.
    """
    view = three_quarter_view(positions) / body_height(positions)
    low, high = min(-0.12, view[..., 1].min() - 0.03), max(1.3, view[..., 1].max() + 0.1)
    scale = min(width / ((room or len(view)) * APART + 2 * MARGIN - APART), height / (high - low))
    ground = top + height + low * scale
    places = left + (MARGIN + np.arange(len(view)) * APART) * scale
    sheet.canvas.plot([left, places[-1] + MARGIN * scale], [ground] * 2, color="#c8c8c8", linewidth=0.8, zorder=1)
    draw_bodies(sheet, view, np.stack([places, np.full(len(view), ground)], axis=-1), scale)


def draw_bodies(sheet: Sheet, view: Float64Array, feet: Float64Array, scale: float, linewidth: float = 1.5) -> None:
    """Draw bodies where they stand.

    Args:
        sheet: drawn on.
        view: [n, 21, 3] as `three_quarter_view` or `postures_view` gives them, in body heights; a body that is not
            finite is left out.
        feet: [n, 2] inches from the left and the top of the sheet, of the ground below each.
        scale: inches of a body height.
        linewidth: of limbs, points.
    """
    drawn = np.isfinite(view).all(axis=(1, 2))
    view, feet = view[drawn], feet[drawn]
    points = np.stack([feet[:, :1] + view[..., 0] * scale, feet[:, 1:] - view[..., 1] * scale], axis=-1)
    sheet.canvas.add_collection(_limbs(points, view[..., 2], linewidth), autolim=False)
    necks, heads = points[:, INDEX["neck"]], points[:, INDEX["head"]]
    crowns = heads + (heads - necks) * 0.25  # the middle of a head is a little beyond its joint
    circles = [Circle((float(x), float(y)), 0.055 * scale) for x, y in crowns]
    sheet.canvas.add_collection(
        PatchCollection(circles, facecolor="white", edgecolor=INK, linewidth=linewidth / 1.5, zorder=3), autolim=False
    )


def body_height(positions: FloatArray) -> float:
    """About the height of a standing body: twice its leg and a bit, whatever its pose."""
    legs = [("hip", "knee"), ("knee", "ankle")]
    lengths = [
        np.linalg.norm(positions[:, INDEX[f"{s}_{a}"]] - positions[:, INDEX[f"{s}_{b}"]], axis=-1).mean()
        for s in ("left", "right")
        for a, b in legs
    ]
    return max(float(np.sum(lengths)) / 2 * 2.05, 1e-3)


def _limbs(points: Float64Array, depth: Float64Array, linewidth: float) -> LineCollection:
    """The bones of each body [n, 21, 2] from far to near (`depth` [n, 21]), so that near ones lie on top."""
    lines, colours = [], []
    for body, far in zip(points, depth, strict=True):
        order = sorted(_BONES, key=lambda bone, far=far: -(far[bone[0]] + far[bone[1]]))  # type: ignore[misc]
        lines += [body[[i, parent]] for i, parent in order]
        colours += [_colour(JOINTS[i]) for i, _ in order]
    return LineCollection(lines, colors=colours, linewidths=linewidth, capstyle="round", zorder=2)


def _colour(joint: str) -> tuple[float, float, float]:
    if joint.startswith("left"):
        return to_rgb(LEFT)
    return to_rgb(RIGHT if joint.startswith("right") else INK)
