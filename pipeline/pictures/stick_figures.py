"""Bodies: read from a lake, turned to face the reader, drawn as stick figures."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from functools import lru_cache
from typing import Final

import numpy as np
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.patches import Circle
from motionlake.arrays import Float32Array, Float64Array, FloatArray
from motionlake.columns import matrix_of
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.frames import POSITION_CHANNELS, ROOT_CHANNELS, read_rows
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.motion.rotations import turn_on_ground
from motionlake.motion.skeleton import INDEX, JOINTS, PARENTS, facing
from motionlake.pictures.style import INK, Sheet

CACHED: Final = 64
_CHANNELS: Final = (*ROOT_CHANNELS, *POSITION_CHANNELS)
LEFT: Final = "#0072B2"
RIGHT: Final = "#D55E00"
TURN: Final = np.deg2rad(40)  # of the body from facing the viewer to the viewer's right
TILT: Final = np.deg2rad(12)  # of the view, from above
APART: Final = 0.68  # body heights between two figures
MARGIN: Final = 0.45  # body heights before the first and after the last one
BONES: Final = np.array([(i, p) for i, p in enumerate(PARENTS) if p >= 0])
SIDES: Final = [LEFT if j.startswith("left") else RIGHT if j.startswith("right") else INK for j in JOINTS]


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
            path = sound(self._lake, self._lake.frames_part(dataset, part))
            for clip, rows in read_rows(path, members, _CHANNELS):
                found[clip] = matrix_of(rows, _CHANNELS).reshape(rows.num_rows, -1, 3)
        return found


def spread(positions: Float32Array, count: int) -> Float32Array:
    """[count, 21, 3] of [F, 21, 3], from the first frame to the last; frames repeat where there are too few."""
    return np.asarray(positions[np.linspace(0, len(positions) - 1, count).round().astype(int)])


def three_quarter_view(positions: FloatArray) -> Float64Array:
    """Bodies on the page: x to the right, y up, z away from the viewer, metres, the ground at 0.

    The whole strip is turned as one so that its middle moment faces the same way in every picture; each moment
    stands in its own place, so steps do not run it into its neighbour, and heights stay as they were.

    Args:
        positions: [n, 21, 3] moments of one motion, metres, y up.
    """
    points = positions.astype(np.float64) - positions[:, :1] * np.array([1.0, 0.0, 1.0])
    heading = facing(positions)[len(positions) // 2]
    x, z = turn_on_ground(points[..., 0], points[..., 2], TURN - heading)
    y = points[..., 1] - points[..., 1].min()
    return np.stack([x, y * np.cos(TILT) - z * np.sin(TILT), -z * np.cos(TILT) - y * np.sin(TILT)], axis=-1)


def postures_view(positions: FloatArray) -> Float64Array:
    """Postures [n, 21, 3] of several motions, as `three_quarter_view`, in heights of the bodies.

    Each faces the same way and stands on its own ground; a body that is not finite stays so.
    """
    known = np.isfinite(positions).all(axis=(1, 2))
    view = np.full(positions.shape, np.nan)
    if known.any():
        view[known] = [three_quarter_view(body[None])[0] for body in positions[known]]
        view /= body_height(positions[known])
        low, high = view.min(axis=1, keepdims=True), view.max(axis=1, keepdims=True)
        view[..., 0] -= (low[..., 0] + high[..., 0]) / 2
        view[..., 1] -= low[..., 1]
    return view


def body_height(positions: FloatArray) -> float:
    """About the height of a standing body: twice its leg and a bit, whatever its pose."""
    legs = [[INDEX[f"{side}_{joint}"] for joint in ("hip", "knee", "ankle")] for side in ("left", "right")]
    bones = np.linalg.norm(np.diff(positions[:, legs], axis=2), axis=-1).mean(axis=0)
    return max(float(bones.sum()) / 2 * 2.05, 1e-3)


def draw_strip(sheet: Sheet, left: float, top: float, width: float, height: float, positions: FloatArray) -> None:
    """Draw the moments of a motion [n, 21, 3] from left to right into a box, inches."""
    view = three_quarter_view(positions) / body_height(positions)
    low, high = min(-0.12, view[..., 1].min() - 0.03), max(1.3, view[..., 1].max() + 0.1)
    scale = min(width / ((len(view) - 1) * APART + 2 * MARGIN), height / (high - low))
    places = left + (MARGIN + np.arange(len(view)) * APART) * scale
    _draw_on_ground(sheet, left, places[-1] + MARGIN * scale, top + height + low * scale, view, places, scale)


def draw_moments(
    sheet: Sheet, left: float, ground: float, width: float, height: float, positions: FloatArray, most: float
) -> Float64Array:
    """Draw the moments of a motion [n, 21, 3] evenly over a width, as high as `height`, a body at most `most` inches.

    Returns:
        [n] where they stand, inches from the left.
    """
    view = three_quarter_view(positions) / body_height(positions)
    scale = min(most, height / max(1.3, float(view[..., 1].max()) + 0.1))
    places = left + (np.arange(len(view)) + 0.5) * width / len(view)
    _draw_on_ground(sheet, left, left + width, ground, view, places, scale)
    return places


def _draw_on_ground(
    sheet: Sheet, left: float, right: float, ground: float, view: Float64Array, places: Float64Array, scale: float
) -> None:
    sheet.canvas.plot([left, right], [ground] * 2, color="#c8c8c8", linewidth=0.8, zorder=1)
    draw_bodies(sheet, view, places, ground, scale)


def draw_bodies(
    sheet: Sheet, view: Float64Array, x: FloatArray | float, ground: FloatArray | float, scale: float,
    linewidth: float = 1.5,
) -> None:  # fmt: skip
    """Draw bodies where they stand, left limbs blue, right limbs orange.

    Args:
        sheet: drawn on.
        view: [n, 21, 3] in body heights, as `postures_view` gives them; a body that is not finite is left out.
        x: [n] inches from the left, or one for all; `ground` likewise from the top.
        scale: inches of a body height.
        linewidth: of limbs, points.
    """
    feet = np.stack(np.broadcast_arrays(x, ground, np.zeros(len(view)))[:2], axis=-1)
    drawn = np.isfinite(view).all(axis=(1, 2))
    view, feet = view[drawn], feet[drawn]
    points = np.stack([feet[:, :1] + view[..., 0] * scale, feet[:, 1:] - view[..., 1] * scale], axis=-1)
    far_first = np.argsort(-view[:, BONES, 2].sum(axis=-1), axis=1, kind="stable")  # near bones lie on top
    bones = BONES[far_first]
    limbs = points[np.arange(len(points))[:, None, None], bones].reshape(-1, 2, 2)
    colours = np.array(SIDES)[bones[..., 0].ravel()].tolist()
    sheet.canvas.add_collection(
        LineCollection(limbs, colors=colours, linewidths=linewidth, capstyle="round", zorder=2), autolim=False
    )
    necks, heads = points[:, INDEX["neck"]], points[:, INDEX["head"]]
    crowns = heads + (heads - necks) * 0.25  # the middle of a head is a little beyond its joint
    circles = [Circle((float(x), float(y)), 0.055 * scale) for x, y in crowns]
    sheet.canvas.add_collection(
        PatchCollection(circles, facecolor="white", edgecolor=INK, linewidth=linewidth / 1.5, zorder=3), autolim=False
    )
