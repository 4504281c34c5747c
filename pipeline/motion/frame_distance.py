"""Distances between single frames of motion words; both metrics are squares.

- "euclidean": sum over the D features of the squared difference;
- "geodesic": Deep Motifs, equation 3, sum over the joints of ||log(q_j^-1 q_i)||^2, the squared angle between
  unit quaternions on S3 (half the rotation's angle), q and -q being one rotation.

Both are float32. They come from inner products, hence carry an absolute error of about 1e-6 times the squared
norms of the (centred) features, or 2e-6 rad^2 a joint.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from motionlake.motion.features import Float32Array
from numba import njit
from numpy.typing import NDArray

Metric = Literal["euclidean", "geodesic"]


def _acos_squared_coefficients(degree: int = 7) -> tuple[float, ...]:
    """Polynomial p, lowest power first, with acos(1 - x)^2 = x p(x) on 0 <= x <= 1.

    acos(1 - x)^2 is analytic up to x = 2, so a Chebyshev fit converges fast and needs no square root.
    """

    def target(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.arccos(1 - x) ** 2 / x

    fit = np.polynomial.Chebyshev.interpolate(target, degree, domain=[0.0, 1.0])
    return tuple(float(c) for c in fit.convert(kind=np.polynomial.Polynomial).coef)


_P0, _P1, _P2, _P3, _P4, _P5, _P6, _P7 = (np.float32(c) for c in _acos_squared_coefficients())


def frame_distances(a: Float32Array, b: Float32Array, metric: Metric = "euclidean") -> Float32Array:
    """[R, C] squared distances between frames `a` [R, D] and `b` [C, D]."""
    left, right = operands(a, b, metric)
    return np.maximum(product(left, np.ascontiguousarray(right.T), metric), np.float32(0))


def operands(a: Float32Array, b: Float32Array, metric: Metric) -> tuple[Float32Array, Float32Array]:
    """Rows whose `product` is the frame distance.

    Squared Euclidean distance as one inner product: [-2a, |a|^2, 1] . [b, 1, |b|^2]. Centring on the mean
    of `a` changes no distance and keeps the cancellation small.
    """
    if metric == "geodesic":
        return np.ascontiguousarray(a, dtype=np.float32), np.ascontiguousarray(b, dtype=np.float32)
    centre = a.mean(axis=0, dtype=np.float64).astype(np.float32) if len(a) else np.float32(0)
    a, b = a - centre, b - centre
    norm_a, norm_b = np.einsum("rd,rd->r", a, a), np.einsum("rd,rd->r", b, b)
    left = np.column_stack([np.float32(-2) * a, norm_a, np.ones_like(norm_a)])
    return left, np.column_stack([b, np.ones_like(norm_b), norm_b])


def product(left: Float32Array, right: Float32Array, metric: Metric) -> Float32Array:
    """[R, C] frame distances of operands [R, E] and [E, C]; may be a rounding error below zero."""
    if metric == "euclidean":
        return left @ right
    if metric == "geodesic":
        distances = np.empty((left.shape[0], right.shape[1]), dtype=np.float32)
        squared_geodesics(left, right, distances)
        return distances
    raise ValueError(f"metric is {metric!r}, not euclidean or geodesic")


@njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator]
def squared_geodesics(a: Float32Array, b: Float32Array, out: Float32Array) -> None:
    """out[r, c] = sum over joints of acos(|a_r . b_c|)^2; a [R, 4J], b [4J, C]."""
    n_joints = a.shape[1] // 4
    n_rows, n_columns = out.shape
    tile = 64
    total = np.empty(tile, dtype=np.float32)
    one, zero = np.float32(1), np.float32(0)
    for first in range(0, n_columns, tile):
        width = min(tile, n_columns - first)
        for r in range(n_rows):
            total[:] = zero
            for joint in range(n_joints):
                w, x, y, z = a[r, 4 * joint], a[r, 4 * joint + 1], a[r, 4 * joint + 2], a[r, 4 * joint + 3]
                b_w = b[4 * joint, first : first + width]
                b_x = b[4 * joint + 1, first : first + width]
                b_y = b[4 * joint + 2, first : first + width]
                b_z = b[4 * joint + 3, first : first + width]
                for c in range(width):
                    gap = max(zero, one - abs(w * b_w[c] + x * b_x[c] + y * b_y[c] + z * b_z[c]))
                    series = _P0 + gap * (
                        _P1 + gap * (_P2 + gap * (_P3 + gap * (_P4 + gap * (_P5 + gap * (_P6 + gap * _P7)))))
                    )
                    total[c] += gap * series
            out[r, first : first + width] = total[:width]
