"""The nearest of many clips by dynamic time warping of their moves.

Frames are first compared by their principal directions and by the length of what these leave of them, which bounds
their distance from below: so does an alignment of such frames that of the frames themselves, which only the few clips
need whose bound is low enough.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.motion.dtw import clip_dtw, clip_dtws
from motionlake.motion.moves import WIDTH
from motionlake.motion.stacks import Stack, aligned

DIRECTIONS: Final = 32  # of frames, in which bounds compare them
_SAMPLE: Final = 20_000  # frames that directions are fitted to
_ROUNDING: Final = 1e-3  # what single precision makes of the distance of a clip from itself
_AT_ONCE: Final = 16  # clips that are compared before the next bounds are looked at
_SLACK: Final = 1e-4  # of a distance: what bounds in single precision may be too high


def moves_distance(one: Float32Array, other: Float32Array) -> float:
    """Distance of two clips of moves [n, D] and [m, D], as `clip_dtw` has it; 0 where rounding is all there is."""
    distance = clip_dtw(one, other)
    return distance if distance > _ROUNDING else 0.0


def moves_distances(query: Float32Array, clips: Sequence[Float32Array]) -> Float64Array:
    """[n] the same of a query and each of n clips."""
    return floored(clip_dtws(query, clips))


def floored(distances: Float64Array) -> Float64Array:
    """The same of many distances of which single precision is all there is."""
    return np.where(distances > _ROUNDING, distances, 0.0)


def sampled(clips: Sequence[Float32Array], about: int) -> Float32Array:
    """[m, 135] every so many frames of clips one after another, so that there are about so many."""
    counts = np.array([len(clip) for clip in clips], dtype=np.int64)
    stride = max(1, int(counts.sum()) // about)
    first = (counts - np.cumsum(counts)) % stride
    none = np.zeros((0, WIDTH), dtype=np.float32)
    return np.concatenate([none, *[clip[start::stride] for clip, start in zip(clips, first.tolist(), strict=True)]])


class Nearest(NamedTuple):
    """Clips by the distance of their moves, nearest first, and these distances."""

    indices: Int64Array
    distances: Float64Array


class MovesIndex:
    """The moves of clips, each [m, 135], held so that the nearest to a query are found without aligning it with all.

    Raises:
        ValueError: a clip has no frames.
    """

    def __init__(self, clips: Sequence[Float32Array]) -> None:
        self._clips = list(clips)
        frames = sampled(self._clips, _SAMPLE).astype(np.float64)
        _, directions = np.linalg.eigh(frames.T @ frames)
        self._directions = np.ascontiguousarray(directions[:, ::-1][:, :DIRECTIONS], dtype=np.float32)
        self._inside = [self._projected(clip) for clip in self._clips]
        self._bounds = Stack.of(self._inside)

    def nearest(self, query: Float32Array, k: int, among: Int64Array | None = None) -> Nearest:
        """The k clips nearest to a query [n, 135]; of equal ones the first.

        Args:
            query: [n, 135].
            k: how many.
            among: [m] the clips to choose from, ascending; all by default.
        """
        bounds = self._bounds_from(query, among)
        order = np.argsort(bounds, kind="stable")[: len(bounds) if k else 0]
        found = self._distances(query, order[:k], among)
        for first in range(k, len(order), _AT_ONCE):
            some = order[first : first + _AT_ONCE]
            some = some[bounds[some] <= np.partition(found, k - 1)[k - 1]]
            if not len(some):
                break
            found = np.append(found, self._distances(query, some, among))
        rows = order[: len(found)]
        best = np.lexsort((rows, found))[:k]
        return Nearest(rows[best] if among is None else among[rows[best]], found[best])

    def _distances(self, query: Float32Array, rows: Int64Array, among: Int64Array | None) -> Float64Array:
        clips = rows if among is None else among[rows]
        return moves_distances(query, [self._clips[clip] for clip in clips.tolist()])

    def _bounds_from(self, query: Float32Array, among: Int64Array | None = None) -> Float64Array:
        stack = self._bounds if among is None else Stack.of([self._inside[row] for row in among.tolist()])
        found = stack.spread(aligned(self._projected(query), stack))
        return np.asarray(found * (1 - _SLACK))

    def _projected(self, clip: Float32Array) -> Float32Array:
        inside = clip @ self._directions
        rest = np.einsum("td,td->t", clip, clip) - np.einsum("td,td->t", inside, inside)
        return np.column_stack([inside, np.sqrt(np.maximum(rest, 0))])
