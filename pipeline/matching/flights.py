"""How long bodies are off the ground, and flights that are longer or higher than any that is recorded."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.runs import runs

# Body lengths above where a foot counts as near the ground, at which it is told how long a flight is above them.
LEVELS: Final = (0.0, 0.01, 0.02, 0.03, 0.04, 0.06, 0.08, 0.12, 0.16, 0.24, 0.32)
HALVINGS: Final = 12  # of the height by which a flight is lowered


def longest_flights(high: Float64Array) -> Float64Array:
    """[L] frames of the longest flight above each of `LEVELS`.

    Args:
        high: [T] body lengths of the lowest foot above where it counts as near the ground. A flight is above a level
            from where a straight line through heights first crosses it to where it last does, at the ends of a motion
            from or to its first or last frame.
    """
    found = [_frames(high, start, stop, 0.0) for start, stop in runs(high > 0)]
    return np.asarray(np.max(found, axis=0, initial=0.0)) if found else np.zeros(len(LEVELS))


def _frames(high: Float64Array, start: int, stop: int, lowered: float) -> Float64Array:
    """[L] frames that a flight [start, stop) is above each of `LEVELS` where it is lowered."""
    frames, body = np.zeros(len(LEVELS)), high.copy()
    body[start:stop] -= lowered
    for i, level in enumerate(LEVELS):
        above = body - level
        inside = start + np.flatnonzero(above[start:stop] > 0)
        if len(inside):
            first, last = int(inside[0]), int(inside[-1])
            before = above[first] / (above[first] - above[first - 1]) if first else 0.0
            after = above[last] / (above[last] - above[last + 1]) if last + 1 < len(above) else 0.0
            frames[i] = last - first + before + after
    return frames


def too_long(high: Float64Array, longest: Float64Array) -> Float64Array:
    """[T] body lengths by which a body is to be lowered in flights, so that none is above a level for longer than those
    that are recorded.

    Args:
        high: [T] as of `longest_flights`.
        longest: [T, L] frames that the class which is played in a frame has at most above each of `LEVELS`; a flight
            may have the most of what is played in it.
    """
    lowered = np.zeros(len(high))
    for start, stop in runs(high > 0):
        most = longest[start:stop].max(axis=0)
        if (_frames(high, start, stop, 0.0) <= most).all():
            continue
        enough, less = float(high[start:stop].max()), 0.0
        for _ in range(HALVINGS):
            middle = (enough + less) / 2
            enough, less = (middle, less) if (_frames(high, start, stop, middle) <= most).all() else (enough, middle)
        lowered[start:stop] = enough
    return lowered
