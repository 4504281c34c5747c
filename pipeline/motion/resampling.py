"""Resampling in time: which frames stand beside an instant, and linear interpolation between them."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray, Int64Array

# An instant this close (in frames) to a frame counts as that frame, and as inside the clip after its last frame.
TOLERANCE: Final = 1e-6
STILL: Final = 1e-6  # what goes no farther stands still


def sample_count(n_frames: int, fps: float, wanted: float) -> int:
    """How many instants k / `wanted` lie within a clip of `n_frames` at `fps`: floor((F - 1) / fps * wanted) + 1."""
    return int(np.floor((n_frames - 1) / fps * wanted + TOLERANCE)) + 1


def samples(n_frames: int, fps: float, wanted: float) -> tuple[Int64Array, Int64Array, Float64Array]:
    """Where the instants k / `wanted` lie in a clip: the frames before and after each, and the weight of the latter."""
    instants = np.arange(sample_count(n_frames, fps, wanted)) * (fps / wanted)
    below = np.clip(np.floor(instants + TOLERANCE).astype(np.int64), 0, n_frames - 1)
    return below, np.minimum(below + 1, n_frames - 1), np.clip(instants - below, 0.0, 1.0)


def beside(at: FloatArray, n_frames: int, tolerance: float = 0.0) -> tuple[Int64Array, Int64Array, Float64Array]:
    """Frames before and after places `at` (frames, fractional), and how far each place is from the one to the other.

    A place at the last frame lies between the last two.
    """
    before = np.clip(np.floor(at + tolerance).astype(np.int64), 0, max(0, n_frames - 2))
    return before, np.minimum(before + 1, n_frames - 1), np.asarray(at - before)


def interpolated(frames: Float64Array, at: Float64Array) -> Float64Array:
    """[T, ...] frames [F, ...] at fractional places [T]."""
    before, after, share = beside(at, len(frames))
    share = share.reshape(-1, *[1] * (frames.ndim - 1))
    return np.asarray(frames[before] * (1 - share) + frames[after] * share)


def paced_places(frames: Float64Array, count: int, paced: float) -> Float64Array:
    """[count] places from the first of frames [F, D] to the last that keep pace with what moves.

    Args:
        frames: one at least.
        count: how many places.
        paced: 0: even in time; 1: even in the way that the frames go, so that a pause does not count; in between: so
            much of both. What stands still is even in time.
    """
    time = np.linspace(0, 1, len(frames))
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(frames, axis=0), axis=1))])
    done = time if way[-1] < STILL else paced * way / way[-1] + (1 - paced) * time
    return np.interp(np.linspace(0, 1, count), done, np.arange(len(frames)))


def resample(frames: Float64Array, fps: float, wanted: float, *, spherical: bool = False) -> Float64Array:
    """[T, J, C] frames [F, J, C] of `fps` a second at the instants k / `wanted`, by linear interpolation.

    `spherical`: the last axis holds unit quaternions; neighbours are brought to one hemisphere, the result is
    normalised and has w >= 0.
    """
    below, above, weight = samples(len(frames), fps, wanted)
    first, second, weight = frames[below], frames[above], weight[:, None, None]
    if not spherical:
        return np.asarray(first + weight * (second - first), dtype=np.float64)
    second = np.where(np.sum(first * second, axis=-1, keepdims=True) < 0, -second, second)
    blended = first + weight * (second - first)
    blended /= np.linalg.norm(blended, axis=-1, keepdims=True)
    return np.asarray(np.where(blended[..., :1] < 0, -blended, blended), dtype=np.float64)
