"""Kernels of `rotations`: apart from it, so that who only names a rotation waits for no compiler."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Final

from motionlake.kernels import njit

SMALL: Final = 1e-3  # radians: below, the sine's series is exact to the last digit


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


def _multiply(a, b, out):  # type: ignore[no-untyped-def]
    multiply_into(a, b, out)


def _rotate(q, v, out):  # type: ignore[no-untyped-def]
    rotate_into(q, v, out)


def _from_vector(vector, identity, out):  # type: ignore[no-untyped-def]
    square = vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]
    angle = math.sqrt(square)
    scale = math.sin(angle / 2.0) / angle if angle > SMALL else 0.5 - square / 48.0
    out[0] = math.cos(angle / 2.0)
    for i in range(3):
        out[i + 1] = scale * vector[i]


def _swing(u, v, limits, out):  # type: ignore[no-untyped-def]
    """With the half-way vector h, (u . h, u x h) is the unit quaternion; h vanishes for opposite directions."""
    shortest, opposite = limits[0], limits[1]
    out[0], out[1], out[2], out[3] = 1.0, 0.0, 0.0, 0.0
    length_u = math.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
    length_v = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    if not min(length_u, length_v) > shortest:
        return
    ux, uy, uz = u[0] / length_u, u[1] / length_u, u[2] / length_u
    hx, hy, hz = ux + v[0] / length_v, uy + v[1] / length_v, uz + v[2] / length_v
    length = math.sqrt(hx * hx + hy * hy + hz * hz)
    if length >= opposite:
        hx, hy, hz = hx / length, hy / length, hz / length
        out[0] = ux * hx + uy * hy + uz * hz
        out[1], out[2], out[3] = uy * hz - uz * hy, uz * hx - ux * hz, ux * hy - uy * hx
        return
    # Half a turn about u x e, of the axis e that u has least of.
    if abs(ux) <= abs(uy) and abs(ux) <= abs(uz):
        x, y, z = 0.0, uz, -uy
    elif abs(uy) <= abs(uz):
        x, y, z = -uz, 0.0, ux
    else:
        x, y, z = uy, -ux, 0.0
    length = math.sqrt(x * x + y * y + z * z)
    out[0], out[1], out[2], out[3] = 0.0, x / length, y / length, z / length


_OVER_AXES: Final = {
    "multiply": (_multiply, "(n),(n)->(n)"), "rotate": (_rotate, "(n),(m)->(m)"),
    "from_vector": (_from_vector, "(n),(m)->(m)"), "swing": (_swing, "(m),(m),(n)->(n)"),
}  # fmt: skip


@functools.cache
def over_axes(name: str) -> Callable[..., object]:
    """A kernel over leading axes, by name; made ready at the first call, which takes longer than all imports do."""
    from motionlake.compiler import guvectorize

    kernel, layout = _OVER_AXES[name]
    ready: Callable[..., object] = guvectorize(
        [", ".join(["float64[:]"] * layout.count("("))], layout, cache=True, nopython=True
    )(kernel)
    return ready
