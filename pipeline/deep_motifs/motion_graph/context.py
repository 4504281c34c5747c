"""How far the contexts of a transition's two ends are apart: signatures of windows of words around them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from motionlake.deep_motifs.emd import emd
from motionlake.deep_motifs.signatures import window_signatures
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]
Int64Array = NDArray[np.int64]
# Stored distances are rounded far below what differs, so that a transition and its reverse are equal.
DECIMALS = 9


def context_start(word: Int64Array, words: Int64Array, context: int) -> Int64Array:
    """First word of the window of `context` words around `word` of a clip of `words`; it stays within the clip."""
    return np.clip(word - context // 2, 0, np.maximum(words - context, 0))


def context_distances(
    motifs: Sequence[NDArray[np.integer]],
    ends: tuple[tuple[Int64Array, Int64Array], tuple[Int64Array, Int64Array]],
    idf: Float64Array,
    ground: Float64Array,
    context: int,
) -> Float64Array:
    """Earth mover's distance between the contexts of the two ends of transitions (section 6.4).

    Args:
        motifs: [w] motif of each word, of every clip.
        ends: (clip [n], word [n]) of either end.
        idf: [K] of the motifs.
        ground: [K, K] distances of the motifs.
        context: words of a window; a clip of fewer words is its own context.

    Returns:
        [n] in the unit of `ground`; windows that several transitions share are compared once.
    """
    lengths = np.array([len(m) for m in motifs], dtype=np.int64)
    first = np.concatenate([[0], np.cumsum(np.maximum(lengths - context, 0) + 1)])
    keys = [first[clip] + context_start(word, lengths[clip], context) for clip, word in ends]
    pairs, place = np.unique(np.sort(np.stack(keys, axis=1), axis=1), axis=0, return_inverse=True)
    signatures: dict[int, NDArray[np.float32]] = {}

    def signature(key: int) -> NDArray[np.float32]:
        clip = int(np.searchsorted(first, key, side="right")) - 1
        if clip not in signatures:
            signatures[clip] = window_signatures(motifs[clip], idf, context)
        return np.asarray(signatures[clip][key - first[clip]])

    found = np.array([emd(signature(int(p)), signature(int(q)), ground) for p, q in pairs], dtype=np.float64)
    return np.round(found[place.ravel()], DECIMALS) if len(pairs) else np.zeros(0)
