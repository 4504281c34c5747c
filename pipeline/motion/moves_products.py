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


class Shared(NamedTuple):
    """Of the frames of a query [n] and those of a track [N].

    Attributes:
        joints: [N, 45] of the track, less their mean.
        path: [N, 3] of the track, as moves have it.
        displaced, moving, placed: [n, N, 3] products of the query's displacements with joints, of its velocities with
            those of the track, and of its joints with those of the track.
        started: [n, N, 3] of their paths.
        norms: [n] squared lengths of the query's frames.
        speeds, sizes: [N] squared lengths of the track's velocities, and of its joints without the path, as moves have
            them.
        facing: [N + 1, 2] sums of `Track.facing` before each frame.
    """

    joints: Float32Array
    path: Float32Array
    displaced: Float32Array
    moving: Float32Array
    placed: Float32Array
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
    first = 2 * width
    return Shared(
        centred, path, _products(query[:, :width], centred), _products(query[:, width:first], moved),
        _products(query[:, first:], placed), _products(query[:, first + _HIPS : first + _HIPS + 3], path),
        _squares(query), _squares(moved), sizes, summed,
    )  # fmt: skip


@njit(cache=True, nogil=True)
def _squares(rows: Float32Array) -> Float32Array:
    """[n] squared lengths of rows [n, d]."""
    found = np.zeros(len(rows), np.float32)
    for t in range(len(rows)):
        for d in range(rows.shape[1]):
            found[t] += rows[t, d] * rows[t, d]
    return found


@njit(cache=True, nogil=True, fastmath={"contract"})
def _products(query: Float32Array, track: Float32Array) -> Float32Array:
    """[n, N, 3] along, across, up, of frames [n, D] and [N, D] of points."""
    count, frames = len(query), len(track)
    columns = track.T.copy()  # so that frames of the track lie side by side
    found = np.empty((count, frames, 3), np.float32)
    along, across, up = np.empty(frames, np.float32), np.empty(frames, np.float32), np.empty(frames, np.float32)
    for i in range(count):
        along[:], across[:], up[:] = np.float32(0), np.float32(0), np.float32(0)
        for d in range(0, track.shape[1], 3):
            x, y, z = query[i, d], query[i, d + 1], query[i, d + 2]
            for t in range(frames):
                along[t] += x * columns[d, t] + z * columns[d + 2, t]
                across[t] += z * columns[d, t] - x * columns[d + 2, t]
                up[t] += y * columns[d + 1, t]
        for t in range(frames):
            found[i, t, 0], found[i, t, 1], found[i, t, 2] = along[t], across[t], up[t]
    return found


