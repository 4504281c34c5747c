"""Key frames: at which even instants to sample them, and what lies between two keys."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, Int64Array
from motionlake.errors import ClipError
from motionlake.formats.clip_checks import MAX_FPS
from motionlake.motion.rotations import MIN_LENGTH, slerp

SPARSE_FPS: Final = 30.0
SLOWEST: Final = 10.0  # keys that are rarer are poses between which something else was meant to move
FILLED: Final = 0.5  # least share of the even instants that have a key
ROUNDING: Final = 1e-3  # of a rate: keys are single precision, in seconds
LATE: Final = 0.1  # of a frame: how far after the last key an instant may be
SNAP: Final = 1e-5  # seconds: an instant so near before a key is at the key


def even_rate(keys: Float64Array, sparse: float = SPARSE_FPS) -> tuple[float, str]:
    """Frames a second for keys [K] at growing times, and why: the keys' most common interval, else `sparse`."""
    steps = np.diff(keys)
    steps = steps[steps > 1 / MAX_FPS]
    if len(steps):
        counted, counts = np.unique(np.round(steps, 4), return_counts=True)
        about = counted[counts.argmax()]
        rate = whole_rate(1 / float(np.median(steps[np.abs(steps - about) <= 1e-4])))
        if rate >= SLOWEST and len(keys) >= FILLED * (keys[-1] - keys[0]) * rate:
            return rate, f"sampled {rate:.6g} times a second, as the keys are apart"
    return sparse, f"keys are sparse: sampled {sparse:g} times a second"


def whole_rate(rate: float) -> float:
    """The whole number that a rate is nearly, if it is not rather 23.976, 29.97 or 59.94."""
    near = float(round(rate))
    return near if near and abs(rate / near - 1) < ROUNDING and not _is_ntsc(rate) else rate


def _is_ntsc(rate: float) -> bool:
    """Whether it is nearer to 23.976, 29.97 or 59.94 than to the whole number above."""
    above = np.ceil(rate)
    return bool(abs(rate - above / 1.001) < abs(rate - above) / 2)


def even_count(keys: Float64Array, fps: float) -> int:
    """How many instants there are from the first of the keys [K], growing, to the last."""
    if not len(keys) or not np.isfinite(keys).all() or keys[-1] - keys[0] > 1e9:
        raise ClipError("has keys whose times are no numbers")
    return int(np.floor((keys[-1] - keys[0]) * fps + LATE)) + 1


def sample(times: Float64Array, values: Float64Array, at: Float64Array, how: str, rotation: bool) -> Float64Array:
    """[T, n] a track at instants; before its first key and after its last it holds still.

    Args:
        times: [K] of the keys, seconds, growing.
        values: [K, n]; of "CUBICSPLINE" [3 K, n], each key's tangent in, value and tangent out, as glTF has them.
        at: [T] seconds.
        how: "LINEAR", "STEP" or "CUBICSPLINE".
        rotation: whether values are quaternions: those are interpolated on arcs, and normalised.

    Raises:
        ClipError: no keys, times that do not grow, numbers that do not fit, or a rotation of length zero.
    """
    count = len(times)
    if not count or len(values) != (3 * count if how == "CUBICSPLINE" else count):
        raise ClipError(f"has a track of {count} keys with {len(values)} values")
    if not np.isfinite(times).all() or (np.diff(times) < 0).any():
        raise ClipError("has a track whose times do not grow")
    if rotation:
        values = _unit(values, how)
    before = np.clip(np.searchsorted(times, at + SNAP, side="right") - 1, 0, count - 1)
    if how == "STEP" or count == 1:
        return values[before] if how != "CUBICSPLINE" else values[3 * before + 1]
    if how == "LINEAR" and (np.abs(at - times[before]) <= SNAP).all():
        return values[before]  # as most programs write: a key at every instant
    before = np.minimum(before, count - 2)
    span = times[before + 1] - times[before]
    share = np.clip((at - times[before]) / np.where(span > 0, span, 1.0), 0.0, 1.0)
    if how == "CUBICSPLINE":
        return _hermite(values.reshape(count, 3, -1), before, span, share, rotation)
    if rotation:
        return slerp(values[before], values[before + 1], share)
    return np.asarray(values[before] + share[:, None] * (values[before + 1] - values[before]))


def _hermite(
    keys: Float64Array, before: Int64Array, span: Float64Array, share: Float64Array, rotation: bool
) -> Float64Array:
    """Cubic splines of keys [K, 3, n]: each key's tangent in, value, tangent out."""
    t, d = share[:, None], span[:, None]
    start, end = keys[before], keys[before + 1]
    value = (2 * t**3 - 3 * t**2 + 1) * start[:, 1] + d * (t**3 - 2 * t**2 + t) * start[:, 2]
    value = value + (3 * t**2 - 2 * t**3) * end[:, 1] + d * (t**3 - t**2) * end[:, 0]
    return _unit(value, "") if rotation else value


def _unit(values: Float64Array, how: str) -> Float64Array:
    """Quaternions scaled to length 1, of cubic splines those that are no tangents."""
    lengths = np.linalg.norm(values, axis=-1, keepdims=True)
    if how == "CUBICSPLINE":
        lengths[0::3] = lengths[2::3] = 1.0
    if not (lengths > MIN_LENGTH).all():
        raise ClipError("has a rotation of length zero")
    return np.asarray(values / lengths)
