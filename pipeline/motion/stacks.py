"""Dynamic time warping of one query with many clips at once: eight of about one length are aligned side by side."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, FloatArray, Int64Array
from motionlake.kernels import few, njit
from motionlake.motion.plain_dtw import path_costs, plain_work
from numpy.typing import NDArray

LANES: Final = 8  # clips that are aligned side by side
_CELLS: Final = 1 << 20  # frame distances that are worked out at a time
_LINE: Final = 32  # halves that come from memory together
_ROWS: Final = 960  # frames that are widened at a time: half a MiB of moves


class Halves(NamedTuple):
    """Where the frames of n clips lie, in half precision.

    Attributes:
        pieces: arrays [N, D].
        piece: [n] in which of them each clip lies.
        starts, counts: [n] from which row on, and how many.
    """

    pieces: Sequence[NDArray[np.float16]]
    piece: Int64Array
    starts: Int64Array
    counts: Int64Array


@dataclass(frozen=True)
class Stack:
    """Clips, each [m, D], in groups of eight; a group is as long as its longest clip.

    Attributes:
        frames: [R, D + 2] the operands of `squared`, by group, frame and clip.
        starts: [G + 1] first row of each group.
        lengths: [G, 8] frames of each clip; 0 where there is none.
        clips: [G, 8] which clip stands there; -1: none.
    """

    frames: Float32Array
    starts: Int64Array
    lengths: Int64Array
    clips: Int64Array

    @staticmethod
    def of(clips: Sequence[FloatArray]) -> Stack:
        """Of clips, each [m, D]. Raises `ValueError` for a clip without frames."""
        if not all(len(clip) for clip in clips):
            raise ValueError("a clip without frames cannot be aligned")
        sizes = np.array([len(clip) for clip in clips], dtype=np.int64)
        width = clips[0].shape[1] if clips else 0
        stack, first = Stack._empty(sizes, width)
        if clips:
            within = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
            rows = np.repeat(first, sizes) + within * LANES
            stack.frames[rows, :-2] = np.concatenate(clips)
            _squared(stack.frames)
        return stack

    @staticmethod
    def _empty(sizes: Int64Array, width: int) -> tuple[Stack, Int64Array]:
        """For n clips of so many frames, none of them written yet; and the row of the first frame of each clip."""
        starts, lengths, order = _groups(sizes)
        frames = np.zeros((starts[-1], width + 2), dtype=np.float32)
        frames[:, -2] = 1
        first = np.empty(len(sizes), dtype=np.int64)
        first[order[order >= 0]] = _first_rows(starts[:-1])[order >= 0]
        return Stack(frames, starts, lengths, order), first

    def spread(self, found: Float64Array) -> Float64Array:
        """[n] what was found [G, 8] for each clip, in the order in which they were given."""
        there = self.clips >= 0
        by_clip = np.empty(int(there.sum()))
        by_clip[self.clips[there]] = found[there]
        return by_clip


def _groups(sizes: Int64Array) -> tuple[Int64Array, Int64Array, Int64Array]:
    """Where groups of n clips of so many frames start, how long their clips are, and which these are: as `Stack`."""
    count = -(-len(sizes) // LANES)
    padded = np.full(count * LANES, -1, dtype=np.int64)
    padded[: len(sizes)] = np.argsort(sizes, kind="stable")
    order = padded.reshape(count, LANES)
    lengths = np.where(order < 0, 0, sizes[order] if len(sizes) else 0)
    return np.concatenate([[0], np.cumsum(lengths.max(axis=1, initial=0) * LANES)]), lengths, order


def _first_rows(starts: Int64Array) -> Int64Array:
    """[G, 8] the row of the first frame of each clip of groups that start at some rows."""
    return starts[:, None] + np.arange(LANES)


@njit(cache=True, nogil=True)
def _widen(
    halves: NDArray[np.uint16], column: int, starts: Int64Array, counts: Int64Array, every: int, first: Int64Array,
    frames: Float32Array,
) -> None:  # fmt: skip
    """Kernel: so many frames of clips, one of `every`, in half precision (their bits, [N, D]), from a column on into
    rows [R, d + 2] of a stack.

    The exponent of half precision is 112 less than that of single precision, to which its bits are moved. Frames lie
    far apart in memory: a first look at all of a clip has them come from there side by side.
    """
    width = frames.shape[1] - 2
    bits = np.empty(width, dtype=np.uint32)
    values = bits.view(np.float32)
    scale = np.float32(2.0**112)
    for clip in range(len(starts)):
        seen = np.uint16(0)
        for t in range(counts[clip]):
            source = halves[starts[clip] + t * every, column : column + width]
            for d in range(0, width, _LINE):
                seen |= source[d]
        frames[first[clip], 0] = seen  # is written over
        for t in range(counts[clip]):
            source = halves[starts[clip] + t * every, column : column + width]
            for d in range(width):
                half = np.uint32(source[d])
                bits[d] = (half & np.uint32(0x8000)) << np.uint32(16) | (half & np.uint32(0x7FFF)) << np.uint32(13)
            row = frames[first[clip] + t * 8]
            for d in range(width):
                row[d] = values[d] * scale


def _widened_plainly(
    halves: NDArray[np.uint16], column: int, starts: Int64Array, counts: Int64Array, every: int, first: Int64Array,
    frames: Float32Array,
) -> None:  # fmt: skip
    """What `_widen` does, without a kernel."""
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    rows = np.repeat(first, counts) + within * LANES
    source = halves.view(np.float16)[:, column : column + frames.shape[1] - 2]
    frames[rows, :-2] = source[np.repeat(starts, counts) + within * every]


def _squared(frames: Float32Array) -> None:
    """Set the last column of rows [R, D + 2] to the squared lengths of the first D."""
    np.einsum("td,td->t", frames[:, :-2], frames[:, :-2], out=frames[:, -1])


def aligned(query: Float32Array, stack: Stack) -> Float64Array:
    """[G, 8] distances of a query [n, D] from the clips of a stack.

    A distance is the least sum of Euclidean distances of frames along a path of ordinary steps, divided by the frames
    of both.
    """
    left = _left(query)
    found = np.zeros(stack.lengths.shape, dtype=np.float32)
    for group, last in _some_groups(stack.starts, _CELLS // len(query)):
        starts = stack.starts[group : last + 1]
        costs = left @ stack.frames[starts[0] : starts[-1]].T
        _align_groups(costs, starts - starts[0], stack.lengths[group:last], found[group:last])
    return np.asarray(found / (len(query) + stack.lengths), dtype=np.float64)


def aligned_halves(query: Float32Array, halves: Halves, every: int = 1, columns: slice = slice(None)) -> Float64Array:
    """[n] the same of clips in half precision.

    Frames are widened some groups at a time, into memory that stays in the processor's cache.

    Args:
        query: [n, d].
        halves: the clips.
        every: one of so many of the frames of each is compared, the first one first.
        columns: of the frames, the d that are compared.

    Raises:
        ValueError: a clip without frames.
    """
    if not halves.counts.all():
        raise ValueError("a clip without frames cannot be aligned")
    taken = -(-halves.counts // every)
    starts, lengths, order = _groups(taken)
    plainly, together = few(int(taken.sum())), _CELLS // len(query)
    # The same products either way; without a kernel, the more clips are aligned side by side the better.
    cuts = [0, *(last for _, last in _some_groups(starts, min(_ROWS, together)))]
    batches = _some_groups(starts[cuts], together) if plainly else ((cut, cut + 1) for cut in range(len(cuts) - 1))
    room = np.zeros((np.diff(starts[cuts]).max(initial=0), query.shape[1] + 2), dtype=np.float32)
    room[:, -2] = 1
    left, found = _left(query), np.zeros(lengths.shape, dtype=np.float32)
    widen, column = _widened_plainly if plainly else _widen, columns.start or 0
    for first_cut, last_cut in batches:
        whole = starts[cuts[first_cut] : cuts[last_cut] + 1]
        costs = np.empty((len(query), whole[-1] - whole[0]), dtype=np.float32)
        for group, last in pairwise(cuts[first_cut : last_cut + 1]):
            own, begin = order[group:last], starts[group]
            first, clips = _first_rows(starts[group:last] - begin)[own >= 0], own[own >= 0]
            frames = room[: starts[last] - begin]  # after the end of a clip another's: no path to its end passes them
            for piece in np.unique(halves.piece[clips]).tolist():
                here = halves.piece[clips] == piece
                bits = halves.pieces[piece].view(np.uint16)
                widen(bits, column, halves.starts[clips[here]], taken[clips[here]], every, first[here], frames)
            _squared(frames)
            np.matmul(left, frames.T, out=costs[:, begin - whole[0] : starts[last] - whole[0]])
        some = slice(cuts[first_cut], cuts[last_cut])
        _align_groups(costs, whole - whole[0], lengths[some], found[some])
    distances = np.empty(len(taken))
    distances[order[order >= 0]] = (found / (len(query) + lengths))[order >= 0]
    return distances


def _left(query: Float32Array) -> Float32Array:
    """[n, D + 2] the other operands of squared distances."""
    norms = np.einsum("td,td->t", query, query)
    return np.column_stack([np.float32(-2) * query, norms, np.ones_like(norms)])


def _some_groups(starts: Int64Array, most: int) -> Iterator[tuple[int, int]]:
    """First and last of groups that start at some rows, as many together as have `most` rows, one at least."""
    group = 0
    while group < len(starts) - 1:
        last = max(group + 1, int(np.searchsorted(starts, starts[group] + most, side="right")) - 1)
        yield group, last
        group = last


def _align_groups(costs: Float32Array, starts: Int64Array, lengths: Int64Array, out: Float32Array) -> None:
    """Summed costs of the cheapest paths into `out` [G, 8]; `costs` [n, C] are squared distances of frames."""
    work = plain_work(len(costs), costs.shape[1] // LANES // len(lengths), len(lengths) * LANES)
    align = _aligned_plainly if few(work) else _align
    align(costs, starts, lengths, out)


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def _align(costs: Float32Array, starts: Int64Array, lengths: Int64Array, out: Float32Array) -> None:
    """Kernel: summed costs of the cheapest paths into `out` [G, 8]; `costs` [n, C] are squared distances of frames."""
    zero, inf = np.float32(0), np.float32(np.inf)
    row = np.empty(max(starts[1:] - starts[:-1]), dtype=np.float32)
    left, diagonal = np.empty(8, np.float32), np.empty(8, np.float32)
    for group in range(len(out)):
        first, width = starts[group], (starts[group + 1] - starts[group]) // 8
        row[: width * 8] = inf
        for i in range(len(costs)):
            cells = costs[i, first : first + width * 8]
            left[:] = inf
            diagonal[:] = inf if i else zero
            for j in range(width):
                for lane in range(8):
                    above = row[j * 8 + lane]
                    cost = np.sqrt(max(cells[j * 8 + lane], zero)) + min(left[lane], min(above, diagonal[lane]))
                    diagonal[lane] = above
                    left[lane] = cost
                    row[j * 8 + lane] = cost
        for lane in range(8):
            if lengths[group, lane]:
                out[group, lane] = row[(lengths[group, lane] - 1) * 8 + lane]


def _aligned_plainly(costs: Float32Array, starts: Int64Array, lengths: Int64Array, out: Float32Array) -> None:
    """What `_align` does, without a kernel."""
    widths = (starts[1:] - starts[:-1]) // LANES
    padded = np.zeros((len(costs), int(widths.max()), len(out), LANES), dtype=np.float32)
    for group, (first, width) in enumerate(zip(starts.tolist(), widths.tolist(), strict=False)):
        cells = costs[:, first : first + width * LANES]
        padded[:, :width, group] = cells.reshape(len(costs), width, LANES)
    found = path_costs(padded.reshape(*padded.shape[:2], -1), lengths.ravel()).reshape(out.shape)
    out[lengths > 0] = found[lengths > 0]
