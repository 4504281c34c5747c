"""A motion resampled, smoothed and seen from the body, in one kernel (DeepHuMS, section 3.3.2)."""

from __future__ import annotations

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.kernels import njit


@njit(cache=True, nogil=True)
def seen_from_body(
    positions: Float64Array,
    count: int,
    smoothing: Float64Array,
    joints: Int64Array,
    root: Int64Array,
    sides: Int64Array,
    bones: Int64Array,
    share: float,
    least: float,
) -> Float32Array:
    """[count, J, 3] joints in body lengths, seen from the body, the path of the root in the place of the first.

    Args:
        positions: [F, K, 3] metres.
        count: frames that the motion is resampled to, from its first to its last.
        smoothing: [W, W] row i has the weights of W frames in a row for the smoothed i-th of them; not applied to
            fewer frames.
        joints: [J] which of the K are read; -1: missing, which gives zeros.
        root: of the J joints those whose mean is the root.
        sides: [S, 2] left and right joints that tell where the body faces.
        bones: [B, 2] joints whose distances make up the body's size.
        share: what they are together in an average body, in body lengths; 0: the size is a metre.
        least: of the side's direction, the length on the ground from which on it tells where the body faces.
    """
    moved = _smoothed(_resampled(positions, joints, count), smoothing)
    path = np.zeros((count, 3))
    for t in range(count):
        for axis in range(3):
            for j in root:
                path[t, axis] += moved[t, j, axis] / len(root)
    yaw, size = _facing(moved, sides, least), _size(moved, bones, share)
    cos, sin = np.cos(yaw) / size, np.sin(yaw) / size
    body = np.zeros((count, len(joints), 3), dtype=np.float32)
    for t in range(count):
        for j in range(len(joints)):
            if joints[j] >= 0:
                x, y, z = moved[t, j] - path[t] if j else path[t] - path[0]
                body[t, j, 0], body[t, j, 1], body[t, j, 2] = x * cos - z * sin, y / size, x * sin + z * cos
    return body


@njit(cache=True, nogil=True)
def _resampled(positions: Float64Array, joints: Int64Array, count: int) -> Float64Array:
    """[count, J, 3] by linear interpolation at even places from the first frame to the last."""
    frames = len(positions)
    found = np.zeros((count, len(joints), 3))
    step = (frames - 1) / (count - 1) if count > 1 else 0.0
    for t in range(count):
        at = t * step if t < count - 1 or count == 1 else frames - 1.0
        before = min(int(at), max(0, frames - 2))
        after, part = min(before + 1, frames - 1), at - before
        for j in range(len(joints)):
            if joints[j] >= 0:
                for axis in range(3):
                    found[t, j, axis] = (
                        positions[before, joints[j], axis] * (1 - part) + positions[after, joints[j], axis] * part
                    )
    return found


@njit(cache=True, nogil=True)
def _smoothed(moved: Float64Array, smoothing: Float64Array) -> Float64Array:
    count, width = len(moved), len(smoothing)
    if count < width:
        return moved
    found = np.zeros_like(moved)
    for t in range(count):
        first = min(max(t - width // 2, 0), count - width)
        for k in range(width):
            weight = smoothing[t - first, k]
            for j in range(moved.shape[1]):
                for axis in range(3):
                    found[t, j, axis] += weight * moved[first + k, j, axis]
    return found


@njit(cache=True, nogil=True)
def _facing(moved: Float64Array, sides: Int64Array, least: float) -> float:
    """Median angle in radians about +y from +z; 0 where no frame tells."""
    angles = np.empty(len(moved))
    found = 0
    for t in range(len(moved)):
        x = z = 0.0
        for s in range(len(sides)):
            across = moved[t, sides[s, 0]] - moved[t, sides[s, 1]]
            length = max(np.sqrt((across * across).sum()), 1e-12)
            x += across[0] / length / len(sides)
            z += across[2] / length / len(sides)
        if np.hypot(x, z) > least:
            angle = np.arctan2(-z, x)
            if found:
                turn = (angle - angles[found - 1] + np.pi) % (2 * np.pi) - np.pi
                angle = angles[found - 1] + turn
            angles[found] = angle
            found += 1
    return float(np.median(angles[:found])) if found else 0.0


@njit(cache=True, nogil=True)
def _size(moved: Float64Array, bones: Int64Array, share: float) -> float:
    """Metres: the sum of the bones' median lengths over what they are together in an average body."""
    total = 0.0
    lengths = np.empty(len(moved))
    for b in range(len(bones)):
        for t in range(len(moved)):
            across = moved[t, bones[b, 0]] - moved[t, bones[b, 1]]
            lengths[t] = np.sqrt((across * across).sum())
        total += np.median(lengths)
    return total / share if total > 0 else 1.0
