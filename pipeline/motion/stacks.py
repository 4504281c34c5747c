"""Dynamic time warping of one query with many clips at once: eight of about one length are aligned side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, FloatArray, Int64Array
from motionlake.kernels import few, njit
from motionlake.motion.plain_dtw import path_costs, plain_work
from numpy.typing import NDArray

LANES: Final = 8  # clips that are aligned side by side
_CELLS: Final = 1 << 20  # frame distances that are worked out at a time


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
    def of_halves(halves: Halves, every: int = 1) -> Stack:
        """The same of clips in half precision; `every`: of one of so many of the frames of each, the first one first.

        Raises:
            ValueError: a clip without frames.
        """
        if not halves.counts.all():
            raise ValueError("a clip without frames cannot be aligned")
        taken = -(-halves.counts // every)
        without_kernel = few(int(taken.sum()))
        stack, first = Stack._empty(taken, halves.pieces[0].shape[1] if halves.pieces else 0)
        for piece, frames in enumerate(halves.pieces):
            own = halves.piece == piece
            starts, counts = halves.starts[own], taken[own]
            if without_kernel:
                within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
                rows = np.repeat(first[own], counts) + within * LANES
                stack.frames[rows, :-2] = frames[np.repeat(starts, counts) + within * every]
            else:
                _widen(frames.view(np.uint16), starts, counts, every, first[own], stack.frames)
        _squared(stack.frames)
        return stack

    @staticmethod
    def _empty(sizes: Int64Array, width: int) -> tuple[Stack, Int64Array]:
        """For n clips of so many frames, none of them written yet; and the row of the first frame of each clip."""
        count = -(-len(sizes) // LANES)
        padded = np.full(count * LANES, -1, dtype=np.int64)
        padded[: len(sizes)] = np.argsort(sizes, kind="stable")
        order = padded.reshape(count, LANES)
        lengths = np.where(order < 0, 0, sizes[order] if len(sizes) else 0)
        starts = np.concatenate([[0], np.cumsum(lengths.max(axis=1, initial=0) * LANES)])
        frames = np.zeros((starts[-1], width + 2), dtype=np.float32)
        frames[:, -2] = 1
        place = np.argsort(padded[: len(sizes)])  # of each clip in the order
        return Stack(frames, starts, lengths, order), starts[place // LANES] + place % LANES

    def spread(self, found: Float64Array) -> Float64Array:
        """[n] what was found [G, 8] for each clip, in the order in which they were given."""
        there = self.clips >= 0
        by_clip = np.empty(int(there.sum()))
        by_clip[self.clips[there]] = found[there]
        return by_clip


@njit(cache=True, nogil=True)
def _widen(
    halves: NDArray[np.uint16], starts: Int64Array, counts: Int64Array, every: int, first: Int64Array,
    frames: Float32Array,
) -> None:  # fmt: skip
    """Kernel: so many frames of clips, one of `every`, in half precision (their bits, [N, D]) into rows of a stack.

    The exponent of half precision is 112 less than that of single precision, to which its bits are moved.
    """
    width = halves.shape[1]
    bits = np.empty(width, dtype=np.uint32)
    values = bits.view(np.float32)
    scale = np.float32(2.0**112)
    for clip in range(len(starts)):
        for t in range(counts[clip]):
            source = halves[starts[clip] + t * every]
            for d in range(width):
                half = np.uint32(source[d])
                bits[d] = (half & np.uint32(0x8000)) << np.uint32(16) | (half & np.uint32(0x7FFF)) << np.uint32(13)
            row = frames[first[clip] + t * 8]
            for d in range(width):
                row[d] = values[d] * scale


def _squared(frames: Float32Array) -> None:
    """Set the last column of rows [R, D + 2] to the squared lengths of the first D."""
    np.einsum("td,td->t", frames[:, :-2], frames[:, :-2], out=frames[:, -1])


def aligned(query: Float32Array, stack: Stack) -> Float64Array:
    """[G, 8] distances of a query [n, D] from the clips of a stack.

    A distance is the least sum of Euclidean distances of frames along a path of ordinary steps, divided by the frames
    of both.
    """
    norms = np.einsum("td,td->t", query, query)
    left = np.column_stack([np.float32(-2) * query, norms, np.ones_like(norms)])
    found = np.zeros(stack.lengths.shape, dtype=np.float32)
    group = 0
    while group < len(found):
        last = group + 1
        while last < len(found) and (stack.starts[last + 1] - stack.starts[group]) * len(query) <= _CELLS:
            last += 1
        costs = left @ stack.frames[stack.starts[group] : stack.starts[last]].T
        work = plain_work(len(query), costs.shape[1] // LANES // (last - group), (last - group) * LANES)
        align = _aligned_plainly if few(work) else _align
        align(costs, stack.starts[group : last + 1] - stack.starts[group], stack.lengths[group:last], found[group:last])
        group = last
    return np.asarray(found / (len(query) + stack.lengths), dtype=np.float64)


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
