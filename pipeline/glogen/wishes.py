"""What a motion starts from: the first sparse poses of a real clip."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.glogen.config import SEEDS
from motionlake.glogen.lead_in import state_at
from motionlake.glogen.sparse import even_motion, ranges, sparse_motion
from motionlake.glogen.trajectories import FPS, body_length, body_motion, measured_length
from motionlake.motion.skeleton import JOINTS, facing

SHORTEST: Final = 24  # frames at 30 a second that a seed clip has at least: five sparse poses of a motion that goes on


@dataclass(frozen=True)
class Start:
    """Where a motion goes on from.

    Attributes:
        rows: [5, 65] sparse poses.
        state: [244] how the body stands and moves at the last of them (`lead_in.state_at`), of a class that goes on.
        root: [3] where the hips are in the last of them, metres; y is that of the ground.
        yaw: which way the body faces there, radians.
        first, last: frames [first, last) of the clip, at its own rate, that the poses are from.
    """

    rows: Float64Array
    state: Float64Array | None
    root: Float64Array
    yaw: float
    first: int
    last: int


def start_of(seed: Seed, chance: int, sparse: int, going: bool = False) -> Start:
    """The first sparse poses of a clip, of a piece of it where it is long: `chance` says which.

    Args:
        seed: the clip.
        chance: of which piece.
        sparse: poses that a generator has stand for a motion.
        going: whether the class goes on, whose sparse poses are spaced by time (`even_motion`).

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
    return Start(found.rows[:SEEDS], state, root, yaw, int(places[0]), last + 1)


@dataclass(frozen=True)
class Seed:
    """A real clip whose first sparse poses a motion starts from.

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
class Wish:
    """One motion to make.

    Attributes:
        classes: one after the other, equal shares of the time each.
        seconds: of motion.
        seed: of what is left to chance.
        start: where it starts from.
        pace: 2 is twice as fast.
        temperature: how much is left to chance; 0: nothing, the most likely motion.
    """

    classes: tuple[str, ...]
    seconds: float
    seed: int
    start: Seed
    pace: float = 1.0
    temperature: float = 1.0


@dataclass(frozen=True)
class Synthesized:
    """A motion that was made; its first frame is 1 / fps seconds after the last of the poses that it starts from.

    Attributes:
        positions: [F, 21, 3] canonical joints, metres, y up.
        rotations: [F, 21, 4] local rotations (w, x, y, z) relative to the canonical rest pose.
        rest_offsets: [21, 3] of the body, metres: forward kinematics of the rotations gives the positions.
        fps: frames a second.
        class_starts: the frame that each class begins at.
        seed_start, seed_stop: frames of the seed clip, at its own rate, that it starts from.
    """

    positions: Float64Array
    rotations: Float64Array
    rest_offsets: Float64Array
    fps: float
    class_starts: tuple[int, ...]
    seed_start: int
    seed_stop: int
