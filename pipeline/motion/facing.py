"""Which way a body faces."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.motion.canonical import INDEX
from numpy.typing import NDArray

# A mean left axis (of length 1 at most) whose horizontal part is shorter says nothing of the heading.
MIN_HORIZONTAL: Final = 0.05


def facing(positions: NDArray[np.floating]) -> NDArray[np.float64]:
    """Heading of the body: the angle about +y that turns +z to where it faces.

    The left axis is the mean of the unit vectors right to left hip and right to left shoulder; the body faces
    left x up. Frames in which that axis is near vertical (a body on its side) take the heading of the nearest
    frame in time that has one; 0 where none has.

    Args:
        positions: [F, 21, 3] canonical joint positions, y up.

    Returns:
        [F] radians, continuous in time (unwrapped).
    """
    left = np.zeros((len(positions), 3))
    for joint in ("hip", "shoulder"):
        sides = positions[:, [INDEX[f"left_{joint}"], INDEX[f"right_{joint}"]]].astype(np.float64)
        axis = sides[:, 0] - sides[:, 1]
        left += axis / np.maximum(np.linalg.norm(axis, axis=-1, keepdims=True), 1e-12) / 2
    valid = np.flatnonzero(np.hypot(left[:, 0], left[:, 2]) > MIN_HORIZONTAL)
    if not len(valid):
        return np.zeros(len(positions))
    yaw = np.unwrap(np.arctan2(-left[valid, 2], left[valid, 0]))
    frames = np.arange(len(positions))
    after = np.clip(np.searchsorted(valid, frames), 0, len(valid) - 1)
    before = np.maximum(after - 1, 0)
    nearer = np.where(np.abs(valid[before] - frames) <= np.abs(valid[after] - frames), before, after)
    return np.asarray(yaw[nearer], np.float64)
