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
from motionlake.motion.moves import LEAST, MOST, Track
from motionlake.motion.moves_of_clips import Smoothing, facing_of, smoothing, velocity_of
from motionlake.motion.moves_products import Shared, distances_of, shared_of, shared_products
from motionlake.threads import in_threads

TEMPI: Final = (0.75, 1.0, 4 / 3)  # lengths of windows, in lengths of the query
FINER: Final = (0.87, 0.93, 1.0, 1.07, 1.15)  # the same around the best of them
STEPS: Final = 6  # windows that begin within the length of the query
FEW: Final = 4  # clips that one thread compares sooner than two
Found = tuple[float, int, int]  # as `Place`; of no window the distance is infinite


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
    return _or_none(_place(shared_of(query, track), *(barred or (0, 0))))


def nearest_places(
    query: Float32Array, clips: Sequence[Float32Array], barred: Sequence[tuple[int, int] | None], threads: int = 1
) -> list[Place | None]:
    """`nearest_place` of each of n clips, given their joints [N, 45] as `Track.of` takes them.

    Raises:
        ValueError: a query of more than 160 frames.
    """
    if len(query) > MOST:
        raise ValueError(f"a query of {len(query)} frames: at most {MOST} are aligned")
    if not clips:
        return []
    joints, starts = np.concatenate(clips), np.cumsum([0, *map(len, clips)])
    none = np.array([each or (0, 0) for each in barred], dtype=np.int64)
    places, found = np.empty((len(clips), 2), dtype=np.int64), np.empty(len(clips))
    shares = min(threads, -(-len(clips) // FEW))
    cuts = np.linspace(0, len(clips), shares + 1).astype(np.int64).tolist()
    asked = np.ascontiguousarray(query), joints, starts, none, smoothing()

    def compare(share: int) -> None:
        _places(*asked, cuts[share], cuts[share + 1], found, places)

    in_threads(compare, range(shares), shares)
    every = zip(found.tolist(), *places.T.tolist(), strict=True)
    return [_or_none(each) for each in every]


def windows_distances(query: Float32Array, track: Track, starts: Int64Array, width: int) -> Float64Array:
    """[s] distances of a query [m, 135] from the windows of a track that begin at some frames and are all as long."""
    found: Float64Array = distances_of(shared_of(query, track), starts, width)
    return found


def distances_about(query: Float32Array, track: Track, middles: Int64Array) -> Float64Array:
    """[s] of the query [m, 135] from the nearest of the windows of each tempo about some frames of a track.

    Where a window would reach beyond the track it is moved, and where it is longer, it is the track.
    """
    shared, count = shared_of(query, track), len(track.joints)
    best = np.full(len(middles), np.inf)
    for width in sorted({min(count, max(LEAST, round(len(query) * tempo))) for tempo in TEMPI}):
        starts, places = np.unique(np.clip(middles - width // 2, 0, count - width), return_inverse=True)
        best = np.minimum(best, distances_of(shared, starts, width)[places])
    return best


def _or_none(found: Found) -> Place | None:
    return Place(*found) if np.isfinite(found[0]) else None


@njit(cache=True, nogil=True)
def _places(
    query: Float32Array, joints: Float32Array, starts: Int64Array, barred: Int64Array, by: Smoothing, first: int,
    last: int, distances: Float64Array, places: Int64Array,
) -> None:  # fmt: skip
    """Kernel of `nearest_places`, of clips [first, last): joints [N, 45] of all, where those of each begin [n + 1]."""
    for clip in range(first, last):
        own = joints[starts[clip] : starts[clip + 1]]
        shared = shared_products(query, own.astype(np.float64), velocity_of(own, by), facing_of(own, by))
        distances[clip], places[clip, 0], places[clip, 1] = _place(shared, barred[clip, 0], barred[clip, 1])


@njit(cache=True, nogil=True)
def _place(shared: Shared, from_frame: int, to_frame: int) -> Found:
    """Kernel of `nearest_place`: no window may share frames [from_frame, to_frame)."""
    length, frames = len(shared.norms), len(shared.joints)
    step = max(1, length // STEPS)
    best = (np.inf, 0, 0)
    before = 0
    for factor in TEMPI:
        width = max(LEAST, int(np.rint(length * factor)))
        if width == before or width > frames:
            continue
        before = width
        starts = np.arange(0, frames - width + 1, step)
        if starts[-1] != frames - width:
            starts = np.append(starts, frames - width)
        found = _nearest(shared, starts, width, from_frame, to_frame)
        if found < best:
            best = found
    while best[0] < np.inf:
        coarse, longest, shortest, before = best, 0, frames, 0
        for factor in FINER:
            width = max(LEAST, int(np.rint((coarse[2] - coarse[1]) * factor)))
            if width == before or width > frames:
                continue
            before = width
            shortest, longest = min(shortest, width), max(longest, width)
            middle = (coarse[1] + coarse[2] - width) // 2
            starts = np.arange(max(0, middle - step), min(frames - width, middle + step) + 1)
            found = _nearest(shared, starts, width, from_frame, to_frame)
            if found < best:
                best = found
        width = best[2] - best[1]
        if best == coarse or (width != shortest and width != longest):
            break
    return best


@njit(cache=True, nogil=True)
def _nearest(shared: Shared, starts: Int64Array, width: int, from_frame: int, to_frame: int) -> Found:
    """The nearest of the windows of one width; of equal ones the first."""
    if to_frame > from_frame:
        starts = starts[(starts + width <= from_frame) | (starts >= to_frame)]
    if not len(starts):
        return np.inf, 0, 0
    found = distances_of(shared, starts, width)
    at = np.argmin(found)
    return found[at], starts[at], starts[at] + width
