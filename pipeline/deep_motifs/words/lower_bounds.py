"""Lower bounds of DTW between words, and the words that they cannot rule out.

The word distance is the cost of the cheapest path divided by its length, between L and 2 L - 1 for words of L frames.
So a sum of costs that every path must pay bounds it only when divided by the longest length, unless every further
step is paid for too. With D the frame distances of a pair and t a threshold, the pair is farther than t when

    sum over the cells of the path of (D - t) > 0.

Three tests make sure of that, the cheap ones first:

1. Ends. Every path holds the cells of both first and both last frames (as LB_Kim has it); any other cell costs at
   least m, the squared gap between the spheres that hold the two words, or between their boxes. Ruled out if
   first + last + (2 L - 3) m > (2 L - 1) t.
2. Boxes. A path enters each row once, at a cost of at least r_i, the squared distance of frame i from the box that
   holds the other word (LB_Keogh in several dimensions, with a window as wide as the word); r_0 is the first cell
   itself. Every other cell of the path enters a column j > 0, another one each, at c_j or more. Ruled out if
   sum r_i + sum over j > 0 of min(c_j, t) > (2 L - 1) t, or the same with rows and columns exchanged.
3. Paths. The least sum of D - t over any path, found as DTW is, is above zero. Abandoned early, LANES words at once:
   a path that reaches cell (i, j) gains at most t in each of the 2 L - 2 - i - j cells that may follow.

All look at frames projected orthogonally, which brings no two frames further apart, hence are bounds in full.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Int64Array
from motionlake.deep_motifs.words.dtw import LANES, Room, centred, lane_frames
from motionlake.kernels import njit
from motionlake.motion.dtw import squared_distances

COLUMN_WORDS: Final = 8192  # words that meet a block of queries at a time
# Bounds and distances carry rounding errors of their own: what is within these of the threshold is not ruled out.
RELATIVE_SLACK, ABSOLUTE_SLACK = 1e-3, 1e-5


class WordBounds(NamedTuple):
    """What the tests need of n words.

    Attributes:
        frames: [n * length, P] projected.
        ends: [n, 2 P] first and last frame; the first alone, [n, P], where a word is one frame.
        centres: [n, P] mean frame; radii: [n] distance of the farthest frame from it.
        low: [n, P] least and high: [n, P] greatest coordinates.
        length: frames of a word.
    """

    frames: Float32Array
    ends: Float32Array
    centres: Float32Array
    radii: Float32Array
    low: Float32Array
    high: Float32Array
    length: int

    @classmethod
    def of(cls, projected: Float32Array) -> WordBounds:
        """Of projected words [n, length, P]."""
        n, length, width = projected.shape
        centres = projected.mean(axis=1)
        radii = np.sqrt(np.square(projected - centres[:, None]).sum(axis=2)).max(axis=1)
        ends = projected[:, 0] if length == 1 else np.concatenate([projected[:, 0], projected[:, -1]], axis=1)
        return cls(
            np.ascontiguousarray(projected).reshape(n * length, width),
            ends, centres, radii, projected.min(axis=1), projected.max(axis=1), length,
        )  # fmt: skip

    def part(self, start: int, stop: int) -> WordBounds:
        """Words [start, stop)."""
        sides = {name: getattr(self, name)[start:stop] for name in ("ends", "centres", "radii", "low", "high")}
        return self._replace(frames=self.frames[start * self.length : stop * self.length], **sides)


def survivors(queries: WordBounds, words: WordBounds, thresholds: Float32Array) -> list[Int64Array]:
    """For each query the words that may be as near as its threshold, ascending.

    Args:
        queries: n words.
        words: N words of the same length and directions.
        thresholds: [n] word distances; infinite rules nothing out.
    """
    slack = (thresholds * np.float32(1 + RELATIVE_SLACK) + np.float32(ABSOLUTE_SLACK)).astype(np.float32)
    n = len(words.radii)
    found: list[list[Int64Array]] = [[] for _ in slack]
    for first in range(0, n, COLUMN_WORDS):
        some = words.part(first, min(first + COLUMN_WORDS, n))
        passed = np.empty((len(slack), len(some.radii)), dtype=np.bool_)
        ends, centres = squared_distances(queries.ends, some.ends), squared_distances(queries.centres, some.centres)
        _test(ends, centres, queries, some, slack, passed)
        for row, kept in zip(found, passed, strict=True):
            row.append(np.flatnonzero(kept) + first)
    left = [np.concatenate([np.zeros(0, np.int64), *some]) for some in found]
    starts = np.arange(n, dtype=np.int64) * words.length
    room = Room.of(words.length, words.frames.shape[1])
    for i in np.flatnonzero(np.isfinite(slack)):
        below = np.empty(len(left[i]), dtype=np.bool_)
        own = queries.frames[i * words.length : (i + 1) * words.length]
        _test_paths(own, words.frames, starts, left[i], slack[i], room, below)
        left[i] = left[i][below]
    return left


@njit(cache=True, nogil=True)
def _test(
    ends: Float32Array, centres: Float32Array, a: WordBounds, b: WordBounds, thresholds: Float32Array, out: BoolArray
) -> None:
    """out[i, j]: word j of b may be as near to word i of a as the threshold; ends, centres [n, m] squared distances."""
    length = a.length
    longest = 2 * length - 1
    others = longest - min(length, 2)
    rows, columns = np.empty(length, dtype=np.float32), np.empty(length, dtype=np.float32)
    for i in range(out.shape[0]):
        one, threshold = a.frames[i * length : (i + 1) * length], thresholds[i]
        most = longest * threshold
        for j in range(out.shape[1]):
            gap = max(np.float32(0), np.sqrt(max(centres[i, j], np.float32(0))) - a.radii[i] - b.radii[j])
            out[i, j] = False
            if ends[i, j] + others * gap * gap > most:
                continue
            if ends[i, j] + others * _gap(a.low[i], a.high[i], b.low[j], b.high[j]) > most:
                continue
            other = b.frames[j * length : (j + 1) * length]
            for frame in range(length):
                rows[frame] = _gap(one[frame], one[frame], b.low[j], b.high[j])
            least = rows.min()  # further cells may lie in the first row too, beside its first cell
            rows[0] = _gap(one[0], one[0], other[0], other[0])
            if rows.sum() + (length - 1) * min(least, threshold) > most:
                continue
            for frame in range(length):
                columns[frame] = _gap(other[frame], other[frame], a.low[i], a.high[i])
            columns[0] = rows[0]
            out[i, j] = max(_paid(rows, columns, threshold), _paid(columns, rows, threshold)) <= most


@njit(cache=True, nogil=True)
def _paid(rows: Float32Array, columns: Float32Array, threshold: float) -> float:
    """What a path pays at least on entering rows, and columns beside them as far as the threshold."""
    total = float(rows.sum())
    for j in range(1, len(columns)):
        total += min(columns[j], threshold)
    return total


@njit(cache=True, nogil=True, fastmath={"reassoc", "nsz", "contract"})
def _gap(low_a: Float32Array, high_a: Float32Array, low_b: Float32Array, high_b: Float32Array) -> np.float32:
    """Squared distance of two boxes; a frame is a box too."""
    total = np.float32(0)
    for number in range(len(low_a)):
        step = max(max(low_b[number] - high_a[number], low_a[number] - high_b[number]), np.float32(0))
        total += step * step
    return total


@njit(cache=True, nogil=True)
def _test_paths(
    query: Float32Array,
    frames: Float32Array,
    starts: Int64Array,
    words: Int64Array,
    threshold: float,
    room: Room,
    out: BoolArray,
) -> None:
    """out[w]: the cheapest path from the query [length, P] to word w costs no more than the threshold a cell."""
    length, width = query.shape
    zero = np.zeros(width, dtype=np.float32)
    costs = np.empty((2, (length + 1) * LANES), dtype=np.float32)
    sums = np.empty(LANES, dtype=np.float32)
    centred(query, 0, zero, False, room.left, room.norms_left)
    for first in range(0, len(words), LANES):
        n = lane_frames(frames, starts, words[first : first + LANES], zero, False, room)
        _least_sums(room.lanes, length, np.float32(threshold), costs, sums)
        for lane in range(n):
            out[first + lane] = sums[lane] <= 0


@njit(cache=True, nogil=True)
def _least_sums(
    lanes: Float32Array, length: int, threshold: np.float32, costs: Float32Array, sums: Float32Array
) -> None:
    """sums [LANES]: least sum of frame distances less the threshold over any path; infinite if abandoned.

    lanes [length, length * LANES]; costs [2, (length + 1) * LANES] is scratch.
    """
    costs[:] = np.inf
    costs[0, :LANES] = 0
    best = np.empty(LANES, dtype=np.float32)
    for i in range(length):
        above, here = costs[i & 1], costs[1 - (i & 1)]
        here[:LANES] = np.inf
        best[:] = np.inf
        for j in range(length):
            gain = threshold * np.float32(2 * length - 2 - i - j)
            diagonal, up = above[j * LANES : (j + 1) * LANES], above[(j + 1) * LANES : (j + 2) * LANES]
            before, now = here[j * LANES : (j + 1) * LANES], here[(j + 1) * LANES : (j + 2) * LANES]
            distance = lanes[i, j * LANES : (j + 1) * LANES]
            for lane in range(LANES):
                cost = min(min(diagonal[lane], up[lane]), before[lane]) + (distance[lane] - threshold)
                now[lane] = cost
                best[lane] = min(best[lane], cost - gain)
        if best.min() > 0:
            sums[:] = np.inf
            return
    sums[:] = costs[length & 1, length * LANES :]
