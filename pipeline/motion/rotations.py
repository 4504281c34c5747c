"""Unit quaternions (w, x, y, z), float64: vectorised over leading axes.

A rotation turns a vector v into q v q*; `multiply(a, b)` turns by b first.
"""

from __future__ import annotations

import warnings
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray

IDENTITY: Final = np.array([1.0, 0.0, 0.0, 0.0])
MIN_LENGTH: Final = 1e-9  # of a vector that has a direction
OPPOSITE: Final = 1e-7  # length of the sum of two unit vectors that are taken for opposite
_LIMITS: Final = np.array([MIN_LENGTH, OPPOSITE, 0.0, 0.0])


def multiply(a: Float64Array, b: Float64Array) -> Float64Array:
    """Product a b of quaternions [..., 4], broadcast."""
    from motionlake.motion.rotation_kernels import over_axes

    return np.asarray(over_axes("multiply")(a, b))


def rotate(q: Float64Array, v: Float64Array) -> Float64Array:
    """Vectors v [..., 3] turned by q [..., 4], broadcast."""
    from motionlake.motion.rotation_kernels import over_axes

    return np.asarray(over_axes("rotate")(q, v))


def conjugate(q: Float64Array) -> Float64Array:
    """Inverse of unit quaternions [..., 4]."""
    return np.asarray(q * np.array([1.0, -1.0, -1.0, -1.0]))


def normalise(q: Float64Array) -> Float64Array:
    """Quaternions or vectors [..., n] scaled to length 1."""
    return np.asarray(q / np.linalg.norm(q, axis=-1, keepdims=True))


def of_length_one(vectors: Float64Array) -> Float64Array:
    """Vectors [..., n] scaled to length 1; one without length stays."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1.0))


def from_vectors(vectors: Float64Array, out: Float64Array | None = None) -> Float64Array:
    """Rotations [..., 4] about vectors [..., 3], by their lengths in radians; put into `out` where that is given."""
    from motionlake.motion.rotation_kernels import over_axes

    return np.asarray(over_axes("from_vector")(vectors, IDENTITY, out=out))


def to_vectors(q: Float64Array) -> Float64Array:
    """Rotation vectors [..., 3], radians, of unit quaternions [..., 4]: the shorter way round."""
    near = np.where(q[..., :1] < 0, -q, q)
    sine = np.linalg.norm(near[..., 1:], axis=-1, keepdims=True)
    angles = 2 * np.arctan2(sine, near[..., :1])
    return np.asarray(near[..., 1:] * np.where(sine > MIN_LENGTH, angles / np.maximum(sine, MIN_LENGTH), 2.0))


def from_axis_angle(axis: Float64Array, degrees: Float64Array | float) -> Float64Array:
    """Rotation [..., 4] by `degrees` [...] about unit `axis` [..., 3]."""
    half = np.deg2rad(np.asarray(degrees, float)) / 2
    axis = np.asarray(axis, float)
    vector = np.sin(half)[..., None] * axis
    return np.concatenate([np.broadcast_to(np.cos(half)[..., None], (*vector.shape[:-1], 1)), vector], -1)


def from_euler(degrees: Float64Array, order: str, fixed: bool = False) -> Float64Array:
    """Rotations [..., 4] from Euler angles [..., n] about the axes named by `order`, n letters such as "ZYX".

    `fixed`: about axes that stay (ASF), not about axes that the turns before have turned (BVH).
    """
    from scipy.spatial.transform import Rotation

    degrees = np.asarray(degrees, float)
    turns = Rotation.from_euler(order.lower() if fixed else order.upper(), _rows(degrees, 1), degrees=True)
    return np.reshape(turns.as_quat(scalar_first=True), (*degrees.shape[:-1], 4))


def to_euler(q: Float64Array, order: str) -> Float64Array:
    """Euler angles in degrees [..., 3] of q [..., 4]: the inverse of `from_euler(..., order)`, not fixed.

    At the pole, where only the sum or difference of the outer angles is defined, the last one is zero. The outer
    angles lie in [-180, 180], the middle one in [-90, 90], or [0, 180] where the first axis is also the last.

    Args:
        q: [..., 4].
        order: any three axis letters of which no two neighbours are equal.
    """
    from scipy.spatial.transform import Rotation

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # at the pole
        angles = Rotation.from_quat(_rows(q, 1), scalar_first=True).as_euler(order.upper(), degrees=True)
    return np.reshape(angles, (*q.shape[:-1], 3))


def to_matrix(q: Float64Array) -> Float64Array:
    """Rotation matrices [..., 3, 3] of q [..., 4]."""
    return np.stack([rotate(q, axis) for axis in np.eye(3)], -1)


def from_matrix(matrix: Float64Array) -> Float64Array:
    """Rotations [..., 4], w >= 0, of proper rotation matrices [..., 3, 3]."""
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_matrix(_rows(matrix, 2)).as_quat(canonical=True, scalar_first=True)
    return np.reshape(turns, (*matrix.shape[:-2], 4))


def _rows(values: Float64Array, inner: int) -> Float64Array:
    """All but the last `inner` axes as one, as older versions of SciPy take them."""
    return values.reshape(-1, *values.shape[values.ndim - inner :])


def swing(u: Float64Array, v: Float64Array) -> Float64Array:
    """The smallest rotation [..., 4] that turns direction u [..., 3] into direction v [..., 3]; none where one is zero.

    For opposite directions the axis is one perpendicular to u, always the same for the same u.
    """
    from motionlake.motion.rotation_kernels import over_axes

    return np.asarray(over_axes("swing")(u, v, _LIMITS))


def slerp(a: Float64Array, b: Float64Array, weight: Float64Array) -> Float64Array:
    """Unit quaternions [..., 4] on the shortest arc from a to b; `weight` [...] from 0 to 1, exact at both ends."""
    cosine = np.sum(a * b, axis=-1)
    b = np.where((cosine < 0)[..., None], -b, b)
    half = np.arccos(np.clip(np.abs(cosine), 0.0, 1.0))
    sine = np.sin(half)
    near = sine < 1e-6
    safe = np.where(near, 1.0, sine)
    left = np.where(near, 1 - weight, np.sin((1 - weight) * half) / safe)
    right = np.where(near, weight, np.sin(weight * half) / safe)
    mixed = left[..., None] * a + right[..., None] * b
    return np.asarray(mixed / np.linalg.norm(mixed, axis=-1, keepdims=True))


def angle(a: Float64Array, b: Float64Array) -> Float64Array:
    """Angle in degrees [...] of the rotation between a and b [..., 4], in [0, 180]."""
    relative = multiply(conjugate(a), b)
    half = np.arctan2(np.linalg.norm(relative[..., 1:], axis=-1), np.abs(relative[..., 0]))
    return np.asarray(np.rad2deg(2 * half))


def turn_on_ground(x: FloatArray, z: FloatArray, angles: FloatArray | float) -> tuple[Float64Array, Float64Array]:
    """Ground coordinates turned about +y, the vertical, by angles in radians (broadcast); +z turns towards +x."""
    cos, sin = np.cos(angles), np.sin(angles)
    return x * cos + z * sin, z * cos - x * sin


def turn_about_y(vectors: FloatArray, angles: FloatArray | float) -> Float64Array:
    """Vectors [T, ..., 3] turned about +y by angles [T], or all by one angle, in radians."""
    each = np.reshape(angles, (*np.shape(angles), *[1] * (vectors.ndim - 1 - np.ndim(angles))))
    x, z = turn_on_ground(vectors[..., 0], vectors[..., 2], each)
    return np.stack([x, vectors[..., 1], z], axis=-1)
