"""How far a made motion is from the true one (section 4.3.3 of the thesis, tables 4.1 to 4.3).

Poses are compared as `body_poses` gives them, hips at the origin and facing one way, in the unit of the joints and in
real time; or at sparse poses as the thesis has them, in body lengths (`sparse_poses`). The thesis leaves its unit open
(bones are normalised), and its data are others: its figures do not compare with these.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray
from motionlake.glogen.sparse import uniform_places
from motionlake.glogen.trajectories import body_motion, interpolated
from motionlake.motion.skeleton import facing

MILLISECONDS: Final = (80, 160, 240, 320, 400, 480, 560, 640)
SPARSE: Final = 15  # poses that GloGen makes (section 4.3.5)


def body_poses(positions: FloatArray) -> Float64Array:
    """[F, 21, 3] joints seen from the body: hips at the origin, every frame turned to face +z."""
    joints = positions.astype(np.float64) - positions[:, :1]
    yaw = facing(positions)[:, None]
    cos, sin = np.cos(yaw), np.sin(yaw)
    x, y, z = joints[..., 0], joints[..., 1], joints[..., 2]
    return np.stack([cos * x - sin * z, y, sin * x + cos * z], axis=-1)


def joint_error(made: Float64Array, true: Float64Array) -> float:
    """Mean per-joint error: mean Euclidean distance of a joint over poses [F, J, 3].

    Raises:
        ValueError: no poses, or arrays of different shapes.
    """
    return float(np.linalg.norm(_difference(made, true), axis=-1).mean())


def euclidean_error(made: Float64Array, true: Float64Array) -> float:
    """Euclidean distance of poses [F, J, 3] as vectors of 3 J numbers, mean over poses.

    Raises:
        ValueError: no poses, or arrays of different shapes.
    """
    return float(np.linalg.norm(_difference(made, true).reshape(len(made), -1), axis=-1).mean())


def _difference(made: Float64Array, true: Float64Array) -> Float64Array:
    if made.shape != true.shape or made.ndim != 3 or not len(made):
        raise ValueError(f"poses of shapes {made.shape} and {true.shape} cannot be compared")
    return np.asarray(made - true, dtype=np.float64)


def poses_at(poses: Float64Array, fps: float, seconds: float) -> Float64Array | None:
    """[J, 3] the pose so long after the one that a motion follows, between frames by linear interpolation.

    Args:
        poses: [F, J, 3]; frame 0 is 1 / fps after the last pose of the seed, frame k is (k + 1) / fps after it.
        fps: frames a second.
        seconds: since the last pose of the seed.

    Returns:
        None where the motion has no such moment.
    """
    at = seconds * fps - 1
    if not -1e-9 <= at <= len(poses) - 1 + 1e-9:
        return None
    before = int(np.clip(np.floor(at + 1e-9), 0, max(0, len(poses) - 2)))
    after = min(before + 1, len(poses) - 1)
    share = np.clip(at - before, 0.0, 1.0)
    return np.asarray((1 - share) * poses[before] + share * poses[after])


def errors_at(
    made: Float64Array, true: Float64Array, fps: float, milliseconds: Sequence[int] = MILLISECONDS
) -> Float64Array:
    """Error of the pose at real times after the seed (table 4.3).

    Args:
        made: [F, 21, 3] joints in the world or seen from the body; frame 0 is 1 / fps after the seed's last pose.
        true: [G, 21, 3] likewise.
        fps: frames a second of both.
        milliseconds: [t] after the seed's last pose.

    Returns:
        [t, 2] mean per-joint error and Euclidean distance, in the unit of the joints; NaN where either motion is over.
    """
    poses = body_poses(made), body_poses(true)
    found = np.full((len(milliseconds), 2), np.nan)
    for row, time in zip(found, milliseconds, strict=True):
        pair = [poses_at(each, fps, time / 1000) for each in poses]
        if pair[0] is not None and pair[1] is not None:
            row[:] = joint_error(pair[0][None], pair[1][None]), euclidean_error(pair[0][None], pair[1][None])
    return found


def sparse_poses(positions: FloatArray, fps: float, count: int = SPARSE) -> Float64Array:
    """[count, 20, 3] joints of a motion [F, 21, 3] at equal moved distances, its last frame among them (section 4.3.2).

    Seen from the body, of the standard skeleton, in body lengths (`trajectories`): neither timing nor the size
    of the body counts.

    Raises:
        ValueError: fewer than two frames.
    """
    motion = body_motion(positions.astype(np.float64), fps)
    places = uniform_places(motion, count + 1)[1:]
    return interpolated(motion.joints.reshape(len(motion), -1), places).reshape(count, -1, 3)
