"""Recorded frames that look like those of another clip: what motion matching prefers where a style is asked for."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.matching.database import MotionDatabase
from motionlake.matching.features import POSE, features
from motionlake.matching.recordings import longest_range, rooted, seed_rotations
from motionlake.motion.generation import SeedClip
from motionlake.motion.ground import standing_level
from scipy.spatial import cKDTree

WEIGHT: Final = 3.0  # of the distance from the style beside that from what is played


def style_costs(database: MotionDatabase, style: SeedClip) -> Float64Array:
    """[2 N] what every row of a database costs: how far its pose and velocities are from the nearest of a style.

    Raises:
        ValueError: the clip of the style is too short.
    """
    if len(style.positions) < 2:
        raise ValueError(f"{style.clip} has one frame; a style needs two at least")
    rotations = seed_rotations(style)
    start, stop = longest_range(style.positions, rotations, style.fps)
    if stop - start < 2:
        start, stop = 0, len(style.positions)
    flat = standing_level(style.positions[start:stop], rotations[start:stop], 0)
    motion = rooted(*flat, style.rest_offsets, style.fps)
    scales = database.scales[:POSE]
    tree = cKDTree(features(motion)[:, :POSE] * scales)
    apart = tree.query(database.compared[:, :POSE] * scales)[0]
    return np.asarray(WEIGHT * (apart - apart.min()), dtype=np.float64)
