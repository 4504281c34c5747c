"""How far a generated motion is from the recorded one (section 4.3.3 of the thesis).

Errors (tables 4.1 to 4.3) compare poses as `body_poses` gives them, hips at the origin and facing one way, in the unit
of the joints and in real time; or at sparse poses as the thesis has them, in body lengths (`sparse_poses`). The thesis
leaves its unit open (bones are normalised) and uses other data, so its numbers do not compare with these.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray
from motionlake.evaluation.synthesis.trials import Trial, poses_at
from motionlake.glogen.sparse import uniform_places
from motionlake.glogen.trajectories import body_motion
from motionlake.motion.resampling import TOLERANCE, interpolated
from motionlake.motion.skeleton import body_poses

MILLISECONDS: Final = (80, 160, 240, 320, 400, 480, 560, 640)
SPARSE: Final = 15  # poses that GloGen makes (section 4.3.5)
MM: Final = 1000.0


def sparse_poses(positions: FloatArray, fps: float) -> Float64Array:
    """[15, 20, 3] joints of a motion [F, 21, 3] at equal moved distances, its last frame among them (section 4.3.2).

    Seen from the body, of the standard skeleton, in body lengths (`trajectories`): neither timing nor the size
    of the body counts.

    Raises:
        ValueError: fewer than two frames.
    """
    motion = body_motion(positions.astype(np.float64), fps)
    places = uniform_places(motion, SPARSE + 1)[1:]
    return interpolated(motion.joints.reshape(len(motion), -1), places).reshape(SPARSE, -1, 3)


def pose_errors(made: Float64Array, true: Float64Array) -> tuple[float, float]:
    """Mean per-joint error and Euclidean distance of poses [F, J, 3], in the unit of the joints.

    The former is the mean distance of a joint, the latter that of poses as vectors of 3 J numbers.

    Raises:
        ValueError: arrays of different shapes.
    """
    if made.shape != true.shape:
        raise ValueError(f"poses of shapes {made.shape} and {true.shape} cannot be compared")
    apart = made - true
    whole = apart.reshape(len(apart), -1)
    return float(np.linalg.norm(apart, axis=-1).mean()), float(np.linalg.norm(whole, axis=-1).mean())


def errors_at(
    made: Float64Array, true: Float64Array, fps: float, milliseconds: Sequence[int] = MILLISECONDS
) -> Float64Array:
    """Errors of the pose at real times after the seed (table 4.3), between frames by linear interpolation.

    Args:
        made: [F, 21, 3] joints in the world or seen from the body; frame 0 is 1 / fps after the seed's last pose.
        true: [G, 21, 3] likewise.
        fps: frames a second of both.
        milliseconds: [t] after the seed's last pose.

    Returns:
        [t, 2] `pose_errors`; NaN where either motion is over.
    """
    at = np.array(milliseconds) / 1000 * fps - 1
    there = (at >= -TOLERANCE) & (at <= min(len(made), len(true)) - 1 + TOLERANCE)
    found = np.full((len(at), 2), np.nan)
    pairs = zip(*(poses_at(body_poses(each), at[there]) for each in (made, true)), strict=True)
    found[there] = np.reshape([pose_errors(a[None], b[None]) for a, b in pairs], (-1, 2))
    return found


def errors(trials: Sequence[Trial]) -> dict[str, Any]:
    """Errors of motions that go on from a clip in its own class, against what really follows; as `--json` prints it."""
    still = [np.repeat(trial.seed.last_pose[None], len(trial.real.after), axis=0) for trial in trials]
    return {**_errors([trial.made.positions for trial in trials], trials), "zero_velocity": _errors(still, trials)}


def _errors(made: Sequence[Float64Array], trials: Sequence[Trial]) -> dict[str, Any]:
    """Means over trials; in millimetres, but for sparse poses (body lengths)."""
    dense, sparse, timed = [], [], []
    for positions, trial in zip(made, trials, strict=True):
        after, fps = trial.real.after, trial.real.fps
        count = min(len(positions), len(after))
        pair = positions[:count], after[:count]
        dense.append(pose_errors(*map(body_poses, pair)))
        sparse.append(pose_errors(*(sparse_poses(each, fps) for each in pair)))
        timed.append(errors_at(positions, after, fps))
    at = np.stack(timed) * MM
    known = np.isfinite(at[..., 0]).sum(axis=0)
    joint_ms, euclidean_ms = (np.nansum(at, axis=0) / np.where(known, known, np.nan)[:, None]).T
    joint, euclidean = (np.mean(dense, axis=0) * MM).tolist()
    sparse_joint, sparse_euclidean = np.mean(sparse, axis=0).tolist()
    return {
        "mean_per_joint_error": joint,
        "euclidean": euclidean,
        "sparse": {"mean_per_joint_error": sparse_joint, "euclidean": sparse_euclidean},
        "errors_ms": _by_time(joint_ms),
        "euclidean_ms": _by_time(euclidean_ms),
        "n_ms": {str(time): int(n) for time, n in zip(MILLISECONDS, known, strict=True)},
    }


def _by_time(values: Float64Array) -> dict[str, float | None]:
    return {str(t): float(v) if np.isfinite(v) else None for t, v in zip(MILLISECONDS, values, strict=True)}
