"""How far a generated motion is from the recorded one, and whether it could be real (section 4.3.3 of the thesis).

Errors (tables 4.1 to 4.3) compare poses as `body_poses` gives them, hips at the origin and facing one way, in the unit
of the joints and in real time; or at sparse poses as the thesis has them, in body lengths (`sparse_poses`). The thesis
leaves its unit open (bones are normalised) and uses other data, so its numbers do not compare with these.

Measures of movement (feet that stand, bones that keep their length, energy, speed of travel) look at one motion
[F, 21, 3] in metres, y up. Recorded clips are measured in the same way at the same rate; only the comparison means
something.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray
from motionlake.glogen.sparse import uniform_places
from motionlake.glogen.trajectories import body_motion
from motionlake.motion.features import body_length
from motionlake.motion.resampling import beside, interpolated
from motionlake.motion.rotations import turn_about_y
from motionlake.motion.skeleton import INDEX, PARENTS, facing

MILLISECONDS: Final = (80, 160, 240, 320, 400, 480, 560, 640)
SPARSE: Final = 15  # poses that GloGen makes (section 4.3.5)


def body_poses(positions: FloatArray) -> Float64Array:
    """[F, 21, 3] joints seen from the body: hips at the origin, every frame turned to face +z."""
    joints = positions.astype(np.float64) - positions[:, :1]
    return turn_about_y(joints, -facing(positions))


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
    before, after, share = beside(np.asarray(at), len(poses), 1e-9)
    share = np.clip(share, 0.0, 1.0)
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


FEET: Final = (("left_ankle", "right_ankle"), ("left_toe", "right_toe"))
# A joint of a foot lower than this above its ground may stand: 2.5 cm of a person whose leg and torso measure 1.35 m.
LOW: Final = 0.0185  # body lengths
GROUND: Final = 0.05  # quantile over time of the lower foot's height
SPAN: Final = 0.1  # seconds over which speeds of joints are taken, so that jitter of sensors counts little
SHORTEST: Final = 0.01  # metres; shorter bones are those a rig lacks
STEP: Final = 1.0  # seconds


@dataclass(frozen=True)
class FootSliding:
    """How feet move while they are near the ground.

    Attributes:
        speed: metres a second, the horizontal speed weighted by nearness to the ground, mean over all frames.
        contact: share of frames in which a joint of a foot is near the ground.
        standing_speed: metres a second, the horizontal speed weighted by nearness, mean over the weights; 0 where no
            joint is ever near.
    """

    speed: float
    contact: float
    standing_speed: float


def foot_sliding(positions: FloatArray, fps: float) -> FootSliding:
    """Sliding of ankles and toes, as it is measured for neural motion synthesis: v (2 - 2^(h / H)), h from 0 to H.

    v is the horizontal speed of a joint from frame to frame, h its mean height above the ground over both frames, H
    `LOW` body lengths. The ground of the ankles is the 5 % quantile over time of the lower ankle's height, that of the
    toes likewise: rigs differ in how high these joints lie above the sole.

    Raises:
        ValueError: fewer than two frames, or a body without size.
    """
    if len(positions) < 2:
        raise ValueError("feet slide from one frame to the next: one frame tells nothing")
    size = body_length(positions.astype(np.float64))
    speeds, heights = [], []
    for pair in FEET:
        joints = positions[:, [INDEX[name] for name in pair]].astype(np.float64)
        ground = np.quantile(joints[..., 1].min(axis=1), GROUND)
        speeds.append(np.linalg.norm(np.diff(joints[..., [0, 2]], axis=0), axis=-1) * fps)
        heights.append((joints[1:, :, 1] + joints[:-1, :, 1]) / 2 - ground)
    speed, height = np.stack(speeds), np.stack(heights) / (LOW * size)
    weight = 2 - np.exp2(np.clip(height, 0, 1))
    total = float(weight.sum())
    return FootSliding(
        float((speed * weight).mean()), float((height < 1).mean()),
        float((speed * weight).sum()) / total if total > 0 else 0.0,
    )  # fmt: skip


def bone_length_drift(positions: FloatArray, rest_offsets: FloatArray | None = None) -> float:
    """The largest relative deviation of a bone's length over the frames, in per cent.

    From the length in `rest_offsets` [21, 3], or in the first frame. Bones below a centimetre are left out.

    Raises:
        ValueError: no frames.
    """
    if not len(positions):
        raise ValueError("a motion without frames has no bones")
    children = [joint for joint, parent in enumerate(PARENTS) if parent >= 0]
    joints = positions.astype(np.float64)
    lengths = np.linalg.norm(joints[:, children] - joints[:, [PARENTS[joint] for joint in children]], axis=-1)
    known = lengths[0] if rest_offsets is None else np.linalg.norm(rest_offsets[children].astype(np.float64), axis=-1)
    kept = known > SHORTEST
    if not kept.any():
        return 0.0
    return 100 * float(np.max(np.abs(lengths[:, kept] / known[kept] - 1)))


@dataclass(frozen=True)
class Energy:
    """Mean squared speed of the joints seen from the body, square metres a square second.

    Attributes:
        mean: over the whole motion.
        low, high: the least and the greatest mean over one second of it.
    """

    mean: float
    low: float
    high: float


def energy(positions: FloatArray, fps: float, window: float = STEP) -> Energy:
    """How much the joints move, root and facing apart (`body_poses`).

    Speeds are taken over a tenth of a second. A motion shorter than `window` seconds is one window.

    Raises:
        ValueError: fewer than two frames.
    """
    if len(positions) < 2:
        raise ValueError("a motion of one frame has no speed")
    poses = body_poses(positions)[:, 1:]
    step = min(max(1, round(SPAN * fps)), len(poses) - 1)
    speeds = np.linalg.norm(poses[step:] - poses[:-step], axis=-1) * (fps / step)
    squares = np.square(speeds).mean(axis=1)
    width = min(max(1, round(window * fps)), len(squares))
    windows = np.lib.stride_tricks.sliding_window_view(squares, width).mean(axis=1)
    return Energy(float(squares.mean()), float(windows.min()), float(windows.max()))


def within_range(made: Sequence[Energy], real: Sequence[Energy]) -> list[bool]:
    """Of each made motion, whether every second of it has an energy that some second of a real clip has.

    So it freezes nowhere where no real clip does, and nowhere explodes.

    Raises:
        ValueError: no real clips.
    """
    if not real:
        raise ValueError("a range needs real clips")
    low, high = min(each.low for each in real), max(each.high for each in real)
    return [bool(low <= each.low and each.high <= high) for each in made]


def travel_speed(positions: FloatArray, fps: float) -> float:
    """Metres a second that the hips travel over the ground: distance of places one second apart, mean over time.

    A body that sways in place, or from side to side as it walks, does not travel by it. A shorter motion is taken from
    its first to its last frame.

    Raises:
        ValueError: fewer than two frames.
    """
    if len(positions) < 2:
        raise ValueError("a motion of one frame does not travel")
    root = positions[:, INDEX["hips"]][:, [0, 2]].astype(np.float64)
    step = min(max(1, round(STEP * fps)), len(root) - 1)
    return float(np.linalg.norm(root[step:] - root[:-step], axis=1).mean() * fps / step)
