"""How one motion moves: energy, travel, jerk, bones, and how its path turns.

Motions are joints [F, 21, 3] in metres, y up. Recorded clips are measured in the same way at the same rate; only the
comparison means something.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray
from motionlake.motion.skeleton import INDEX, PARENTS, body_poses
from scipy.ndimage import uniform_filter1d

SPAN: Final = 0.1  # seconds over which speeds of joints are taken, so that jitter of sensors counts little
SHORTEST: Final = 0.01  # metres; shorter bones are those a rig lacks
STEP: Final = 1.0  # seconds
STRIDE: Final = 0.5  # metres of path from one heading to the next
LEAST_PATH: Final = 1.0  # metres; a body that goes no further has no path that turns


def energy_windows(positions: FloatArray, fps: float) -> Float64Array:
    """[w] m²/s²: mean squared speed of the joints seen from the body (`body_poses`) over every second of a motion.

    Speeds are taken over a tenth of a second. Window i begins at frame i; a motion shorter than a second is one window.

    Raises:
        ValueError: fewer than two frames.
    """
    return _means(_squared_speeds(positions, fps), fps)


def energy(positions: FloatArray, fps: float) -> float:
    """Mean squared speed of the joints seen from the body, m²/s².

    Raises:
        ValueError: fewer than two frames.
    """
    return float(_squared_speeds(positions, fps).mean())


def _squared_speeds(positions: FloatArray, fps: float) -> Float64Array:
    if len(positions) < 2:
        raise ValueError("a motion of one frame has no speed")
    poses = body_poses(positions)[:, 1:]
    step = min(max(1, round(SPAN * fps)), len(poses) - 1)
    speeds = np.linalg.norm(poses[step:] - poses[:-step], axis=-1) * (fps / step)
    return np.asarray(np.square(speeds).mean(axis=1))


def _means(rows: Float64Array, fps: float) -> Float64Array:
    width = min(max(1, round(STEP * fps)), len(rows))
    return np.asarray(np.lib.stride_tricks.sliding_window_view(rows, width).mean(axis=1))


def travel_windows(positions: FloatArray, fps: float) -> Float64Array:
    """[w] metres a second between the hips' places on the ground one second apart; window i begins at frame i.

    A body that sways in place, or from side to side as it walks, does not travel by it. A shorter motion is taken from
    its first to its last frame.

    Raises:
        ValueError: fewer than two frames.
    """
    if len(positions) < 2:
        raise ValueError("a motion of one frame does not travel")
    root = _root(positions)
    step = min(max(1, round(STEP * fps)), len(root) - 1)
    return np.asarray(np.linalg.norm(root[step:] - root[:-step], axis=1) * fps / step)


def travel_speed(positions: FloatArray, fps: float) -> float:
    """Mean of `travel_windows`."""
    return float(travel_windows(positions, fps).mean())


def jerk(positions: FloatArray, fps: float) -> Float64Array:
    """[F - 3] m/s³: third differences of the joints in the world, mean over the joints; none of fewer frames."""
    third = np.diff(positions.astype(np.float64), n=3, axis=0) * fps**3
    return np.asarray(np.linalg.norm(third, axis=2).mean(axis=1))


def path_turns(positions: FloatArray, fps: float) -> tuple[float, float] | None:
    """Turns a metre of the hips' path on the ground: by how much its heading changes, and the same with its sign.

    The first counts a turn to the left and one to the right as two, in the second they make up for one another: a path
    in circles has both alike. Sway is taken out by a mean over one second, headings are those of stretches of half a
    metre.

    Returns:
        None where the path is shorter than a metre.
    """
    root = uniform_filter1d(_root(positions), max(1, round(STEP * fps)), axis=0, mode="nearest")
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(root, axis=0), axis=1))])
    if way[-1] < LEAST_PATH:
        return None
    stops = np.arange(0, way[-1] + 1e-9, STRIDE)
    steps = np.diff(np.stack([np.interp(stops, way, each) for each in root.T], axis=1), axis=0)
    heading = np.arctan2(steps[:, 0], steps[:, 1])
    turned = (np.diff(heading) + np.pi) % (2 * np.pi) - np.pi
    metres = STRIDE * max(1, len(turned))
    return float(np.abs(turned).sum() / (2 * np.pi * metres)), float(abs(turned.sum()) / (2 * np.pi * metres))


def bone_length_drift(positions: FloatArray, rest_offsets: FloatArray | None = None) -> float:
    """The largest relative deviation of a bone's length over the frames, in per cent.

    From the length in `rest_offsets` [21, 3], or in the first frame. Bones below a centimetre are left out.
    """
    children = [joint for joint, parent in enumerate(PARENTS) if parent >= 0]
    joints = positions.astype(np.float64)
    lengths = np.linalg.norm(joints[:, children] - joints[:, [PARENTS[joint] for joint in children]], axis=-1)
    known = lengths[0] if rest_offsets is None else np.linalg.norm(rest_offsets[children].astype(np.float64), axis=-1)
    kept = known > SHORTEST
    return 100 * float(np.max(np.abs(lengths[:, kept] / known[kept] - 1), initial=0.0))


def _root(positions: FloatArray) -> Float64Array:
    """[F, 2] the hips on the ground."""
    return np.asarray(positions[:, INDEX["hips"]][:, [0, 2]], dtype=np.float64)
