"""Feet that stand stay where they are, feet that swing clear the ground: legs bend for it, the rest of the body stays.

Standing feet have held the root before (`motion.in_world`). What is left, of two feet that stand at a time and of feet
that a network has swing too low, hip and knee take (inverse kinematics of two bones).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.skeleton import INDEX
from motionlake.motion.standing import SIDES, staying
from motionlake.motion.two_bones import bent, level_ahead
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

PARTS: Final = ("ankle", "toe")
STANDS: Final = 0.5
FAR: Final = 0.08  # body lengths; a foot that wanders further while it stands is turned or dragged on purpose
BLEND: Final = 6  # frames, over which a foot comes to where it stands and leaves it
# A foot as slow as the first may be on the ground, one as fast as the second clears it: body lengths a second, and body
# lengths. Of recorded dances (salsa of cmu_dance) nine tenths of such fast ankles and toes are that high.
SLOW: Final = 0.3
FAST: Final = 1.2
CLEAR: Final = 0.025
SMOOTH: Final = 1.5  # frames
GROUND: Final = 0.05  # quantile over time of the height of the lower foot


def planted(joints: Float64Array, stands: Float64Array, size: float, fps: float) -> Float64Array:
    """Joints of a body whose feet are planted.

    Args:
        joints: [T, 21, 3] in the world, metres, y up.
        stands: [T, 2] how surely the left and the right foot stands, 0 to 1. Where no foot ever does, nothing is known
            of a ground, and the joints stay as they are.
        size: of the body (`body.body_length`), metres.
        fps: frames a second.

    Returns:
        [T, 21, 3]: knees, ankles and toes differ, their bones are as long as before.
    """
    if len(joints) < 2 or not (stands > STANDS).any():
        return joints
    rows = {side: [INDEX[f"{side}_{part}"] for part in PARTS] for side in SIDES}
    heights = np.minimum(*(joints[:, rows[side], 1] for side in SIDES))
    grounds = np.quantile(heights, GROUND, axis=0)  # rigs differ in how high ankle and toe lie above the sole
    ahead = level_ahead(joints[:, INDEX["left_hip"]], joints[:, INDEX["right_hip"]])
    done = joints.copy()
    for side, standing in zip(SIDES, stands.T, strict=True):
        hip, knee = INDEX[f"{side}_hip"], INDEX[f"{side}_knee"]
        ankle, toe = rows[side]
        change = staying(joints[:, rows[side]], standing > STANDS, FAR * size, BLEND)
        change[:, 1] = _lift(joints[:, rows[side]] + change[:, None], grounds, size, fps)
        done[:, knee], done[:, ankle] = bent(
            joints[:, hip], joints[:, knee], joints[:, ankle], joints[:, ankle] + change, ahead
        )
        done[:, toe] += done[:, ankle] - joints[:, ankle]
    return done


def _lift(foot: Float64Array, grounds: Float64Array, size: float, fps: float) -> Float64Array:
    """[T] by which a foot [T, 2, 3] is too low for how fast it travels."""
    speed = np.linalg.norm(np.gradient(foot[..., [0, 2]], axis=0), axis=2) * fps / size
    wanted = CLEAR * size * np.clip((speed - SLOW) / (FAST - SLOW), 0, 1)
    missing = np.maximum(wanted - (foot[..., 1] - grounds), 0).max(axis=1)
    lift: Float64Array = gaussian_filter1d(maximum_filter1d(missing, 3), SMOOTH)
    return lift
