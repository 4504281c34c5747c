"""Dynamic time warping between motion words (Deep Motifs, section 3.3 and equation 3).

The distance of two words is the cost of the cheapest warping path through their frame-pair distances,
divided by the number of matched frame pairs on it ("the average distance of the matched frames in the
optimal matching sequence"). Steps are (1, 1), (1, 0) and (0, 1); where costs tie, the path comes from the
diagonal, then from above (the frame before of the first word), then from the left.

Frame distances (`frame_distance`) come from one matrix product for many words at once; then `LANES` words are
aligned side by side in the lanes of one kernel.
"""

from __future__ import annotations

from typing import Final, NamedTuple, Self

import numpy as np
from motionlake.arrays import Float32Array, Int64Array
from motionlake.deep_motifs.words.word_index import WordSet
from motionlake.kernels import njit
from motionlake.motion.dtw import Metric, operands, product, squared_geodesics

LANES: Final = 32
# Words of one matrix product: keeps frame distances of a chunk (words * length * length floats) in cache.
CHUNK_WORDS_A: Final = 8
CHUNK_BLOCKS_B: Final = 4


def word_distances(
    a: Float32Array, b: Float32Array, metric: Metric = "euclidean", *, average: bool = True
) -> Float32Array:
    """[n, m] float32 distances of every word of `a` from every word of `b`.

    Args:
        a: [n, length, D] words; views are welcome.
        b: [m, length', D] words.
        metric: the frame distance. "geodesic" takes D = 4 * joints unit quaternions.
        average: divide by the number of matched pairs (equation 3's text); False gives the plain sum that
            DTW packages compute with squared Euclidean distances.

    Raises:
        ValueError: shapes that do not fit.
    """
    if a.ndim != 3 or b.ndim != 3 or a.shape[2] != b.shape[2] or not (a.shape[1] and b.shape[1]):
        raise ValueError(f"words of shapes {a.shape} and {b.shape} cannot be compared")
    if metric == "geodesic" and a.shape[2] % 4:
        raise ValueError(f"{a.shape[2]} numbers a frame are no whole number of quaternions")
    n_a, n_b = len(a), len(b)
    if not (n_a and n_b):
        return np.empty((n_a, n_b), dtype=np.float32)
    n_blocks = -(-n_b // LANES)
    lanes = np.minimum(np.arange(n_blocks * LANES), n_b - 1).reshape(n_blocks, LANES)
    left, right = operands(a.reshape(-1, a.shape[2]), b.reshape(-1, b.shape[2]), metric)
    left, right = left.reshape(n_a, a.shape[1], -1), right.reshape(n_b, b.shape[1], -1)
    distances = np.empty((n_a, n_blocks * LANES), dtype=np.float32)
    for first in range(0, n_blocks, CHUNK_BLOCKS_B):
        block_words = lanes[first : first + CHUNK_BLOCKS_B]
        columns = right[block_words].transpose(0, 2, 1, 3).reshape(-1, right.shape[2])
        columns = np.ascontiguousarray(columns.T)
        columns_out = slice(first * LANES, (first + len(block_words)) * LANES)
        for start in range(0, n_a, CHUNK_WORDS_A):
            rows = left[start : start + CHUNK_WORDS_A]
            frames = product(rows.reshape(-1, rows.shape[2]), columns, metric)
            _align(frames, a.shape[1], b.shape[1], average, distances[start : start + len(rows), columns_out])
    return np.ascontiguousarray(distances[:, :n_b])


@njit(cache=True, nogil=True)
def align_block(
    frames: Float32Array, row: int, column: int, n: int, m: int, scratch: Float32Array, out: Float32Array, average: bool
) -> None:
    """Align one word of n frames with `LANES` words of m frames.

    frames: frame distances, C-contiguous; those of frame i of the one with frame j of the others stand in
    row `row + i` from column `column + j * LANES`. scratch: 4 * (m + 1) * LANES floats. out: [LANES].
    """
    one, zero, infinity = np.float32(1), np.float32(0), np.float32(np.inf)
    width = (m + 1) * LANES
    scratch[:] = infinity
    scratch[:LANES] = zero
    scratch[width : width + LANES] = zero
    for i in range(n):
        above, here = (i & 1) * 2 * width, (1 - (i & 1)) * 2 * width
        scratch[here : here + LANES] = infinity
        for j in range(m):
            cost_above = scratch[above + j * LANES : above + (j + 2) * LANES]
            steps_above = scratch[above + width + j * LANES : above + width + (j + 2) * LANES]
            cost_here = scratch[here + j * LANES : here + (j + 2) * LANES]
            steps_here = scratch[here + width + j * LANES : here + width + (j + 2) * LANES]
            distance = frames[row + i, column + j * LANES : column + (j + 1) * LANES]
            for lane in range(LANES):
                cost, steps = cost_above[lane], steps_above[lane]
                other_cost, other_steps = cost_above[LANES + lane], steps_above[LANES + lane]
                better = other_cost < cost
                cost, steps = (other_cost if better else cost), (other_steps if better else steps)
                other_cost, other_steps = cost_here[lane], steps_here[lane]
                better = other_cost < cost
                cost, steps = (other_cost if better else cost), (other_steps if better else steps)
                step_cost = distance[lane]
                cost_here[LANES + lane] = cost + (step_cost if step_cost > zero else zero)
                steps_here[LANES + lane] = steps + one
    last = (n & 1) * 2 * width
    for lane in range(LANES):
        cost = scratch[last + m * LANES + lane]
        out[lane] = cost / scratch[last + width + m * LANES + lane] if average else cost


@njit(cache=True, nogil=True)
def _align(frames: Float32Array, n: int, m: int, average: bool, out: Float32Array) -> None:
    """frames [words * n, blocks * m * LANES] -> out [words, blocks * LANES]."""
    scratch = np.empty(4 * (m + 1) * LANES, dtype=np.float32)
    aligned = np.empty(LANES, dtype=np.float32)
    for word in range(frames.shape[0] // n):
        for block in range(frames.shape[1] // (m * LANES)):
            align_block(frames, word * n, block * m * LANES, n, m, scratch, aligned, average)
            out[word, block * LANES : (block + 1) * LANES] = aligned


def listed_distances(
    a: WordSet, b: WordSet, lists: Int64Array, metric: Metric = "euclidean", *, centre: Float32Array | None = None
) -> Float32Array:
    """[n, C] float32 distances of each word of one set from those words of another that its list names.

    Average distances as in `word_distances`; infinite where there is no word. Runs without the interpreter's lock, so
    that threads can share the work.

    Args:
        a, b: words of one length.
        lists: [n, C] indices into `b` for each of the n words of `a`; -1 where a list is shorter, in its last places.
        metric: the frame distance.
        centre: [D] about the mean frame, zero if not given. Changes no Euclidean distance and keeps
            cancellation small.
    """
    distances = np.full(lists.shape, np.inf, dtype=np.float32)
    middle = np.zeros(b.width, np.float32) if centre is None else centre.astype(np.float32)
    words = a.frames, a.starts, b.frames, b.starts
    _align_listed(*words, lists, metric == "geodesic", middle, Room.of(b.length, b.width), distances)
    return distances


class Room(NamedTuple):
    """Where frames of one word stand beside those of `LANES` others.

    Attributes:
        left: [length, D] frames of the one, and norms_left: [length] their squared norms.
        right: [LANES * length, D] frames of the others, and norms_right: [LANES * length].
        products: [length, LANES * length] of both.
        lanes: [length, length * LANES] distances of both.
    """

    left: Float32Array
    norms_left: Float32Array
    right: Float32Array
    norms_right: Float32Array
    products: Float32Array
    lanes: Float32Array

    @classmethod
    def of(cls, length: int, width: int) -> Self:
        """For words of `length` frames of `width` numbers."""
        many = LANES * length
        shapes = (length, width), (length,), (many, width), (many,), (length, many), (length, many)
        return cls(*(np.zeros(shape, np.float32) for shape in shapes))


@njit(cache=True, nogil=True)
def _align_listed(
    frames_a: Float32Array,
    starts_a: Int64Array,
    frames_b: Float32Array,
    starts_b: Int64Array,
    lists: Int64Array,
    geodesic: bool,
    centre: Float32Array,
    room: Room,
    out: Float32Array,
) -> None:
    """lists [n, C] -> out [n, C]: the frames of `LANES` listed words are gathered for one matrix product."""
    length = len(room.left)
    scratch = np.empty(4 * (length + 1) * LANES, dtype=np.float32)
    aligned = np.empty(LANES, dtype=np.float32)
    for query in range(len(starts_a)):
        centred(frames_a, starts_a[query], centre, geodesic, room.left, room.norms_left)
        for first in range(0, lists.shape[1], LANES):
            some = lists[query, first : first + LANES]
            listed = lane_frames(frames_b, starts_b, some, centre, geodesic, room)
            if listed == 0:
                break
            align_block(room.lanes, 0, 0, length, length, scratch, aligned, True)
            out[query, first : first + listed] = aligned[:listed]


@njit(cache=True, nogil=True)
def lane_frames(
    frames: Float32Array, starts: Int64Array, words: Int64Array, centre: Float32Array, geodesic: bool, room: Room
) -> int:
    """Fill `room.lanes`: distances of the word in `room.left` from at most `LANES` words.

    Returns how many of `words` there are before the first -1.
    """
    length = len(room.left)
    listed = 0
    while listed < len(words) and words[listed] >= 0:
        rows = slice(listed * length, (listed + 1) * length)
        centred(frames, starts[words[listed]], centre, geodesic, room.right[rows], room.norms_right[rows])
        listed += 1
    if listed == 0:
        return 0
    if geodesic:
        squared_geodesics(room.left, room.right.T, room.products)
    else:
        np.dot(room.left, room.right.T, room.products)
    for i in range(length):
        for j in range(length):
            for lane in range(LANES):
                between = room.products[i, lane * length + j]
                if not geodesic:
                    norms = room.norms_left[i] + room.norms_right[lane * length + j]
                    between = norms - np.float32(2) * between
                room.lanes[i, j * LANES + lane] = between
    return listed


@njit(cache=True, nogil=True, fastmath={"reassoc", "nsz", "contract"})
def centred(
    frames: Float32Array, start: int, centre: Float32Array, geodesic: bool, out: Float32Array, norms: Float32Array
) -> None:
    """out [length, D]: the frames of one word less the centre; norms [length] squared. Quaternions stay as they are."""
    for frame in range(out.shape[0]):
        total = np.float32(0)
        for number in range(out.shape[1]):
            value = frames[start + frame, number]
            if not geodesic:
                value -= centre[number]
            out[frame, number] = value
            total += value * value
        norms[frame] = total
