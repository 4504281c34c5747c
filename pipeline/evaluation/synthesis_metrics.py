"""How far a generated motion is from the recorded one, and whether it moves as one (section 4.3.3 of the thesis).

Errors (tables 4.1 to 4.3) compare poses as `body_poses` gives them, hips at the origin and facing one way, in the unit
of the joints and in real time; or at sparse poses as the thesis has them, in body lengths (`sparse_poses`). The thesis
leaves its unit open (bones are normalised) and uses other data, so its numbers do not compare with these.

Measures of movement (feet that stand, bones that keep their length, energy, speed of travel) look at one motion
[F, 21, 3] in metres, y up. Recorded clips are measured in the same way at the same rate; only the comparison means
something.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray
from motionlake.evaluation.synthesis_trials import Trial, poses_at
from motionlake.glogen.sparse import uniform_places
from motionlake.glogen.trajectories import body_motion
from motionlake.motion.features import body_length
from motionlake.motion.resampling import TOLERANCE, interpolated
from motionlake.motion.rotations import turn_about_y
from motionlake.motion.skeleton import INDEX, PARENTS, facing

MILLISECONDS: Final = (80, 160, 240, 320, 400, 480, 560, 640)
SPARSE: Final = 15  # poses that GloGen makes (section 4.3.5)
MM: Final = 1000.0
FEET: Final = (("left_ankle", "right_ankle"), ("left_toe", "right_toe"))
# A joint of a foot lower than this above its ground may stand: 2.5 cm of a person whose leg and torso measure 1.35 m.
LOW: Final = 0.0185  # body lengths
GROUND: Final = 0.05  # quantile over time of the lower foot's height
SPAN: Final = 0.1  # seconds over which speeds of joints are taken, so that jitter of sensors counts little
SHORTEST: Final = 0.01  # metres; shorter bones are those a rig lacks
STEP: Final = 1.0  # seconds


def body_poses(positions: FloatArray) -> Float64Array:
    """[F, 21, 3] joints seen from the body: hips at the origin, every frame turned to face +z."""
    joints = positions.astype(np.float64) - positions[:, :1]
    return turn_about_y(joints, -facing(positions))


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
    speed, weight, height = sliding_steps(positions, fps)
    total, slid = float(weight.sum()), speed * weight
    standing = float(slid.sum()) / total if total > 0 else 0.0
    return FootSliding(float(slid.mean()), float((height < 1).mean()), standing)


def sliding_steps(positions: FloatArray, fps: float) -> tuple[Float64Array, Float64Array, Float64Array]:
    """What `foot_sliding` is of: of ankles and toes, left and right, in each step from a frame to the next.

    Returns:
        [2, F - 1, 2] horizontal speed, metres a second; nearness to the ground, 0 to 1; height over `LOW` body lengths.

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
    height = np.stack(heights) / (LOW * size)
    return np.stack(speeds), 2 - np.exp2(np.clip(height, 0, 1)), height


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


def energy(positions: FloatArray, fps: float) -> Energy:
    """How much the joints move, root and facing apart (`body_poses`).

    Speeds are taken over a tenth of a second. A motion shorter than a second is one window.

    Raises:
        ValueError: fewer than two frames.
    """
    if len(positions) < 2:
        raise ValueError("a motion of one frame has no speed")
    poses = body_poses(positions)[:, 1:]
    step = min(max(1, round(SPAN * fps)), len(poses) - 1)
    speeds = np.linalg.norm(poses[step:] - poses[:-step], axis=-1) * (fps / step)
    squares = np.square(speeds).mean(axis=1)
    width = min(max(1, round(STEP * fps)), len(squares))
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
    return [low <= each.low and each.high <= high for each in made]


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


@dataclass(frozen=True)
class Movement:
    """What the feet, bones and joints of one motion do."""

    sliding: FootSliding
    drift: float
    energy: Energy
    travel: float

    @classmethod
    def of(cls, positions: Float64Array, fps: float, rest_offsets: Float64Array) -> Movement:
        return cls(
            foot_sliding(positions, fps), bone_length_drift(positions, rest_offsets), energy(positions, fps),
            travel_speed(positions, fps),
        )  # fmt: skip


def movement(
    made: Sequence[Movement], real: Sequence[Movement], classes: Sequence[str], ranges: Mapping[str, Sequence[Energy]]
) -> dict[str, Any]:
    """Made motions beside as many real ones; as `--json` prints it.

    Args:
        made: n.
        real: n, the clips that they are compared with.
        classes: n wanted classes.
        ranges: energies of the real clips of each class.
    """
    within = [within_range([one.energy], ranges[name])[0] for one, name in zip(made, classes, strict=True)]
    known = [each for name in set(classes) for each in ranges[name]]

    def beside(measure: str) -> dict[str, float | None]:
        """Means, and their ratio where the real one is not zero."""
        own, others = (float(np.mean([attrgetter(measure)(m) for m in side])) for side in (made, real))
        return {"made": own, "real": others, "ratio": own / others if others > 0 else None}

    return {
        "foot_sliding": {
            **beside("sliding.speed"),
            "standing": beside("sliding.standing_speed"),
            "contact": beside("sliding.contact"),
        },
        "bone_length_drift": max(m.drift for m in made),
        "energy": {
            **beside("energy.mean"),
            "made_range": [min(m.energy.low for m in made), max(m.energy.high for m in made)],
            "real_range": [min(each.low for each in known), max(each.high for each in known)],
            "within": float(np.mean(within)),
        },
        "travel_speed": beside("travel"),
    }
