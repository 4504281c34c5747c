"""What a motion is generated from: a request, the seed clip that it starts from, and the generated motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.glogen.config import SEEDS
from motionlake.glogen.onset import state_at
from motionlake.glogen.sparse import even_motion, ranges, sparse_motion
from motionlake.glogen.trajectories import FPS, body_length, body_motion, measured_length
from motionlake.motion.skeleton import JOINTS, facing

SHORTEST: Final = 24  # frames at 30 a second that a seed clip has at least: five sparse poses of a cyclic motion


@dataclass(frozen=True)
class StartState:
    """The poses and the place that a generated motion continues from.

    Attributes:
        rows: [5, 65] sparse poses.
        state: [244] pose and velocities at the last of them (`onset.state_at`); None unless the class is cyclic.
        root: [3] hips in the last pose, metres; y is that of the ground.
        yaw: heading of the last pose, radians.
        first, last: frames [first, last) of the clip, at its own rate, that the poses are from.
    """

    rows: Float64Array
    state: Float64Array | None
    root: Float64Array
    yaw: float
    first: int
    last: int


def start_state(seed: SeedClip, chance: int, sparse: int, going: bool = False) -> StartState:
    """The first sparse poses of a seed clip, or of one piece of a long clip.

    Args:
        seed: the clip.
        chance: seed that picks the piece of a long clip.
        sparse: number of sparse poses that represent a motion.
        going: whether the class is cyclic; its sparse poses are then evenly spaced in time (`even_motion`).

    Raises:
        ValueError: the clip is shorter than needed, or of another skeleton.
    """
    if seed.positions.ndim != 3 or seed.positions.shape[1:] != (len(JOINTS), 3):
        shape = "x".join(map(str, seed.positions.shape[1:]))
        raise ValueError(f"{seed.clip} is of another skeleton: {shape} numbers a frame, not {len(JOINTS)}x3")
    frames = round((len(seed.positions) - 1) / seed.fps * FPS) + 1 if len(seed.positions) else 0
    if frames < SHORTEST:
        seconds = len(seed.positions) / seed.fps
        raise ValueError(f"{seed.clip} lasts {seconds:.2f} s; to start from it needs {SHORTEST / FPS:.2f} s at least")
    if body_length(seed.rest_offsets) < 1e-6:
        raise ValueError(f"{seed.clip} has a body without length")
    motion = body_motion(seed.positions, seed.fps)
    parts = ranges(len(motion))
    start, stop = parts[int(np.random.default_rng(chance).integers(len(parts)))]
    piece = motion.cut(start, stop)
    found = even_motion(piece) if going else sparse_motion(piece, sparse)
    places = (start + found.places[:SEEDS]) / FPS * seed.fps
    last = int(min(round(places[-1]), len(seed.positions) - 1))
    root = seed.positions[last, 0].astype(float)
    height = motion.height[min(len(motion) - 1, round(start + found.places[SEEDS - 1]))]
    root[1] -= height * measured_length(seed.positions)
    yaw = float(facing(seed.positions[last : last + 1])[0])
    state = state_at(piece, found.places[SEEDS - 1 : SEEDS])[0] if going else None
    return StartState(found.rows[:SEEDS], state, root, yaw, int(places[0]), last + 1)


@dataclass(frozen=True)
class SeedClip:
    """A recorded clip whose first sparse poses a generated motion continues from.

    Attributes:
        clip: its name.
        positions: [F, 21, 3] canonical joints, metres, y up.
        fps: frames a second.
        rest_offsets: [21, 3] of its body, metres; the motion gets this body.
    """

    clip: str
    positions: Float64Array
    fps: float
    rest_offsets: Float64Array


@dataclass(frozen=True)
class MotionRequest:
    """One motion to generate.

    Attributes:
        classes: one after the other, equal shares of the time each.
        seconds: of motion.
        seed: of the random latent variables.
        start: the clip that it continues from.
        pace: speed relative to the recordings; 2 is twice as fast.
        temperature: scale of the latent variables; 0 gives the most likely motion.
    """

    classes: tuple[str, ...]
    seconds: float
    seed: int
    start: SeedClip
    pace: float = 1.0
    temperature: float = 1.0


@dataclass(frozen=True)
class GeneratedMotion:
    """A generated motion; its first frame is 1 / fps seconds after the last pose of its seed clip.

    Attributes:
        positions: [F, 21, 3] canonical joints, metres, y up.
        rotations: [F, 21, 4] local rotations (w, x, y, z) relative to the canonical rest pose.
        rest_offsets: [21, 3] of the body, metres: forward kinematics of the rotations gives the positions.
        fps: frames a second.
        class_starts: first frame of each class.
        seed_start, seed_stop: frames of the seed clip, at its own rate, that it continues from.
    """

    positions: Float64Array
    rotations: Float64Array
    rest_offsets: Float64Array
    fps: float
    class_starts: tuple[int, ...]
    seed_start: int
    seed_stop: int
