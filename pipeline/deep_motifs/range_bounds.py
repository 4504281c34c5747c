"""Lower bounds of the distances of all windows of many clips from a query: one pass over the motifs of their words.

All mass of a window must go to motifs of the query, so its distance is no less than the mean distance of its words from
the nearest of these. And the mean distance of a signature from any one motif changes by no more than what it costs to
move the signature, so the difference of these means bounds the distance too, for every motif that is looked at.

Means over a window are running sums. These are whole numbers, which do not drift however long a clip is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.deep_motifs.rough_bounds import ROUGH, roughly_of_clips
from motionlake.kernels import njit
from motionlake.threads import in_threads
from numpy.typing import NDArray

LANES: Final = 8  # of a table: the weight of a motif, its distance from the query, and those from single motifs
MOTIFS: Final = LANES - 2  # that means of distances are taken from
_LARGEST: Final = 1 << 24  # that a sum comes to: whole numbers up to it are exact in single precision
_DIVIDED: Final = 1e-6  # relative error of a quotient, and some
_THREADS: Final = 2


@dataclass(frozen=True)
class WordMotifs:
    """The motifs of the words of n clips, W in all.

    Attributes:
        motifs: [W] of each word, clip by clip and in time.
        offsets: [n + 1]; the words of clip i are `offsets[i]:offsets[i + 1]`.
    """

    motifs: NDArray[np.uint16]
    offsets: Int64Array

    def counts(self, clips: Int64Array) -> Int64Array:
        """[c] words of some clips."""
        return np.asarray(self.offsets[clips + 1] - self.offsets[clips])

    def of(self, clip: int) -> NDArray[np.int32]:
        """[w] motifs of the words of a clip."""
        return self.motifs[self.offsets[clip] : self.offsets[clip + 1]].astype(np.int32)


@dataclass(frozen=True)
class WindowBounds:
    """What tells a lower bound of the distance of any window of `n_words` words from a signature.

    Attributes:
        table: [K, `LANES`] whole numbers: what a word of each motif adds to the sums of a window.
        n_words: of a window; of a clip that has fewer, all are one window.
    """

    table: Float32Array
    n_words: int

    @staticmethod
    def of(signature: Float32Array, n_words: int, idf: Float64Array, ground: Float64Array) -> WindowBounds:
        """Of a query.

        Args:
            signature: [K] of the query, of mass 1.
            n_words: of the query.
            idf: [K] weights of the motifs.
            ground: [K, K] distances of the motifs, a metric.
        """
        mass = signature.astype(np.float64)
        held = np.flatnonzero(mass)
        seen = held[np.argsort(-mass[held], kind="stable")][:MOTIFS].tolist()
        while len(seen) < min(MOTIFS, len(ground)):
            seen.append(int(ground[seen].min(axis=0).argmax()))  # the farthest from those that are looked at
        table = np.zeros((len(idf), LANES))
        table[:, 0] = idf
        table[:, 1] = idf * ground[:, held].min(axis=1)
        table[:, 2 : 2 + len(seen)] = idf[:, None] * (ground[:, seen] - mass @ ground[:, seen])
        scale = _LARGEST / (n_words * np.abs(table).max())
        whole = np.rint(table * scale).astype(np.float32)
        whole[:, 0] = np.maximum(whole[:, 0], 1)  # of a query of a million words a weight would be nothing
        return WindowBounds(whole, n_words)

    def of_clips(self, words: WordMotifs, clips: Int64Array | None = None) -> Float32Array:
        """[c] the least bound of all windows of each of some clips, or of all; infinite where a clip has no words."""
        chosen = np.arange(len(words.offsets) - 1) if clips is None else clips

        def work(first: int, last: int, found: Float32Array) -> None:
            _of_clips(self.table, words.motifs, words.offsets, chosen[first:last], self.n_words, found[first:last])

        return self._shared(work, words.counts(chosen))

    def roughly_of_clips(self, words: WordMotifs) -> Float32Array:
        """[n] no more than `of_clips`, by fewer sums."""
        table, counts = np.ascontiguousarray(self.table[:, :ROUGH], dtype=np.int32), np.diff(words.offsets)
        most = min(self.n_words, int(counts.max(initial=1)))

        def work(first: int, last: int, found: Float32Array) -> None:
            roughly_of_clips(table, words.motifs, words.offsets, most, first, last, found)

        return self._shared(work, counts)

    def _shared(self, work: Callable[[int, int, Float32Array], None], counts: Int64Array) -> Float32Array:
        """What `work` writes of clips [first, last) that have so many words, a share of them in each thread."""
        found = np.full(len(counts), np.inf, dtype=np.float32)
        before = np.cumsum(counts)
        goals = np.linspace(0, before[-1] if len(before) else 0, _THREADS + 1)[1:-1]
        edges = [0, *np.searchsorted(before, goals).tolist(), len(found)]
        in_threads(lambda share: work(*share, found), list(pairwise(edges)), _THREADS)
        return self._sure(found)

    def of_windows(self, words: WordMotifs, clips: Int64Array) -> tuple[Int64Array, Int64Array, Float32Array]:
        """([v] clip, [v] first word counted within it, [v] bound) of every window of some clips that have words."""
        each = np.maximum(1, words.counts(clips) - self.n_words + 1)
        begins = np.cumsum(each) - each
        found = np.empty(int(each.sum()), dtype=np.float32)
        _of_windows(self.table, words.motifs, words.offsets, clips, self.n_words, begins, found)
        return np.repeat(clips, each), np.arange(len(found)) - np.repeat(begins, each), self._sure(found)

    def _sure(self, found: Float32Array) -> Float32Array:
        """Quotients of two sums, less what rounding may have added to them."""
        sure = found * np.float32(1 - self._rounding - _DIVIDED) - np.float32(self._rounding)
        return np.asarray(np.maximum(sure, np.float32(0)))

    @cached_property
    def _rounding(self) -> float:
        """Every entry of the table is at most a half away from what it stands for, so a quotient of sums at most so far
        from that of what they stand for, and so much of itself; all of it, where weights are that small."""
        least = float(self.table[:, 0].min())
        return 0.5 / (least - 0.5) if least > 1 else 1.0


@njit(cache=True, nogil=True, fastmath={"nsz", "nnan"})
def _of_clips(
    table: Float32Array, motifs: NDArray[np.uint16], offsets: Int64Array, clips: Int64Array, n_words: int,
    found: Float32Array,
) -> None:  # fmt: skip
    """Kernel of `of_clips`. The sums are written out, so that they stay in registers; what a window gains and loses is
    taken together, so that each waits for one addition alone."""
    for place in range(len(clips)):
        begin, end = offsets[clips[place]], offsets[clips[place] + 1]
        if begin == end:
            continue
        width = min(n_words, end - begin)
        a = b = c = d = e = f = g = h = np.float32(0)
        best = np.float32(1e30)
        for at in range(begin, begin + width):
            row = table[motifs[at]]
            a, b, c, d = a + row[0], b + row[1], c + row[2], d + row[3]
            e, f, g, h = e + row[4], f + row[5], g + row[6], h + row[7]
        for at in range(begin + width, end + 1):
            most = max(max(max(abs(c), abs(d)), max(abs(e), abs(f))), max(max(abs(g), abs(h)), b))
            best = min(best, most / a)
            if at == end:
                break
            row, gone = table[motifs[at]], table[motifs[at - width]]
            a, b, c, d = a + (row[0] - gone[0]), b + (row[1] - gone[1]), c + (row[2] - gone[2]), d + (row[3] - gone[3])
            e, f, g, h = e + (row[4] - gone[4]), f + (row[5] - gone[5]), g + (row[6] - gone[6]), h + (row[7] - gone[7])
        found[place] = best


@njit(cache=True, nogil=True)
def _of_windows(
    table: Float32Array, motifs: NDArray[np.uint16], offsets: Int64Array, clips: Int64Array, n_words: int,
    begins: Int64Array, found: Float32Array,
) -> None:  # fmt: skip
    """Kernel of `of_windows`; the bounds of clip i from `begins[i]` on."""
    sums = np.zeros(8, dtype=np.float32)
    for i in range(len(clips)):
        begin, end = offsets[clips[i]], offsets[clips[i] + 1]
        width = min(n_words, end - begin)
        sums[:] = 0
        for at in range(begin, end):
            row = table[motifs[at]]
            for lane in range(8):
                sums[lane] += row[lane]
            place = at - begin - (width - 1)
            if place < 0:
                continue
            most = sums[1]
            for lane in range(2, 8):
                most = max(most, abs(sums[lane]))
            found[begins[i] + place] = most / sums[0]
            row = table[motifs[at - width + 1]]
            for lane in range(8):
                sums[lane] -= row[lane]
