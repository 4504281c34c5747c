"""Motion made to order: what is asked of a generator, whichever it is, and what it gives."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol

from motionlake.arrays import Float64Array

if TYPE_CHECKING:
    from motionlake.motion.keyframes import KeyPoses
    from motionlake.motion.paths import GroundPath

FPS: Final = 30.0  # of generated motion
SHORTEST: Final = 24  # frames at that rate that a seed clip has at least


@dataclass(frozen=True)
class SeedClip:
    """A recorded clip that a generated motion continues from.

    Attributes:
        clip: its name.
        positions: [F, 21, 3] canonical joints, metres, y up.
        fps: frames a second.
        rest_offsets: [21, 3] of its body, metres; the motion gets this body.
        rotations: [F, 21, 4] local rotations (w, x, y, z); None: they follow from the positions, without twist.
    """

    clip: str
    positions: Float64Array
    fps: float
    rest_offsets: Float64Array
    rotations: Float64Array | None = None


@dataclass(frozen=True)
class Control:
    """Where a motion goes, and how.

    Attributes:
        path: where it goes on the ground; None: as recordings go.
        speed: metres a second; None: that of the class.
        facing: radians to the left of the heading at the start that the body keeps facing; None: along the path.
        loop: its end meets its beginning.
        from_end: it goes on from the last frames of its seed clip, not from its first.
        style: frames that look like those of this clip are preferred; None: all alike.
    """

    path: GroundPath | None = None
    speed: float | None = None
    facing: float | None = None
    loop: bool = False
    from_end: bool = False
    style: SeedClip | None = None


@dataclass(frozen=True)
class MotionRequest:
    """One motion to generate.

    Attributes:
        classes: one after the other.
        seconds: of motion.
        seed: of what is drawn.
        start: the clip that it continues from.
        pace: speed relative to the recordings; 2 is twice as fast.
        temperature: how much is left to chance; 0 gives the most likely motion.
        shares: seconds of each class; None: equal shares of the time.
        control: where it goes; None: as recordings go.
        keys: poses that it passes through, in the world of `start` and by its body; it lasts from the first to the last
            of them, whatever `seconds` says, and moves between them as the classes do.
    """

    classes: tuple[str, ...]
    seconds: float
    seed: int
    start: SeedClip
    pace: float = 1.0
    temperature: float = 1.0
    shares: tuple[float, ...] | None = None
    control: Control | None = None
    keys: KeyPoses | None = None

    def check(self, classes: Sequence[str]) -> None:
        """Raises `ValueError` where no generator of these classes can make it."""
        if not self.classes:
            raise ValueError("a request names no class")
        for name in self.classes:
            if name not in classes:
                raise ValueError(f"class {name!r} is none of this generator's {len(classes)}")
        if not 0 < self.seconds < math.inf:
            raise ValueError(f"{self.seconds} seconds of motion cannot be made; ask for more than 0")
        if not 0 < self.pace < math.inf:
            raise ValueError(f"pace {self.pace} is none; 1 is that of the recordings, 2 twice as fast")
        if not 0 <= self.temperature < math.inf:
            raise ValueError(
                f"temperature {self.temperature} is none; 0 gives the most likely motion, 1 natural variation"
            )


@dataclass(frozen=True)
class Source:
    """Recorded frames that frames [start, stop) of a generated motion were made from.

    Attributes:
        clip: its name.
        first, last: frames of the clip, at its own rate, of the first and the last of them.
        mirrored: they are mirrored left to right.
    """

    start: int
    stop: int
    clip: str
    first: int
    last: int
    mirrored: bool


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
        sources: the recorded frames that it was made from, in order; empty where a network made it.
    """

    positions: Float64Array
    rotations: Float64Array
    rest_offsets: Float64Array
    fps: float
    class_starts: tuple[int, ...]
    seed_start: int
    seed_stop: int
    sources: Sequence[Source] = ()


class MotionGenerator(Protocol):
    """What makes motion of known classes."""

    @property
    def classes(self) -> list[str]: ...

    def generate(self, requests: Sequence[MotionRequest]) -> list[GeneratedMotion]:
        """One motion for each request; the same request gives the same motion, whatever the others are.

        Raises:
            ValueError: a request that it cannot fulfil.
        """
