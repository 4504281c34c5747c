"""The moves of many clips at once, and sequences at a few instants: what large lakes make of every clip.

The same as `Track.moves` and `sketches.instants` of one clip after the other, to rounding. Kernels are given the
constants of other modules: numba would keep a kernel with those of before.
"""

from __future__ import annotations

from functools import cache
from typing import Final, NamedTuple

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, FloatArray, Int64Array
from motionlake.kernels import njit
from motionlake.motion.moves import (
    DISPLACEMENT_COUNT,
    HIPS,
    JOINTS_COUNT,
    MOST,
    SIDES,
    SILENT,
    SMOOTHED,
    WIDTH,
)
from motionlake.motion.resampling import STILL
from motionlake.motion.sketches import BY_PATH

_REACH: Final = int(4 * SMOOTHED + 0.5)  # frames on either side that a filter of scipy sees
_SIDES: Final = np.array([[left.start, right.start] for left, right in SIDES])
# What displacement and joints count, the first column of the hips, the least root mean square.
Constants = tuple[float, float, int, float]


class Smoothing(NamedTuple):
    """What kernels tell velocity and facing by.

    Attributes:
        taps: [2 r + 1] of a filter.
        sides: [s, 2] first columns of left and right joints.
        silent: a length below which nothing tells a direction.
    """

    taps: Float64Array
    sides: Int64Array
    silent: float


@cache
def smoothing() -> Smoothing:
    """That of moves."""
    taps = np.exp(-0.5 * (np.arange(-_REACH, _REACH + 1) / SMOOTHED) ** 2)
    return Smoothing(taps / taps.sum(), _SIDES, SILENT)


def moves_of_clips(joints: Float32Array, starts: Int64Array) -> tuple[Float32Array, Int64Array]:
    """Moves [M, 135] of n clips one after another, and where those of each begin [n + 1].

    Args:
        joints: [N, 45] at 12 frames a second, seen from the body, as `Track.of` takes them.
        starts: [n + 1] first frame of each clip, and the end; each has one at least.
    """
    counts = np.minimum(np.diff(starts), MOST)
    first = np.concatenate([[0], np.cumsum(counts)])
    moves = np.empty((first[-1], WIDTH), dtype=np.float32)
    constants = (DISPLACEMENT_COUNT, JOINTS_COUNT, HIPS.start, SILENT)
    _moves(joints, starts, smoothing(), constants, first, moves)
    return moves, first


def instants_of_clips(frames: FloatArray, starts: Int64Array, count: int) -> Float32Array:
    """[n, count, D] sequences of n clips, one after another in frames [M, D], each at so many instants.

    Args:
        frames: of all clips.
        starts: [n + 1] first frame of each clip, and the end; each has one at least.
        count: of instants.
    """
    found = np.empty((len(starts) - 1, count, frames.shape[1]), dtype=np.float32)
    _instants(frames, starts, BY_PATH, STILL, found)
    return found


@njit(cache=True, nogil=True)
def _moves(
    joints: Float32Array, starts: Int64Array, by: Smoothing, constants: Constants, first: Int64Array, out: Float32Array
) -> None:
    """Kernel of `moves_of_clips`."""
    longest = 0
    for clip in range(len(starts) - 1):
        longest = max(longest, starts[clip + 1] - starts[clip])
    width = joints.shape[1]
    turned = np.empty((longest, width))
    for clip in range(len(starts) - 1):
        count = starts[clip + 1] - starts[clip]
        own = joints[starts[clip] : starts[clip + 1]]
        velocity = velocity_of(own, by)
        cosine, sine = _heading(facing_of(own, by), by.silent)
        for t in range(count):
            for j in range(0, width, 3):
                x, z = np.float64(own[t, j]), np.float64(own[t, j + 2])
                turned[t, j], turned[t, j + 2] = x * cosine - z * sine, x * sine + z * cosine
                turned[t, j + 1] = own[t, j + 1]
                x, z = velocity[t, j], velocity[t, j + 2]
                velocity[t, j], velocity[t, j + 2] = x * cosine - z * sine, x * sine + z * cosine
        _parts(turned, velocity, count, constants, out[first[clip] : first[clip + 1]])


@njit(cache=True, nogil=True)
def _smoothed(own: Float32Array, taps: Float64Array, smooth: Float64Array) -> None:
    """Frames [n, D] into the first n of `smooth`; beyond its ends a clip goes on as in a mirror."""
    count, reach = len(own), len(taps) // 2
    for t in range(count):
        smooth[t] = 0.0
        for step in range(-reach, reach + 1):
            at = (t + step) % (2 * count)
            at = at if at < count else 2 * count - 1 - at
            for d in range(own.shape[1]):
                smooth[t, d] += taps[step + reach] * own[at, d]


