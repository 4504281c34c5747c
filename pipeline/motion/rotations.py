"""Unit quaternions (w, x, y, z), float64: vectorised over leading axes, with numba kernels where it is hot.

A rotation turns a vector v into q v q*; `multiply(a, b)` turns by b first.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray
from numba import guvectorize, njit

IDENTITY: Final = np.array([1.0, 0.0, 0.0, 0.0])
_AXES: Final = "XYZ"
_POLE: Final = 1e-7


@njit(cache=True, inline="always")
def multiply_into(a, b, out):  # type: ignore[no-untyped-def]
    """Kernel: out = a b; `out` may be `a` or `b`."""
    w = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
    x = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2]
    y = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1]
    z = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]
    out[0], out[1], out[2], out[3] = w, x, y, z


@njit(cache=True, inline="always")
def rotate_into(q, v, out):  # type: ignore[no-untyped-def]
    """Kernel: out = v turned by q; `out` may be `v`."""
    s = 2.0 * (q[2] * v[2] - q[3] * v[1])
    t = 2.0 * (q[3] * v[0] - q[1] * v[2])
    u = 2.0 * (q[1] * v[1] - q[2] * v[0])
    x = v[0] + q[0] * s + q[2] * u - q[3] * t
    y = v[1] + q[0] * t + q[3] * s - q[1] * u
    z = v[2] + q[0] * u + q[1] * t - q[2] * s
    out[0], out[1], out[2] = x, y, z


@guvectorize(["float64[:], float64[:], float64[:]"], "(n),(n)->(n)", cache=True, nopython=True)
def _multiply(a, b, out):  # type: ignore[no-untyped-def]
    multiply_into(a, b, out)


@guvectorize(["float64[:], float64[:], float64[:]"], "(n),(m)->(m)", cache=True, nopython=True)
def _rotate(q, v, out):  # type: ignore[no-untyped-def]
    rotate_into(q, v, out)


def multiply(a: Float64Array, b: Float64Array) -> Float64Array:
    """Product a b of quaternions [..., 4], broadcast."""
    product: Float64Array = _multiply(a, b)
    return product


def rotate(q: Float64Array, v: Float64Array) -> Float64Array:
    """Vectors v [..., 3] turned by q [..., 4], broadcast."""
    turned: Float64Array = _rotate(q, v)
    return turned


def conjugate(q: Float64Array) -> Float64Array:
    """Inverse of unit quaternions [..., 4]."""
    inverse: Float64Array = q * np.array([1.0, -1.0, -1.0, -1.0])
    return inverse


def normalise(q: Float64Array) -> Float64Array:
    """Quaternions or vectors [..., n] scaled to length 1; `ValueError` where one has no length."""
    length = np.linalg.norm(q, axis=-1, keepdims=True)
    if not (length > 0).all():
        raise ValueError("a vector of length zero has no direction")
    unit: Float64Array = q / length
    return unit


def from_axis_angle(axis: Float64Array, degrees: Float64Array | float) -> Float64Array:
    """Rotation [..., 4] by `degrees` [...] about unit `axis` [..., 3]."""
    half = np.deg2rad(np.asarray(degrees, float)) / 2
    axis = np.asarray(axis, float)
    vector = np.sin(half)[..., None] * axis
    return np.concatenate([np.broadcast_to(np.cos(half)[..., None], (*vector.shape[:-1], 1)), vector], -1)


def from_euler(degrees: Float64Array, order: str, fixed: bool = False) -> Float64Array:
    """Rotations [..., 4] from Euler angles.

    Args:
        degrees: [..., n] angles, n = len(order).
        order: axis letters such as "ZYX".
        fixed: False: each turn is about an axis that the ones before have turned (BVH; the product runs left
            to right). True: about axes that stay (ASF; right to left).
    """
    degrees = np.asarray(degrees, float)
    result = np.broadcast_to(IDENTITY, (*degrees.shape[:-1], 4))
    for i, letter in enumerate(order.upper()):
        turn = from_axis_angle(np.eye(3)[_AXES.index(letter)], degrees[..., i])
        result = multiply(turn, result) if fixed else multiply(result, turn)
    return result


def to_euler(q: Float64Array, order: str) -> Float64Array:
    """Euler angles in degrees [..., 3] of q [..., 4]: the inverse of `from_euler(..., order)`, not fixed.

    After E. Bernardes and S. Viollet, "Quaternion to Euler angles conversion" (2022). At the pole, where only
    the sum or difference of the outer angles is defined, the last one is zero. The outer angles lie in
    [-180, 180], the middle one in [-90, 90], or [0, 180] where the first axis is also the last.

    Args:
        q: [..., 4].
        order: any three axis letters of which no two neighbours are equal.
    """
    # The method is for fixed axes; turning about moving ones is the same in the opposite order.
    i, j, k = (_AXES.index(letter) for letter in reversed(order.upper()))
    proper = i == k
    k = 3 - i - j if proper else k
    sign = (i - j) * (j - k) * (k - i) / 2
    w, vector = q[..., 0], q[..., 1:]
    x, y, z = vector[..., i], vector[..., j], sign * vector[..., k]
    a, b, c, d = (w, x, y, z) if proper else (w - y, x + z, y + w, z - x)
    middle = 2 * np.arctan2(np.hypot(c, d), np.hypot(a, b))
    plus, minus = np.arctan2(b, a), np.arctan2(d, c)
    low, high = middle < _POLE, middle > np.pi - _POLE
    first = np.where(low | high, 0.0, plus - minus)
    third = np.where(low, 2 * plus, np.where(high, 2 * minus, plus + minus))
    if not proper:
        third, middle = sign * third, middle - np.pi / 2
    angles = np.stack([third, middle, first], -1)
    angles[..., ::2] = (angles[..., ::2] + np.pi) % (2 * np.pi) - np.pi
    degrees: Float64Array = np.rad2deg(angles)
    return degrees


def to_matrix(q: Float64Array) -> Float64Array:
    """Rotation matrices [..., 3, 3] of q [..., 4]."""
    columns = [rotate(q, axis) for axis in np.eye(3)]
    return np.stack(columns, -1)


def from_matrix(matrix: Float64Array) -> Float64Array:
    """Rotations [..., 4], w >= 0, of proper rotation matrices [..., 3, 3]."""
    m = np.asarray(matrix, float)
    trace = m[..., 0, 0] + m[..., 1, 1] + m[..., 2, 2]
    outer = np.empty((*m.shape[:-2], 4, 4))
    # The rows are 4 w q, 4 x q, 4 y q and 4 z q; the longest row is the best conditioned.
    outer[..., 0, 0] = 1 + trace
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        outer[..., a + 1, a + 1] = 1 + 2 * m[..., a, a] - trace
        outer[..., 0, a + 1] = outer[..., a + 1, 0] = m[..., c, b] - m[..., b, c]
        outer[..., a + 1, b + 1] = outer[..., b + 1, a + 1] = m[..., a, b] + m[..., b, a]
    longest = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), -1)
    q = normalise(np.take_along_axis(outer, longest[..., None, None], -2)[..., 0, :])
    return np.where(q[..., :1] < 0, -q, q)


def swing(u: Float64Array, v: Float64Array) -> Float64Array:
    """The smallest rotation [..., 4] that turns direction u [..., 3] into direction v [..., 3].

    For opposite directions the axis is one perpendicular to u, always the same for the same u.

    Raises:
        ValueError: a direction of length zero.
    """
    u, v = np.broadcast_arrays(normalise(np.asarray(u, float)), normalise(np.asarray(v, float)))
    # With the half-way vector h, (u . h, u x h) is the unit quaternion; h vanishes for opposite directions.
    half = u + v
    length = np.linalg.norm(half, axis=-1, keepdims=True)
    opposite = length < _POLE
    side = np.cross(u, np.eye(3)[np.argmin(np.abs(u), -1)])
    half = np.where(opposite, 0.0, half / np.where(opposite, 1.0, length))
    cosine = np.sum(u * half, -1, keepdims=True)
    axis = np.where(opposite, side / np.linalg.norm(side, axis=-1, keepdims=True), np.cross(u, half))
    return np.concatenate([cosine, axis], -1)


def angle(a: Float64Array, b: Float64Array) -> Float64Array:
    """Angle in degrees [...] of the rotation between a and b [..., 4], in [0, 180]."""
    relative = multiply(conjugate(a), b)
    half = np.arctan2(np.linalg.norm(relative[..., 1:], axis=-1), np.abs(relative[..., 0]))
    degrees: Float64Array = np.rad2deg(2 * half)
    return degrees


def continuous(q: Float64Array) -> Float64Array:
    """q [F, ..., 4] with signs such that no frame is farther from the one before than its opposite is."""
    flips = np.sum(q[1:] * q[:-1], -1) < 0
    signs = np.where(np.cumsum(flips, axis=0) % 2 == 1, -1.0, 1.0)
    result: Float64Array = q.copy()
    result[1:] *= signs[..., None]
    return result


def turn_on_ground(x: FloatArray, z: FloatArray, angles: FloatArray | float) -> tuple[Float64Array, Float64Array]:
    """Ground coordinates turned about +y, the vertical, by angles in radians (broadcast); +z turns towards +x."""
    cos, sin = np.cos(angles), np.sin(angles)
    return x * cos + z * sin, z * cos - x * sin


def turn_about_y(vectors: FloatArray, angles: FloatArray | float) -> Float64Array:
    """Vectors [T, ..., 3] turned about +y by angles [T], or all by one angle, in radians."""
    each = np.reshape(angles, (*np.shape(angles), *[1] * (vectors.ndim - 1 - np.ndim(angles))))
    x, z = turn_on_ground(vectors[..., 0], vectors[..., 2], each)
    return np.stack([x, vectors[..., 1], z], axis=-1)
