"""Motion through given poses: whatever leads from one to the next is bent so that it passes through them.

A stretch of motion that leads about from one pose to the next is warped onto both (motion warping; Witkin and Popović
1995): what is missing at its ends is spread over it, and how fast the joints go is the same on both sides of a pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, Int64Array
from motionlake.motion.rotations import conjugate, from_vectors, multiply, rotate, slerp, to_vectors
from motionlake.motion.skeleton import INDEX, JOINTS

FPS: Final = 30.0  # frames a second, where nothing else is said
GROUND: Final = 0.05  # quantile of the heights of toes that counts as the ground
BLEND: Final = 0.3  # seconds about a pose in which the speed of a recorded stretch becomes that at the pose


@dataclass(frozen=True)
class KeyPoses:
    """K poses of one body, and the frames of a motion at which it is to have them.

    Attributes:
        frames: [K] rising, from 0 on.
        hips: [K, 3] metres, y up.
        rotations: [K, 21, 4] local rotations (w, x, y, z).
        speeds: of the first and the last pose [2, 22, 3], where they are known: a second, the hips' way (metres) and
            the turning of every joint (rotation vector, radians).
        fps: frames a second.
    """

    frames: Int64Array
    hips: Float64Array
    rotations: Float64Array
    speeds: Float64Array | None = None
    fps: float = FPS

    def __post_init__(self) -> None:
        if len(self.frames) < 2:
            raise ValueError("give two keyframes at least")
        if not (np.diff(self.frames) > 0).all():
            raise ValueError("the frames of keyframes must rise")

    def cut(self, start: int, stop: int) -> KeyPoses:
        """Poses [start, stop), whose speeds are not known."""
        own = slice(start, stop)
        return KeyPoses(self.frames[own], self.hips[own], self.rotations[own], fps=self.fps)


@dataclass(frozen=True)
class Stretch:
    """n + 1 frames that lead about from one pose to the next, both included.

    Attributes:
        hips: [n + 1, 3] metres.
        rotations: [n + 1, 21, 4] local.
        recorded: it moves as bodies do; else it goes evenly from pose to pose.
    """

    hips: Float64Array
    rotations: Float64Array
    recorded: bool = True


def ground_below(positions: Float64Array, clip: str) -> float:
    """Height of the ground below joints [F, 21, 3] of a clip, metres: where its lower toe mostly stands.

    Raises:
        ValueError: they are of another skeleton.
    """
    if positions.ndim != 3 or positions.shape[1:] != (len(JOINTS), 3):
        shape = "x".join(map(str, positions.shape[1:]))
        raise ValueError(f"{clip} is of another skeleton: {shape} numbers a frame, not {len(JOINTS)}x3")
    toes = positions[:, [INDEX["left_toe"], INDEX["right_toe"]], 1]
    return float(np.quantile(toes.min(axis=1), GROUND))


def passed(hips: Float64Array, rotations: Float64Array, fps: float) -> Float64Array:
    """[22, 3] how fast a body goes that passed through two poses (hips [2, 3], rotations [2, 21, 4]) a frame apart."""
    turned = to_vectors(multiply(rotations[1], conjugate(rotations[0])))
    return np.concatenate([hips[1:] - hips[:1], turned]) * fps


def even_stretch(keys: KeyPoses, index: int) -> Stretch:
    """From one pose to the next at even speed."""
    share = np.linspace(0, 1, int(keys.frames[index + 1] - keys.frames[index]) + 1)
    hips = keys.hips[index] + share[:, None] * (keys.hips[index + 1] - keys.hips[index])
    first, last = (
        np.broadcast_to(keys.rotations[i], (len(share), *keys.rotations[i].shape)) for i in (index, index + 1)
    )
    return Stretch(hips, slerp(first, last, np.broadcast_to(share[:, None], first.shape[:2])), recorded=False)


def through(keys: KeyPoses, stretches: Sequence[Stretch]) -> tuple[Float64Array, Float64Array]:
    """The motion through all poses, from the first to the last.

    Args:
        keys: K poses.
        stretches: K - 1, from each to the next.

    Returns:
        Hips [T, 3], metres, and local rotations [T, 21, 4]; frame `keys.frames[i] - keys.frames[0]` is pose i exactly.
    """
    sides = [_speeds(stretch) for stretch in stretches]
    at_keys = _key_speeds(keys, stretches, sides)
    hips, rotations = [keys.hips[:1]], [keys.rotations[:1]]
    for i, stretch in enumerate(stretches):
        frames = len(stretch.hips) - 1
        reach = min(frames, max(1, round(BLEND * keys.fps))) if stretch.recorded else frames
        weights = _weights(frames, reach)
        off = keys.hips[i : i + 2] - stretch.hips[[0, -1]]
        slower = np.stack([at_keys[i + side, 0] - sides[i][side, 0] for side in (0, 1)])
        moved = stretch.hips + np.tensordot(weights, np.concatenate([off, slower]), axes=1)
        turned = to_vectors(multiply(keys.rotations[i : i + 2], conjugate(stretch.rotations[[0, -1]])))
        wanted = np.stack(
            [at_keys[i + side, 1:] - rotate(from_vectors(turned[side]), sides[i][side, 1:]) for side in (0, 1)]
        )
        more = np.tensordot(weights, np.concatenate([turned, wanted]), axes=1)
        bent = multiply(from_vectors(more), stretch.rotations)
        moved[-1], bent[-1] = keys.hips[i + 1], keys.rotations[i + 1]
        hips.append(moved[1:])
        rotations.append(bent[1:])
    return np.concatenate(hips), np.concatenate(rotations)


def _weights(frames: int, reach: int) -> Float64Array:
    """[frames + 1, 4] of what is off at the first and the last frame, and of speeds (a frame) off there."""
    share = np.arange(frames + 1) / frames
    end = share * share * (3 - 2 * share)
    near = np.minimum(np.arange(frames + 1) / reach, 1.0)
    start_speed = reach * near * (1 - near) ** 2
    return np.stack([1 - end, end, start_speed, -start_speed[::-1]], axis=1)


def _speeds(stretch: Stretch) -> Float64Array:
    """[2, 22, 3] a frame, of the hips and of the joints' turning, at the first and at the last frame."""
    found = np.empty((2, 1 + stretch.rotations.shape[1], 3))
    for side, (first, second) in enumerate(((0, 1), (-2, -1))):
        found[side, 0] = stretch.hips[second] - stretch.hips[first]
        found[side, 1:] = to_vectors(multiply(stretch.rotations[second], conjugate(stretch.rotations[first])))
    return found


def _key_speeds(keys: KeyPoses, stretches: Sequence[Stretch], sides: Sequence[Float64Array]) -> Float64Array:
    """[K, 22, 3] a frame, with which a motion passes through the poses."""
    found = np.empty((len(keys.frames), *sides[0].shape[1:]))
    found[0], found[-1] = sides[0][0], sides[-1][1]
    if keys.speeds is not None:
        found[0], found[-1] = keys.speeds / keys.fps
    for i in range(1, len(stretches)):
        before, after = sides[i - 1][1], sides[i][0]
        if stretches[i - 1].recorded or stretches[i].recorded:
            found[i] = (before + after) / 2
        else:
            found[i] = _not_over(before, after, *np.diff(keys.frames[i - 1 : i + 2]))
    return found


def _not_over(before: Float64Array, after: Float64Array, frames_before: int, frames_after: int) -> Float64Array:
    """Speed between two even ones that does not overshoot: their weighted harmonic mean (Fritsch and Butland 1984)."""
    one, other = 2 * frames_after + frames_before, frames_after + 2 * frames_before
    same = before * after > 0
    inverse = one / np.where(same, before, 1.0) + other / np.where(same, after, 1.0)
    return np.where(same, (one + other) / inverse, 0.0)