@njit(cache=True, nogil=True)
def distances_of(shared: Shared, starts: Int64Array, width: int) -> Float64Array:
    """[s] distances of the query from the windows of one width that begin at some frames."""
    padded = np.empty(-(-len(starts) // 8) * 8, np.int64)
    turns = np.empty((len(padded), 2), np.float32)
    for at in range(len(padded)):
        padded[at] = starts[min(at, len(starts) - 1)]
        ahead, aside = shared.facing[padded[at] + width] - shared.facing[padded[at]]
        length = np.sqrt(ahead * ahead + aside * aside)
        turns[at, 0], turns[at, 1] = (ahead / length, aside / length) if length > SILENT else (1.0, 0.0)
    found = np.empty(len(padded), np.float32)
    _windows(
        shared.joints, shared.displaced, shared.moving, shared.placed, shared.started, shared.path, shared.norms,
        shared.speeds, shared.sizes, padded, turns, width, found,
    )  # fmt: skip
    return (found[: len(starts)] / np.float32(len(shared.norms) + width)).astype(np.float64)


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def _windows(
    joints: Float32Array, displaced: Float32Array, moving: Float32Array, placed: Float32Array, started: Float32Array,
    path: Float32Array, norms: Float32Array, speeds: Float32Array, sizes: Float32Array, starts: Int64Array,
    turns: Float32Array, width: int, out: Float32Array,
) -> None:  # fmt: skip
    """Kernel: summed costs of the cheapest paths from a query [n] to windows of a track [N], eight side by side.

    Args:
        joints, displaced, moving, placed, started, path, norms, speeds, sizes: as `Shared` has them.
        starts: [s] of the windows, a multiple of eight.
        turns: [s, 2] cosine and sine of where each faces.
        width: frames of a window.
        out: [s].
    """
    n, zero, inf = len(norms), np.float32(0), np.float32(np.inf)
    own, row = np.empty(width * 8, np.float32), np.empty(width * 8, np.float32)
    posture = np.empty(joints.shape[1], np.float32)
    # Of each window: what products are multiplied by, those of displacements first.
    by = np.empty((9, 8), np.float32)
    base, left, diagonal = np.empty(8, np.float32), np.empty(8, np.float32), np.empty(8, np.float32)
    for first in range(0, len(starts), 8):
        for lane in range(8):
            start = starts[first + lane]
            last = start + width - 1
            for d in range(len(posture)):
                posture[d] = (joints[start, d] + joints[start + 1, d] + joints[last - 1, d] + joints[last, d]) / 4
            spread, speed = zero, zero
            for j in range(width):
                apart = zero
                for d in range(len(posture)):
                    apart += (joints[start + j, d] - posture[d]) ** 2
                own[j * 8 + lane] = apart
                spread += apart
                speed += speeds[start + j]
            root = max(np.sqrt(spread / width), SILENT) / DISPLACEMENT_COUNT
            rate = max(np.sqrt(speed / width), SILENT)
            for j in range(width):
                way = zero
                for d in range(3):
                    way += (path[start + j, d] - path[start, d]) ** 2
                own[j * 8 + lane] = own[j * 8 + lane] / (root * root) + speeds[start + j] / (rate * rate)
                own[j * 8 + lane] += sizes[start + j] + way
            cosine, sine = turns[first + lane, 0], turns[first + lane, 1]
            by[0, lane], by[1, lane], by[2, lane] = 2 * cosine / root, 2 * sine / root, 2 / root
            by[3, lane], by[4, lane], by[5, lane] = 2 * cosine / rate, 2 * sine / rate, 2 / rate
            by[6, lane], by[7, lane], by[8, lane] = 2 * cosine, 2 * sine, 2
        row[:] = inf
        for i in range(n):
            for lane in range(8):
                start = starts[first + lane]
                last = start + width - 1
                mean = zero
                for k in range(3):
                    at_ends = displaced[i, start, k] + displaced[i, start + 1, k]
                    mean += by[k, lane] * (at_ends + displaced[i, last - 1, k] + displaced[i, last, k]) / 4
                    mean += by[6 + k, lane] * started[i, start, k]
                base[lane] = norms[i] + mean
            left[:] = inf
            diagonal[:] = inf if i else zero
            for j in range(width):
                for lane in range(8):
                    at = starts[first + lane] + j
                    near = (
                        by[0, lane] * displaced[i, at, 0] + by[1, lane] * displaced[i, at, 1]
                        + by[2, lane] * displaced[i, at, 2] + by[3, lane] * moving[i, at, 0]
                        + by[4, lane] * moving[i, at, 1] + by[5, lane] * moving[i, at, 2]
                        + by[6, lane] * placed[i, at, 0] + by[7, lane] * placed[i, at, 1]
                        + by[8, lane] * placed[i, at, 2]
                    )  # fmt: skip
                    above = row[j * 8 + lane]
                    cost = np.sqrt(max(base[lane] + own[j * 8 + lane] - near, zero))
                    cost += min(left[lane], min(above, diagonal[lane]))
                    diagonal[lane] = above
                    left[lane] = cost
                    row[j * 8 + lane] = cost
        for lane in range(8):
            out[first + lane] = row[(width - 1) * 8 + lane]
