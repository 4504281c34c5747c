"""Whether a body stands on the ground without sliding, sinking or floating, seen from its joints alone.

Contacts are found otherwise than by what makes motion (`glogen.feet` and `glogen.trajectories`: a foot stands that is
slower than .4 body lengths a second and lower than .06, then it is held; one that travels is lifted by up to .025).
Here no speed says that a foot stands: the ground bears a body that does not fall freely (`FALLS`), and of all points of
both feet that are near the ground (`NEAR`, so wide that a foot which is lifted is still near) the slowest bears it. The
body slides where even that point travels (`SLIDES`). So holding a foot helps only where it truly stays, and lifting one
that swings changes little. `SLIDES` was chosen on hdm05, utd_mhad and bandai1, where 19 of 20 frames at least do not
slide by it. `NEAR` and `FALLS` were chosen so that lifted feet of real clips (`bench.glogen.controls`) slide about as
much as before, on walks, runs and dances of CMU too, which are measured by it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray
from motionlake.motion.features import body_length
from motionlake.motion.ground import FEET, Ground
from motionlake.motion.runs import runs

NEAR: Final = 0.07  # body lengths above the ground: a foot that may bear the body
FALLS: Final = 3.0  # metres a square second, downwards, of the mean of the joints over about 0.13 s
REACH: Final = 2  # frames at 30 a second, on either side, over which that is taken
AIRBORNE: Final = 0.04  # body lengths above the ground: a foot that is off it, 5 cm where leg and torso measure 1.3 m
FLESH: Final = 0.12  # likewise of joints that are no feet: a hip or a shoulder that lies on the ground
SLIDES: Final = 0.3  # body lengths a second
SUNK: Final = 0.03  # metres below the ground


@dataclass(frozen=True)
class Footing:
    """How a motion stands on the ground.

    Attributes:
        skates: share of the frames in which the ground bears the body in which it slides; 0 where there are none.
        slide: metres a second, the speed of the point that bears, mean over these frames.
        contact: share of frames in which the ground bears the body.
        depth: metres that the lowest joint is below the ground, at most.
        sunk: share of frames in which it is deeper than 3 cm.
        airborne: seconds, the longest time in which no joint is near the ground.
        height: metres that the lowest joint is above the ground, at most.
    """

    skates: float
    slide: float
    contact: float
    depth: float
    sunk: float
    airborne: float
    height: float


def acceleration(positions: Float64Array, fps: float) -> Float64Array:
    """[F] metres a square second upwards of the mean of the joints; 0 within `REACH` of either end."""
    height, reach = positions[..., 1].mean(axis=1), max(1, round(REACH * fps / 30))
    found = np.zeros(len(height))
    if len(height) > 2 * reach:
        second = height[2 * reach :] - 2 * height[reach:-reach] + height[: -2 * reach]
        found[reach:-reach] = second * (fps / reach) ** 2
    return found


def bearing(positions: FloatArray, fps: float, ground: Ground) -> Float64Array:
    """[F] metres a second at which the point that bears the body travels, in each frame of a motion [F, 21, 3]; NaN
    where the ground does not bear it.

    Raises:
        ValueError: fewer than two frames, or a body without size.
    """
    if len(positions) < 2:
        raise ValueError("feet slide from one frame to the next: one frame tells nothing")
    joints = positions.astype(np.float64)
    feet, heights = joints[:, FEET], _heights(joints, ground)
    frames = np.arange(len(joints))
    before, after = np.maximum(frames - 1, 0), np.minimum(frames + 1, len(joints) - 1)
    moved = (feet[after] - feet[before])[..., [0, 2]] * (fps / (after - before))[:, None, None, None]
    near = heights < NEAR * body_length(joints)
    speed = np.where(near, np.linalg.norm(moved, axis=-1), np.inf).reshape(len(joints), -1).min(axis=1)
    return np.where(np.isfinite(speed) & (acceleration(joints, fps) > -FALLS), speed, np.nan)


def _heights(joints: Float64Array, ground: Ground) -> Float64Array:
    """[F, 2, 2] metres that ankles and toes, left and right, are above where they are when they stand."""
    return np.stack([ground.above(joints[:, feet], kind) for kind, feet in enumerate(FEET)], axis=1)


def footing(positions: FloatArray, fps: float, ground: Ground) -> Footing:
    """How a motion [F, 21, 3] stands on the ground of the recording that it belongs to or goes on from.

    Raises:
        ValueError: as `bearing`.
    """
    bears = bearing(positions, fps, ground)
    bears = bears[np.isfinite(bears)]
    joints = positions.astype(np.float64)
    size, heights = body_length(joints), _heights(joints, ground)
    others = [joint for joint in range(joints.shape[1]) if joint not in np.ravel(FEET)]
    rest = ground.above(joints[:, others], 1).min(axis=1)
    lowest = np.minimum(heights.reshape(len(joints), -1).min(axis=1), rest)
    away = (heights > AIRBORNE * size).all(axis=(1, 2)) & (rest > FLESH * size)
    return Footing(
        skates=float((bears > SLIDES * size).mean()) if len(bears) else 0.0,
        slide=float(bears.mean()) if len(bears) else 0.0,
        contact=len(bears) / len(joints),
        depth=max(0.0, -float(lowest.min())),
        sunk=float((lowest < -SUNK).mean()),
        airborne=max((stop - start for start, stop in runs(away)), default=0) / fps,
        height=max(0.0, float(lowest.max())),
    )
