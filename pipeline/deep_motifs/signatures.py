"""Motion signatures: tf-idf histograms of a clip's motifs (Deep Motifs, section 4.2).

tf is the share of the clip's words that belong to a motif. idf = ln((1 + N) / (1 + n)) + 1, with N clips in
the corpus and n of them holding the motif: the smooth variant, positive even for a motif that every clip
holds, finite for one that none does. A signature is tf * idf divided by its sum: a distribution of mass 1.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array, IntArray


def motif_counts(motifs: IntArray, k: int) -> Int64Array:
    """[K] how many of a clip's words ([n] motif indices) belong to each of `k` motifs."""
    return np.asarray(np.bincount(motifs, minlength=k), dtype=np.int64)


def document_frequency(counts: IntArray) -> Int64Array:
    """[K] number of clips that hold each motif; `counts` [clips, K]."""
    return np.asarray(np.count_nonzero(counts, axis=0), dtype=np.int64)


def inverse_document_frequency(clips_with_motif: IntArray, n_clips: int) -> Float64Array:
    """[K] idf from how many of `n_clips` hold each motif."""
    return np.asarray(np.log((1 + n_clips) / (1 + clips_with_motif)) + 1, dtype=np.float64)


def tf_idf(counts: IntArray, idf: Float64Array) -> Float32Array:
    """[..., K] tf-idf histograms of motif counts [..., K], each of mass 1; `signatures.sql` does it for clips."""
    weights = counts * idf
    return np.asarray(weights / weights.sum(axis=-1, keepdims=True), dtype=np.float32)


def signature(counts: IntArray, idf: Float64Array) -> Float32Array:
    """[K] signature of a clip with motif `counts` [K].

    Raises:
        ValueError: a clip without words.
    """
    if not (counts * idf).sum() > 0:
        raise ValueError("a clip without words has no signature")
    return tf_idf(counts, idf)


def signatures(clips: Sequence[IntArray], k: int) -> tuple[Float32Array, Float64Array]:
    """Signatures [clips, K] of a corpus, and its idf [K], from the motif indices of each clip's words."""
    counts = np.stack([motif_counts(motifs, k) for motifs in clips])
    idf = inverse_document_frequency(document_frequency(counts), len(counts))
    return np.stack([signature(row, idf) for row in counts]), idf


def window_signatures(motifs: IntArray, idf: Float64Array, n_words: int) -> Float32Array:
    """Signatures of a window sliding over a clip word by word (sections 6.1 and 6.2).

    Args:
        motifs: [w] motif of each word of a clip, in time.
        idf: [K].
        n_words: words of a window.

    Returns:
        [max(1, w - n_words + 1), K]; a clip of fewer words than a window gives one, of all its words.

    Raises:
        ValueError: a clip without words, or `n_words` < 1.
    """
    if len(motifs) == 0 or n_words < 1:
        raise ValueError(f"{len(motifs)} words have no windows of {n_words}")
    present = np.zeros((len(motifs) + 1, len(idf)), dtype=np.int64)
    present[np.arange(1, len(motifs) + 1), motifs] = 1
    running = np.cumsum(present, axis=0)
    width = min(n_words, len(motifs))
    return tf_idf(running[width:] - running[:-width], idf)
