"""How a body moves: the moves of a clip.

A frame of moves is the displacement of the joints from the posture that a clip starts and ends in, and their velocity,
each divided by its root mean square over the clip: these tell neither how far a body moves nor how it stands. Velocity
counts most, for it tells one move from another that passes through the same places. Beside them are the joints
themselves and how far the body has come. Clips are compared by dynamic time
warping of their moves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, FloatArray
from motionlake.motion.skeleton import COMMON
from motionlake.motion.smoothing import smoothed

FPS: Final = 12.0
LEAST: Final = 4  # frames
MOST: Final = 160  # frames of a clip that are aligned; of a longer one as many, evenly spread
SMOOTHED: Final = 1.0  # frames; standard deviation of the filter before velocities
WIDTH: Final = 3 * 3 * len(COMMON)  # numbers of a frame: displacement, velocity, joints
VELOCITY: Final = slice(WIDTH // 3, 2 * WIDTH // 3)  # columns
DISPLACEMENT_COUNT: Final = 0.3  # a root mean square of the displacement, beside one of the velocity
JOINTS_COUNT: Final = 0.4  # a body length of the joints themselves, beside the same
# What was made of moves of another kind is not compared with these.
KIND: Final = f"{WIDTH} numbers, displacement {DISPLACEMENT_COUNT}, joints {JOINTS_COUNT}"
HIPS: Final = slice(3 * COMMON.index("hips"), 3 * COMMON.index("hips") + 3)  # columns; they hold the path
SILENT: Final = 1e-6  # body lengths; a root mean square below it is of what does not move
# Columns of the joints whose left and right tell where a body faces.
SIDES: Final = tuple(
    tuple(
        slice(3 * COMMON.index(f"{side}_{joint}"), 3 * COMMON.index(f"{side}_{joint}") + 3)
        for side in ("left", "right")
    )
    for joint in ("hip", "shoulder")
)


@dataclass(frozen=True)
class Track:
    """The joints of a clip at 12 frames a second, in body lengths, seen from the body.

    Attributes:
        joints: [N, 45], x y z of each of the fifteen joints, y up.
        velocity: [N, 45] a frame, of the smoothed joints.
        facing: [N, 2] cosine and sine of the angle about y by which the body faces away from +z; zero where no joints
            tell.
    """

    joints: Float64Array
    velocity: Float64Array
    facing: Float64Array

    @staticmethod
    def of(joints: FloatArray) -> Track:
        """Of joints [N, 45] at 12 frames a second; one frame stands still."""
        exact = joints.astype(np.float64)
        if len(exact) < 2:
            return Track(exact, np.zeros_like(exact), _facing(exact))
        return Track(exact, np.gradient(smoothed(exact, SMOOTHED), axis=0), _facing(exact))

    def pace(self) -> Float64Array:
        """[N] how far the joints move a frame, in body lengths: the mean of three frames."""
        if len(self.joints) < 2:
            return np.zeros(len(self.joints))
        speed = np.linalg.norm(np.gradient(self.joints, axis=0), axis=1)
        return np.convolve(np.pad(speed, 1, mode="edge"), np.full(3, 1 / 3), "valid")

    def cut(self, start: int, stop: int) -> Track:
        """Frames [start, stop) of it."""
        return Track(self.joints[start:stop], self.velocity[start:stop], self.facing[start:stop])

    def turned(self) -> Track:
        """The same with the body facing +z in the mean."""
        joints, velocity = self._turned()
        return Track(joints, velocity, _facing(joints))

    def _turned(self) -> tuple[Float64Array, Float64Array]:
        """Joints and velocity of that."""
        cosine, sine = headings(self.facing.sum(axis=0)[None])[0].tolist()
        turn = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])
        joints, velocity = (
            (part.reshape(-1, 15, 3) @ turn).reshape(part.shape) for part in (self.joints, self.velocity)
        )
        return joints, velocity

    def moves(self) -> Float32Array:
        """[m, 135] its moves, the body facing +z in the mean; of more than 160 frames, 160."""
        (joints, velocity), count = self._turned(), len(self.joints)
        chosen = np.linspace(0, count - 1, MOST).round().astype(int) if count > MOST else np.arange(count)
        joints = joints[chosen]
        displacement = DISPLACEMENT_COUNT * _scaled(joints - joints[ends(len(joints))].mean(axis=0))
        parts = (displacement, _scaled(velocity[chosen]), JOINTS_COUNT * from_start(joints))
        return np.concatenate(parts, axis=1).astype(np.float32)


def _scaled(part: Float64Array) -> Float64Array:
    """Divided by the root mean square of its frames."""
    return np.asarray(part / max(float(np.sqrt((part**2).sum(axis=1).mean())), SILENT))


def from_start(joints: Float64Array) -> Float64Array:
    """Joints [N, 45] whose path starts at zero in the first frame."""
    started = joints.copy()
    started[:, HIPS] -= joints[0, HIPS]
    return started


def _facing(joints: Float64Array) -> Float64Array:
    across = np.sum([_unit(joints[:, left] - joints[:, right]) for left, right in SIDES], axis=0)
    return np.asarray(_unit(np.column_stack([across[:, 0], -across[:, 2]])))


def _unit(vectors: Float64Array) -> Float64Array:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), SILENT))


def headings(facing: Float64Array) -> Float64Array:
    """[s, 2] cosine and sine of the angles of sums [s, 2] of `Track.facing`; of none where it tells nothing."""
    lengths = np.hypot(facing[:, 0], facing[:, 1])[:, None]
    return np.where(lengths > SILENT, facing / np.maximum(lengths, SILENT), (1.0, 0.0))


def ends(count: int) -> list[int]:
    """The frames of so many in which a clip starts and ends: two and two."""
    return [0, min(1, count - 1), max(0, count - 2), count - 1]


def at_12(sequence: FloatArray) -> Float32Array:
    """[N, 45] joints at 12 frames a second, 4 at least, of a sequence [T, 15, 3] of 30 a second (`clip_sequence`)."""
    count = max(LEAST, round(len(sequence) * FPS / 30))
    at = np.linspace(0, len(sequence) - 1, count).round().astype(int)
    return np.asarray(sequence[at].reshape(count, -1), dtype=np.float32)
