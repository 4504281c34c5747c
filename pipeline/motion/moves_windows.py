"""Where in a clip a piece of motion occurs, by dynamic time warping of moves.

Moves are relative to the clip that they are of, so each window of a clip has moves of its own. Their distances from the
query follow from products of frames that all windows share: to align another window takes its path alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.kernels import njit
from motionlake.motion.moves import DISPLACEMENT_COUNT, HIPS, JOINTS_COUNT, LEAST, MOST, SILENT, Track, headings

TEMPI: Final = (0.75, 1.0, 4 / 3)  # lengths of windows, in lengths of the query
FINER: Final = (0.87, 0.93, 1.0, 1.07, 1.15)  # the same around the best of them
STEPS: Final = 6  # windows that begin within the length of the query


class Place(NamedTuple):
    """Frames [start, stop) of a track, and the distance of their moves from the query."""

    distance: float
    start: int
    stop: int


def nearest_place(query: Float32Array, track: Track, barred: tuple[int, int] | None = None) -> Place | None:
    """The window of a track [N frames] nearest to the moves of a query [m, 135]; None where none is long enough.

    Windows are from three quarters to four thirds as long as the query, first a sixth of it apart, then, about the
    nearest, one frame and of more lengths, and so again while the nearest is the longest or shortest of these.

    Args:
        query: at most 160 frames, all that there are.
        track: at the same rate.
        barred: frames [start, stop) that no window may share.
    """
    shared = _Products(query, track)
    step = max(1, len(query) // STEPS)
    best: Place | None = None
    for width in _widths(len(query), TEMPI, len(track.joints)):
        starts = np.unique(np.append(np.arange(0, len(track.joints) - width + 1, step), len(track.joints) - width))
        best = _better(best, shared.nearest(_apart(starts, width, barred), width))
    if best is None:
        return None
    while True:
        coarse, widths = best, _widths(best.stop - best.start, FINER, len(track.joints))
        for width in widths:
            middle = (coarse.start + coarse.stop - width) // 2
            starts = np.arange(max(0, middle - step), min(len(track.joints) - width, middle + step) + 1)
            best = _better(best, shared.nearest(_apart(starts, width, barred), width)) or best
        if best == coarse or best.stop - best.start not in (widths[0], widths[-1]):
            return best


def windows_distances(query: Float32Array, track: Track, starts: Int64Array, width: int) -> Float64Array:
    """[s] distances of a query [m, 135] from the windows of a track that begin at some frames and are all as long."""
    return _Products(query, track).distances(starts, width)


def distances_about(query: Float32Array, track: Track, middles: Int64Array) -> Float64Array:
    """[s] of the query [m, 135] from the nearest of the windows of each tempo about some frames of a track.

    Where a window would reach beyond the track it is moved, and where it is longer, it is the track.
    """
    shared, count = _Products(query, track), len(track.joints)
    best = np.full(len(middles), np.inf)
    for width in sorted({min(count, max(LEAST, round(len(query) * tempo))) for tempo in TEMPI}):
        starts, places = np.unique(np.clip(middles - width // 2, 0, count - width), return_inverse=True)
        best = np.minimum(best, shared.distances(starts, width)[places])
    return best


def _widths(length: int, factors: Sequence[float], most: int) -> list[int]:
    wanted = {max(LEAST, round(length * factor)) for factor in factors}
    return sorted(width for width in wanted if width <= most)


def _apart(starts: Int64Array, width: int, barred: tuple[int, int] | None) -> Int64Array:
    return starts if barred is None else starts[(starts + width <= barred[0]) | (starts >= barred[1])]


def _better(one: Place | None, other: Place | None) -> Place | None:
    return min((place for place in (one, other) if place is not None), default=None)


class _Products:
    """Products of the frames of a query with those of a track, for windows that may face anywhere.

    A product of two vectors, one of them turned about y, is the sum of three that do not depend on the turn: `along`
    times its cosine, `across` times its sine, and `up`.
    """

    def __init__(self, query: Float32Array, track: Track) -> None:
        if len(query) > MOST:
            raise ValueError(f"a query of {len(query)} frames: at most {MOST} are aligned")
        displacement, motion, posture = np.split(query, 3, axis=1)
        self._joints = (track.joints - track.joints.mean(axis=0)).astype(np.float32)
        velocity = track.velocity.astype(np.float32)
        placed = (JOINTS_COUNT * track.joints).astype(np.float32)
        self._path = np.ascontiguousarray(placed[:, HIPS])
        self._displaced = _products(displacement, self._joints)
        self._moving = _products(motion, velocity)
        self._placed = _products(posture, placed)
        self._started = _products(posture[:, HIPS], self._path)
        self._norms = np.einsum("td,td->t", query, query)
        self._speeds = np.einsum("td,td->t", velocity, velocity)
        self._sizes = np.einsum("td,td->t", placed, placed) - np.einsum("td,td->t", self._path, self._path)
        self._facing = np.concatenate([np.zeros((1, 2)), np.cumsum(track.facing, axis=0)])

    def nearest(self, starts: Int64Array, width: int) -> Place | None:
        """The nearest of the windows of one width; of equal ones the first."""
        if not len(starts):
            return None
        found = self.distances(starts, width)
        at = int(found.argmin())
        return Place(float(found[at]), int(starts[at]), int(starts[at]) + width)

    def distances(self, starts: Int64Array, width: int) -> Float64Array:
        """[s] distances of the query from the windows of one width."""
        found = np.empty(-(-len(starts) // 8) * 8, dtype=np.float32)
        padded = np.append(starts, np.full(len(found) - len(starts), starts[-1]))
        facing = self._facing[padded + width] - self._facing[padded]
        turns = headings(facing).astype(np.float32)
        _windows(
            self._joints, self._displaced, self._moving, self._placed, self._started, self._path, self._norms,
            self._speeds, self._sizes, padded, turns, width, found,
        )  # fmt: skip
        return np.asarray(found[: len(starts)] / (len(self._norms) + width), dtype=np.float64)


def _products(query: Float32Array, track: Float32Array) -> Float32Array:
    """[n, N, 3] along, across, up, of frames [n, D] and [N, D] of points."""
    own, other = (part.reshape(len(part), -1, 3) for part in (query, track))
    level = np.concatenate([other[..., 0], other[..., 2]], axis=1).T
    along = np.concatenate([own[..., 0], own[..., 2]], axis=1) @ level
    across = np.concatenate([own[..., 2], -own[..., 0]], axis=1) @ level
    return np.stack([along, across, own[..., 1] @ other[..., 1].T], axis=-1)


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def _windows(
    joints: Float32Array, displaced: Float32Array, moving: Float32Array, placed: Float32Array, started: Float32Array,
    path: Float32Array, norms: Float32Array, speeds: Float32Array, sizes: Float32Array, starts: Int64Array,
    turns: Float32Array, width: int, out: Float32Array,
) -> None:  # fmt: skip
    """Kernel: summed costs of the cheapest paths from a query [n] to windows of a track [N], eight side by side.

    Args:
        joints: [N, D] of the track.
        displaced, moving, placed: [n, N, 3] `_products` of the query's displacements with joints, of its velocities
            with those of the track, and of its joints with those of the track.
        started: [n, N, 3] of their paths.
        path: [N, 3] of the track, as moves have it.
        norms, speeds, sizes: [n] squared lengths of the query's frames, [N] of the track's velocities, and of its
            joints without the path, as moves have them.
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
