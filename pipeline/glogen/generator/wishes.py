"""What is asked of a generator, and what it gives."""

from __future__ import annotations

from dataclasses import dataclass

from motionlake.motion.clip import FloatArray


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
    positions: FloatArray
    fps: float
    rest_offsets: FloatArray


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

    positions: FloatArray
    rotations: FloatArray
    rest_offsets: FloatArray
    fps: float
    class_starts: tuple[int, ...]
    seed_start: int
    seed_stop: int
