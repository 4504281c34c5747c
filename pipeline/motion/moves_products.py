"""What windows of a track share when a piece is aligned with each: kernels of `moves_windows`.

A product of two vectors, one of them turned about y, is the sum of three that do not depend on the turn: `along` times
its cosine, `across` times its sine, and `up`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.kernels import njit
from motionlake.motion.moves import DISPLACEMENT_COUNT, HIPS, JOINTS_COUNT, MOST, SILENT, Track

_HIPS = HIPS.start
_SIDE = 32  # frames of the query side by side: loops of this constant length are compiled to the widest instructions
_TERMS = 9  # along, across and up, of displacements, velocities and joints


class Shared(NamedTuple):
    """Of the frames of a query [n] and those of a track [N]; the query's are in B = n / 32, rounded up, blocks of 32.

    Attributes:
        joints: [N, 45] of the track, less their mean.
        path: [N, 3] of the track, as moves have it.
        products: [N, B, 9 * 32] products of the query's displacements with joints, of its velocities with those of the
            track, and of its joints with those of the track, along, across and up each.
        started: [N, B, 3 * 32] of their paths.
        norms: [n] squared lengths of the query's frames.
        speeds, sizes: [N] squared lengths of the track's velocities, and of its joints without the path, as moves have
            them.
        facing: [N + 1, 2] sums of `Track.facing` before each frame.
    """

    joints: Float32Array
    path: Float32Array
    products: Float32Array
    started: Float32Array
    norms: Float32Array
    speeds: Float32Array
    sizes: Float32Array
    facing: Float64Array


def shared_of(query: Float32Array, track: Track) -> Shared:
    """Of the moves of a query [n, 135] and a track. Raises `ValueError` for a query of more frames than are aligned."""
    if len(query) > MOST:
        raise ValueError(f"a query of {len(query)} frames: at most {MOST} are aligned")
    found: Shared = shared_products(np.ascontiguousarray(query), track.joints, track.velocity, track.facing)
    return found


@njit(cache=True, nogil=True)
def shared_products(query: Float32Array, joints: Float64Array, velocity: Float64Array, facing: Float64Array) -> Shared:
    """Kernel of `shared_of`: joints [N, 45], velocity [N, 45] and facing [N, 2] of a track."""
    frames, width = joints.shape
    centred, placed = np.empty((frames, width), np.float32), np.empty((frames, width), np.float32)
    moved = velocity.astype(np.float32)
    for d in range(width):
        mean = 0.0
        for t in range(frames):
            mean += joints[t, d]
        mean /= frames
        for t in range(frames):
            centred[t, d] = joints[t, d] - mean
            placed[t, d] = JOINTS_COUNT * joints[t, d]
    path = placed[:, _HIPS : _HIPS + 3].copy()
    summed = np.zeros((frames + 1, 2))
    for t in range(frames):
        summed[t + 1] = summed[t] + facing[t]
    sizes = _squares(placed) - _squares(path)
    blocks, first = -(-len(query) // _SIDE), 2 * width
    products = np.zeros((frames, blocks, _TERMS * _SIDE), np.float32)
    _add_products(query[:, :width], centred, 0, products)
    _add_products(query[:, width:first], moved, 3, products)
    _add_products(query[:, first:], placed, 6, products)
    started = np.zeros((frames, blocks, 3 * _SIDE), np.float32)
    _add_products(query[:, first + _HIPS : first + _HIPS + 3], path, 0, started)
    return Shared(centred, path, products, started, _squares(query), _squares(moved), sizes, summed)


@njit(cache=True, nogil=True)
def _squares(rows: Float32Array) -> Float32Array:
    """[n] squared lengths of rows [n, d]."""
    found = np.zeros(len(rows), np.float32)
    for t in range(len(rows)):
        for d in range(rows.shape[1]):
            found[t] += rows[t, d] * rows[t, d]
    return found


@njit(cache=True, nogil=True, fastmath={"contract"})
def _add_products(query: Float32Array, track: Float32Array, term: int, found: Float32Array) -> None:
    """Add to three terms of found [N, B, terms * 32] along, across, up, of frames [n, D] and [N, D] of points."""
    blocks, width = found.shape[1], query.shape[1]
    columns = np.zeros((blocks, width * _SIDE), np.float32)
    for i in range(len(query)):
        for d in range(width):
            columns[i // _SIDE, d * _SIDE + i % _SIDE] = query[i, d]
    for t in range(len(track)):
        for block in range(blocks):
            sums = found[t, block, term * _SIDE : (term + 3) * _SIDE]
            for d in range(0, width, 3):
                point = columns[block, d * _SIDE : (d + 3) * _SIDE]
                _add_product(point, track[t, d], track[t, d + 1], track[t, d + 2], sums)


@njit(cache=True, nogil=True, fastmath={"contract"})
def _add_product(point: Float32Array, x: np.float32, y: np.float32, z: np.float32, sums: Float32Array) -> None:
    """Add to sums [96] those of a point [96] of frames of the query and one of a frame of the track."""
    for i in range(_SIDE):
        sums[i] += point[i] * x + point[i + 2 * _SIDE] * z
        sums[i + _SIDE] += point[i + 2 * _SIDE] * x - point[i] * z
        sums[i + 2 * _SIDE] += point[i + _SIDE] * y


@njit(cache=True, nogil=True)
def distances_of(shared: Shared, starts: Int64Array, width: int) -> Float64Array:
    """[s] distances of the query from the windows of one width that begin at some frames."""
    turns = np.empty((len(starts), 2), np.float32)
    for at in range(len(starts)):
        ahead, aside = shared.facing[starts[at] + width] - shared.facing[starts[at]]
        length = np.sqrt(ahead * ahead + aside * aside)
        turns[at, 0], turns[at, 1] = (ahead / length, aside / length) if length > SILENT else (1.0, 0.0)
    found = np.empty(len(starts), np.float32)
    _windows(shared, starts, turns, width, found)
    return (found / np.float32(len(shared.norms) + width)).astype(np.float64)


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def _windows(shared: Shared, starts: Int64Array, turns: Float32Array, width: int, out: Float32Array) -> None:
    """Kernel: summed costs of the cheapest paths from a query [n] to windows of a track [N], eight side by side.

    Args:
        shared: of both.
        starts: [s] of the windows.
        turns: [s, 2] cosine and sine of where each faces.
        width: frames of a window.
        out: [s].
    """
    products = shared.products
    n, blocks, zero, inf = len(shared.norms), products.shape[1], np.float32(0), np.float32(np.inf)
    # Of each window: what each of its frames adds, what products are multiplied by, and what each frame of the query
    # adds; distances of the query's frames from one of its frames, and the costs of paths to them.
    own, by = np.empty((8, width), np.float32), np.empty((8, _TERMS), np.float32)
    base, apart = np.empty((8, blocks, _SIDE), np.float32), np.zeros((8, blocks * _SIDE), np.float32)
    column, below, diagonal = np.empty(n * 8, np.float32), np.empty(8, np.float32), np.empty(8, np.float32)
    for first in range(0, len(starts), 8):
        lanes = min(8, len(starts) - first)
        for lane in range(lanes):
            _prepare(shared, starts[first + lane], turns[first + lane], own[lane], by[lane], base[lane])
        column[:] = inf
        for j in range(width):
            for lane in range(lanes):
                for block in range(blocks):
                    found = apart[lane, block * _SIDE : (block + 1) * _SIDE]
                    _apart(products[starts[first + lane] + j, block], base[lane, block], own[lane, j], by[lane], found)
            below[:] = inf
            diagonal[:] = inf if j else zero
            for i in range(n):
                for lane in range(8):
                    beside = column[i * 8 + lane]
                    cost = apart[lane, i] + min(below[lane], min(beside, diagonal[lane]))
                    diagonal[lane] = beside
                    below[lane] = cost
                    column[i * 8 + lane] = cost
        for lane in range(lanes):
            out[first + lane] = column[(n - 1) * 8 + lane]


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def _prepare(
    shared: Shared, start: int, turn: Float32Array, own: Float32Array, by: Float32Array, base: Float32Array
) -> None:
    """Kernel: what distances of frames from those of a window are made of.

    Args:
        shared: of the query and the track.
        start: of the window.
        turn: [2] cosine and sine of where it faces.
        own: [w] what each of its frames adds.
        by: [9] what products are multiplied by, those of displacements first.
        base: [B, 32] what each frame of the query adds.
    """
    joints, path, width, zero = shared.joints, shared.path, len(own), np.float32(0)
    last = start + width - 1
    posture = np.empty(joints.shape[1], np.float32)
    for d in range(len(posture)):
        posture[d] = (joints[start, d] + joints[start + 1, d] + joints[last - 1, d] + joints[last, d]) / 4
    spread, speed = zero, zero
    for j in range(width):
        far = zero
        for d in range(len(posture)):
            far += (joints[start + j, d] - posture[d]) ** 2
        own[j] = far
        spread += far
        speed += shared.speeds[start + j]
    root = max(np.sqrt(spread / width), SILENT) / DISPLACEMENT_COUNT
    rate = max(np.sqrt(speed / width), SILENT)
    for j in range(width):
        way = zero
        for d in range(3):
            way += (path[start + j, d] - path[start, d]) ** 2
        own[j] = own[j] / (root * root) + shared.speeds[start + j] / (rate * rate)
        own[j] += shared.sizes[start + j] + way
    cosine, sine = turn[0], turn[1]
    by[0], by[1], by[2] = 2 * cosine / root, 2 * sine / root, 2 / root
    by[3], by[4], by[5] = 2 * cosine / rate, 2 * sine / rate, 2 / rate
    by[6], by[7], by[8] = 2 * cosine, 2 * sine, 2
    for block in range(len(base)):
        begin = shared.products[start, block], shared.products[start + 1, block]
        end = shared.products[last - 1, block], shared.products[last, block]
        _base(*begin, *end, shared.started[start, block], by, base[block])
    for i in range(len(shared.norms)):
        base[i // _SIDE, i % _SIDE] += shared.norms[i]


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def _base(
    first: Float32Array, second: Float32Array, before: Float32Array, last: Float32Array, started: Float32Array,
    by: Float32Array, found: Float32Array,
) -> None:  # fmt: skip
    """Kernel: what frames of the query [32] add to their distances from those of a window, but for their own lengths.

    Args:
        first, second, before, last: [9 * 32] products of two frames at either end of the window, as `Shared` has them.
        started: [3 * 32] of its first frame.
        by: [9] what products are multiplied by.
        found: [32].
    """
    a, b, c, g, h, k = by[0] / 4, by[1] / 4, by[2] / 4, by[6], by[7], by[8]
    for i in range(_SIDE):
        ends = a * (first[i] + second[i] + before[i] + last[i])
        ends += b * (first[i + _SIDE] + second[i + _SIDE] + before[i + _SIDE] + last[i + _SIDE])
        ends += c * (first[i + 2 * _SIDE] + second[i + 2 * _SIDE] + before[i + 2 * _SIDE] + last[i + 2 * _SIDE])
        found[i] = ends + g * started[i] + h * started[i + _SIDE] + k * started[i + 2 * _SIDE]


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def _apart(products: Float32Array, base: Float32Array, own: np.float32, by: Float32Array, found: Float32Array) -> None:
    """Kernel: distances [32] of frames of the query from one of a window.

    Args:
        products: [9 * 32] of the frames, as `Shared` has them.
        base: [32] what each frame of the query adds.
        own: what that of the window adds.
        by: [9] what products are multiplied by.
        found: [32].
    """
    a, b, c, d, e, f, g, h, k = by[0], by[1], by[2], by[3], by[4], by[5], by[6], by[7], by[8]
    for i in range(_SIDE):
        near = (
            a * products[i]
            + b * products[i + _SIDE]
            + c * products[i + 2 * _SIDE]
            + d * products[i + 3 * _SIDE]
            + e * products[i + 4 * _SIDE]
        )
        near += (
            f * products[i + 5 * _SIDE]
            + g * products[i + 6 * _SIDE]
            + h * products[i + 7 * _SIDE]
            + k * products[i + 8 * _SIDE]
        )
        found[i] = np.sqrt(max(base[i] + own - near, np.float32(0)))
