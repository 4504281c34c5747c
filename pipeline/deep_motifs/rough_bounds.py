"""Rough lower bounds of all windows of many clips: kernels of `range_bounds`.

About a thousand words are looked at together, whatever clips they are of. What words add is summed up first, each word
after the last, and then the sums of all windows are differences of two of these, many side by side. Sums are whole
numbers, whose differences are right even where the sums themselves are too great for them.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Int32Array, Int64Array
from motionlake.kernels import njit
from numpy.typing import NDArray

ROUGH: Final = 4  # lanes of a table of bounds that are looked at: the weight, and three distances
_BLOCK: Final = 1024  # windows; what is known of so many stays in the cache of a core


@njit(cache=True, nogil=True, error_model="numpy")
def roughly_of_clips(
    table: Int32Array, motifs: NDArray[np.uint16], offsets: Int64Array, n_words: int, first: int, last: int,
    found: Float32Array,
) -> None:  # fmt: skip
    """Write the least bound of all windows of each of clips [first, last); what has no words is left as it is.

    Args:
        table: [K, `ROUGH`] what a word of each motif adds to the sums of a window.
        motifs: [W] of all words.
        offsets: [n + 1] where the words of each clip begin.
        n_words: of a window; of a clip that has fewer, all are one window.
        first, last: clips.
        found: [n].
    """
    block = max(_BLOCK, 4 * n_words)  # so that few words are looked at twice
    sums, bounds = np.zeros((ROUGH, block + n_words), dtype=np.int32), np.empty(block, dtype=np.float32)
    at, end, clip, best = offsets[first], offsets[last], first, np.float32(np.inf)
    while clip < last:
        words = motifs[at : min(at + block + n_words - 1, end)]
        _running(table, words, sums[0, 1:], sums[1, 1:], sums[2, 1:], sums[3, 1:])
        count = max(0, len(words) - n_words + 1)
        here = bounds[:count]
        ends = sums[0, n_words:], sums[1, n_words:], sums[2, n_words:], sums[3, n_words:]
        _bounds(*ends, sums[0], sums[1], sums[2], sums[3], here)
        upto = at + block
        while clip < last:
            begin, last_start = offsets[clip], offsets[clip + 1] - n_words
            if last_start >= begin:
                best = min(best, _least(here[max(begin, at) - at : min(last_start + 1, upto) - at]))
                if last_start >= upto:  # the rest of its windows are in the next block
                    break
                found[clip] = best
            elif begin < offsets[clip + 1]:
                found[clip] = _whole(table, motifs[begin : offsets[clip + 1]])
            clip, best = clip + 1, np.float32(np.inf)
        at = upto


@njit(cache=True, nogil=True, error_model="numpy")
def _running(
    table: Int32Array, words: NDArray[np.uint16], weight: Int32Array, first: Int32Array, second: Int32Array,
    third: Int32Array,
) -> None:  # fmt: skip
    """Kernel: running sums of the lanes over the motifs of words."""
    a = b = c = d = 0
    for at in range(len(words)):
        motif = words[at]
        a, b, c, d = a + table[motif, 0], b + table[motif, 1], c + table[motif, 2], d + table[motif, 3]
        weight[at], first[at], second[at], third[at] = a, b, c, d


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"nsz", "nnan"})
def _bounds(
    a: Int32Array, b: Int32Array, c: Int32Array, d: Int32Array, e: Int32Array, f: Int32Array, g: Int32Array,
    h: Int32Array, found: Float32Array,
) -> None:  # fmt: skip
    """Kernel: the bound of each window, from the sums of the lanes up to its end and up to its beginning."""
    for at in range(len(found)):
        weight, least = np.float32(np.int32(a[at] - e[at])), np.float32(np.int32(b[at] - f[at]))
        one, other = np.float32(np.int32(c[at] - g[at])), np.float32(np.int32(d[at] - h[at]))
        found[at] = max(max(abs(one), abs(other)), least) / weight


@njit(cache=True, nogil=True, fastmath={"nsz", "nnan", "reassoc"})
def _least(values: Float32Array) -> np.float32:
    best = np.float32(np.inf)
    for value in values:
        best = min(best, value)
    return best


@njit(cache=True, nogil=True, error_model="numpy")
def _whole(table: Int32Array, words: NDArray[np.uint16]) -> np.float32:
    """Kernel: the bound of all words of a clip."""
    a = b = c = d = 0
    for motif in words:
        row = table[motif]
        a, b, c, d = a + row[0], b + row[1], c + row[2], d + row[3]
    return np.float32(max(max(abs(c), abs(d)), b)) / np.float32(a)
