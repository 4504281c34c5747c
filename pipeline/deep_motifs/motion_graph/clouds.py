"""Distance of short windows of frames as clouds of joints, after the best alignment on the ground.

The distance of Kovar, Gleicher and Pighin, "Motion Graphs" (2002): the clouds of two windows are compared
joint by joint and frame by frame, so that velocities count as poses do, after the turn about the vertical and
the shift on the ground that bring them closest. With clouds centred on the ground the best turn has a closed
form, and what is left are three matrix products.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.motion.canonical import COMMON, INDEX
from motionlake.motion.facing import facing
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]
JOINTS: Final = tuple(INDEX[name] for name in COMMON)


@dataclass(frozen=True)
class Clouds:
    """The windows of one clip or of several; n windows, P = joints x frames points each.

    Attributes:
        ground: [n, 2 P] x then z of the points, centred on the ground.
        height: [n, P] y of the points.
        norm: [n] sum of the squares of both.
    """

    ground: Float64Array
    height: Float64Array
    norm: Float64Array

    def __len__(self) -> int:
        return len(self.norm)

    @property
    def points(self) -> int:
        return int(self.height.shape[1])

    def at(self, rows: NDArray[np.integer] | slice) -> Clouds:
        return Clouds(self.ground[rows], self.height[rows], self.norm[rows])


def window_clouds(positions: Float64Array, window: int) -> Clouds:
    """Clouds of the windows that start at each frame.

    Args:
        positions: [T, 21, 3] canonical joints, metres, y up.
        window: frames.

    Returns:
        max(0, T - window + 1) clouds. Each is turned to where its first frame faces: the distance does not
        depend on it, but so the numbers hardly depend on where and which way a clip was recorded.
    """
    if len(positions) < window:
        points = window * len(JOINTS)
        return Clouds(np.zeros((0, 2 * points)), np.zeros((0, points)), np.zeros(0))
    n = len(positions) - window + 1
    views = np.lib.stride_tricks.sliding_window_view(positions[:, list(JOINTS)], window, axis=0)
    cloud = views.transpose(0, 3, 1, 2).reshape(n, -1, 3).astype(np.float64)
    x, y, z = cloud[..., 0], cloud[..., 1], cloud[..., 2]
    x, z = x - x.mean(axis=1, keepdims=True), z - z.mean(axis=1, keepdims=True)
    angles = facing(positions)[:n, None]
    cos, sin = np.cos(angles), np.sin(angles)
    ground = np.concatenate([cos * x - sin * z, sin * x + cos * z], axis=1)
    return Clouds(ground, y, np.einsum("ij,ij->i", ground, ground) + np.einsum("ij,ij->i", y, y))


def joined(clouds: list[Clouds]) -> Clouds:
    """All windows of several clips, one after the other."""
    return Clouds(
        np.concatenate([c.ground for c in clouds]),
        np.concatenate([c.height for c in clouds]),
        np.concatenate([c.norm for c in clouds]),
    )


def quarter_turned(ground: Float64Array) -> Float64Array:
    """Centred ground points turned by 90 degrees about the vertical: (x, z) becomes (z, -x)."""
    x, z = np.split(ground, 2, axis=1)
    return np.concatenate([z, -x], axis=1)


def paired_distance(a: Clouds, b: Clouds) -> Float64Array:
    """[n] distance in metres of each window of `a` from the same row of `b`, root mean square over the points."""
    along = np.einsum("ij,ij->i", a.ground, b.ground)
    across = np.einsum("ij,ij->i", a.ground, quarter_turned(b.ground))
    heights = np.einsum("ij,ij->i", a.height, b.height)
    squares = a.norm + b.norm - 2 * (heights + np.hypot(along, across))
    return np.asarray(np.sqrt(np.maximum(squares, 0.0) / a.points), dtype=np.float64)


def squared_distances(a: Clouds, b: Clouds) -> NDArray[np.float32]:
    """[n, m] squares of the distances of all windows of `a` from all of `b`, in single precision."""
    left, right = a.ground.astype(np.float32), b.ground.astype(np.float32)
    turned = quarter_turned(b.ground).astype(np.float32)
    along = left @ right.T
    across = left @ turned.T
    np.hypot(along, across, out=along)
    along += a.height.astype(np.float32) @ b.height.astype(np.float32).T
    along *= -2
    along += a.norm.astype(np.float32)[:, None]
    along += b.norm.astype(np.float32)[None]
    along /= a.points
    return along
