"""Small stick figures as SVG, to stand in a line of HTML."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray
from motionlake.motion.skeleton import INDEX
from motionlake.pictures.stick_figures import (
    APART,
    BONES,
    MARGIN,
    SIDES,
    body_height,
    spread,
    three_quarter_view,
)
from motionlake.pictures.style import INK

MOMENTS: Final = 6
HEIGHT: Final = 60  # pixels
_BELOW: Final = 0.12  # body heights below the ground
_ABOVE: Final = 0.1
_HEAD: Final = 0.055


def stick_figures(positions: FloatArray, moments: int = MOMENTS, height: int = HEIGHT) -> str:
    """An SVG element with moments of a motion from left to right, left limbs blue, right limbs orange.

    Args:
        positions: [F, 21, 3] metres, y up; F at least 1.
        moments: how many figures.
        height: pixels of the element.
    """
    bodies = spread(np.asarray(positions, np.float32), moments)
    view = three_quarter_view(bodies) / body_height(bodies)
    low, high = min(-_BELOW, float(view[..., 1].min())), max(1.3, float(view[..., 1].max()) + _ABOVE)
    scale = height / (high - low)
    width = round(((moments - 1) * APART + 2 * MARGIN) * scale)
    feet = (MARGIN + np.arange(moments) * APART)[:, None]
    points = np.stack([view[..., 0] + feet, high - view[..., 1]], axis=-1) * scale
    ground = f"M0 {high * scale:.1f}H{width}"
    limbs = "".join(_path(_limbs(points, colour), colour) for colour in dict.fromkeys(SIDES))
    crowns = points[:, INDEX["head"]] + (points[:, INDEX["head"]] - points[:, INDEX["neck"]]) * 0.25
    heads = "".join(
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{_HEAD * scale:.1f}" fill="#fff" stroke="{INK}"/>' for x, y in crowns
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="{moments} moments of the motion" '
        f'width="{width}" height="{height}" viewBox="0 0 {width} {height}" style="background:#fff">'
        f"{_path(ground, '#c8c8c8')}{limbs}{heads}</svg>"
    )


def _limbs(points: Float64Array, colour: str) -> str:
    """The bones of one colour of all bodies [n, 21, 2] as the steps of a path."""
    bones = [(joint, parent) for joint, parent in BONES.tolist() if SIDES[joint] == colour]
    return "".join(
        f"M{body[parent, 0]:.1f} {body[parent, 1]:.1f}L{body[joint, 0]:.1f} {body[joint, 1]:.1f}"
        for body in points
        for joint, parent in bones
    )


def _path(steps: str, colour: str) -> str:
    return f'<path d="{steps}" fill="none" stroke="{colour}" stroke-width="1.5" stroke-linecap="round"/>'