@njit(cache=True, nogil=True)
def velocity_of(own: Float32Array, by: Smoothing) -> Float64Array:
    """[n, D] as `Track.velocity`, of joints [n, D]."""
    count, width = own.shape
    smooth, velocity = np.empty((count, width)), np.zeros((count, width))
    _smoothed(own, by.taps, smooth)
    for t in range(count):
        before, after = max(t - 1, 0), min(t + 1, count - 1)
        for d in range(width):
            velocity[t, d] = (smooth[after, d] - smooth[before, d]) / max(after - before, 1)
    return velocity


@njit(cache=True, nogil=True)
def facing_of(own: Float32Array, by: Smoothing) -> Float64Array:
    """[n, 2] as `Track.facing`, of joints [n, D]."""
    found, across = np.empty((len(own), 2)), np.empty(3)
    for t in range(len(own)):
        x = z = 0.0
        for side in range(len(by.sides)):
            for d in range(3):
                across[d] = np.float64(own[t, by.sides[side, 0] + d]) - np.float64(own[t, by.sides[side, 1] + d])
            length = max(np.sqrt(across[0] ** 2 + across[1] ** 2 + across[2] ** 2), by.silent)
            x += across[0] / length
            z += across[2] / length
        length = max(np.sqrt(x**2 + z**2), by.silent)
        found[t, 0], found[t, 1] = x / length, -z / length
    return found


@njit(cache=True, nogil=True)
def _heading(facing: Float64Array, silent: float) -> tuple[float, float]:
    """Cosine and sine of the angle about y by which a clip [n, D] faces away from +z in the mean."""
    ahead, aside = 0.0, 0.0
    for t in range(len(facing)):
        ahead += facing[t, 0]
        aside += facing[t, 1]
    length = np.sqrt(ahead**2 + aside**2)
    return (ahead / length, aside / length) if length > silent else (1.0, 0.0)


@njit(cache=True, nogil=True)
def _parts(joints: Float64Array, velocity: Float64Array, frames: int, constants: Constants, out: Float32Array) -> None:
    """Displacement, velocity and joints of a clip of so many frames into `out` [m, 3 D]."""
    count, width = len(out), joints.shape[1]
    of_displacement, of_joints, hips, silent = constants
    chosen = np.arange(count)
    if frames > count:
        for t in range(count):
            chosen[t] = np.int64(np.round(t * ((frames - 1) / (count - 1))))
    middle = np.zeros(width)
    for end in (0, min(1, count - 1), max(0, count - 2), count - 1):
        for d in range(width):
            middle[d] += joints[chosen[end], d] / 4
    gone = moved = 0.0
    for frame in chosen:
        for d in range(width):
            gone += (joints[frame, d] - middle[d]) ** 2
            moved += velocity[frame, d] ** 2
    gone = of_displacement / max(np.sqrt(gone / count), silent)
    moved = 1 / max(np.sqrt(moved / count), silent)
    for i in range(count):
        t = chosen[i]
        for d in range(width):
            start = joints[chosen[0], d] if hips <= d < hips + 3 else 0.0
            out[i, d] = gone * (joints[t, d] - middle[d])
            out[i, width + d] = moved * velocity[t, d]
            out[i, 2 * width + d] = of_joints * (joints[t, d] - start)


@njit(cache=True, nogil=True)
def _instants(frames: FloatArray, starts: Int64Array, by_path: float, still: float, out: Float32Array) -> None:
    """Kernel of `instants_of_clips`."""
    count, width = out.shape[1:]
    for clip in range(len(starts) - 1):
        own = frames[starts[clip] : starts[clip + 1]]
        last = len(own) - 1
        done = np.zeros(last + 1)
        for t in range(last):
            square = 0.0
            for d in range(width):
                square += (np.float64(own[t + 1, d]) - np.float64(own[t, d])) ** 2
            done[t + 1] = done[t] + np.sqrt(square)
        way = done[last]
        for t in range(last + 1):
            time = t / max(last, 1)
            done[t] = time if way < still else by_path * done[t] / way + (1 - by_path) * time
        before = 0
        for at in range(count):
            place = at / max(count - 1, 1)
            while before < last - 1 and done[before + 1] <= place:
                before += 1
            after = min(before + 1, last)
            step = done[after] - done[before]
            share = min(max((place - done[before]) / step, 0.0), 1.0) if step > 0 else 0.0
            for d in range(width):
                out[clip, at, d] = (1 - share) * own[before, d] + share * own[after, d]
