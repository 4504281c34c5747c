"""The ground that a recorded body stands on, as its feet tell of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray
from motionlake.motion.rotations import multiply, rotate, swing
from motionlake.motion.skeleton import INDEX

SIDES: Final = ("left", "right")
KINDS: Final = ("ankle", "toe")
FEET: Final = tuple(tuple(INDEX[f"{side}_{kind}"] for side in SIDES) for kind in KINDS)
QUANTILE: Final = 0.05  # over time, of the height of the lower foot: the ground
MOST: Final = 300  # frames, by about which a ground is found
LEVEL: Final = 0.01  # weight of the penalty on slopes
STEEPEST: Final = 0.05  # metres a metre


@dataclass(frozen=True, eq=False)
class Ground:
    """What a recorded body stands on: a plane, since floors of some recordings are tilted (walks of CMU by 2 %).

    Attributes:
        heights: [2] metres of ankle and of toe joints of a foot that stands at the origin.
        slope: [2] metres a metre, towards x and towards z.
    """

    heights: Float64Array
    slope: Float64Array

    def above(self, joints: Float64Array, kind: int) -> Float64Array:
        """[...] metres that joints [..., 3] are above where those of a kind (of `KINDS`) are when they stand."""
        return np.asarray(joints[..., 1] - self.heights[kind] - joints[..., [0, 2]] @ self.slope)

    def level_at(self, place: FloatArray) -> Ground:
        """A level ground that is as high as this one at a place [3]: what made motion goes on on."""
        return Ground(self.heights + float(place[[0, 2]] @ self.slope), np.zeros(2))

    def below(self, place: FloatArray) -> Float64Array:
        """[3] the point where toes that stand below a place [3] are."""
        return np.array([place[0], self.heights[KINDS.index("toe")] + float(place[[0, 2]] @ self.slope), place[2]])

    def levelling(self) -> Float64Array:
        """[4] the rotation (w, x, y, z) that makes it level."""
        across = np.array([-self.slope[0], 1.0, -self.slope[1]])
        return swing(across / np.linalg.norm(across), np.array([0.0, 1.0, 0.0]))


def ground_of(positions: FloatArray) -> Ground:
    """The ground of a whole recording [F, 21, 3]: the plane below which the lower ankle is 5 % of the time.

    Toes likewise: rigs differ in how high these lie above the sole. The slope is that of quantile regression with an L1
    penalty: none where a body hardly goes about.
    """
    from sklearn.linear_model import QuantileRegressor

    every = max(1, len(positions) // MOST)
    feet = positions[::every][:, FEET].astype(np.float64)
    lower = np.take_along_axis(feet, feet[..., 1].argmin(axis=2)[..., None, None], axis=2)[:, :, 0]  # [F, 2, 3]
    heights = np.quantile(lower[..., 1], QUANTILE, axis=0)
    places, apart = lower[..., [0, 2]].reshape(-1, 2), (lower[..., 1] - heights).ravel()
    middle = places.mean(axis=0)
    fit = QuantileRegressor(quantile=QUANTILE, alpha=LEVEL).fit(places - middle, apart)
    slope = np.clip(np.asarray(fit.coef_, dtype=np.float64), -STEEPEST, STEEPEST)
    return Ground(np.quantile(lower[..., 1] - lower[..., [0, 2]] @ slope, QUANTILE, axis=0), slope)


def standing_level(positions: Float64Array, rotations: Float64Array, at: int) -> tuple[Float64Array, Float64Array]:
    """A recording turned as a whole, so that the ground its feet tell of is level; feet stay in place in frame `at`."""
    ground = ground_of(positions)
    return levelled(positions, rotations, ground, ground.below(positions[at, 0]))


def levelled(
    positions: Float64Array, rotations: Float64Array, ground: Ground, about: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """A motion turned as a whole, so that its ground is level.

    Args:
        positions: [F, 21, 3] metres.
        rotations: [F, 21, 4] local.
        ground: of the whole recording.
        about: [3] the point that stays where it is.
    """
    if not ground.slope.any():
        return positions, rotations
    turn, turned = ground.levelling(), rotations.copy()
    turned[:, 0] = multiply(turn, rotations[:, 0])
    return rotate(turn, positions - about) + about, turned
