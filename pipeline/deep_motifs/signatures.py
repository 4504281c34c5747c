"""Motion signatures: tf-idf histograms of a clip's motifs (Deep Motifs, section 4.2), and the words they are made of.

tf is the share of the clip's words that belong to a motif. idf = ln((1 + N) / (1 + n)) + 1, with N clips in
the corpus and n of them holding the motif: the smooth variant, positive even for a motif that every clip
holds, finite for one that none does. A signature is tf * idf divided by its sum: a distribution of mass 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int32Array, Int64Array, IntArray
from motionlake.deep_motifs.emd import ground_distances
from numpy.typing import NDArray

Number = TypeVar("Number", bound=np.number)


def motif_counts(motifs: IntArray, k: int) -> Int64Array:
    """[K] how many of a clip's words ([n] motif indices) belong to each of `k` motifs."""
    return np.asarray(np.bincount(motifs, minlength=k), dtype=np.int64)


def inverse_document_frequency(counts: IntArray) -> Float64Array:
    """[K] idf from the motif counts [clips, K] of a corpus."""
    clips_with_motif = np.count_nonzero(counts, axis=0)
    return np.asarray(np.log((1 + len(counts)) / (1 + clips_with_motif)) + 1, dtype=np.float64)


def tf_idf(counts: IntArray, idf: Float64Array) -> Float32Array:
    """[..., K] tf-idf histograms of motif counts [..., K], each of mass 1; `signatures_of` in SQL does it for clips."""
    weights = counts * idf
    return np.asarray(weights / weights.sum(axis=-1, keepdims=True), dtype=np.float32)


def signature(counts: IntArray, idf: Float64Array) -> Float32Array:
    """[K] signature of a clip with motif `counts` [K]; `ValueError` for a clip without words."""
    if not (counts * idf).sum() > 0:
        raise ValueError("a clip without words has no signature")
    return tf_idf(counts, idf)


def signatures(clips: Sequence[IntArray], k: int) -> tuple[Float32Array, Float64Array]:
    """Signatures [clips, K] of a corpus, and its idf [K], from the motif indices of each clip's words."""
    counts = np.stack([motif_counts(motifs, k) for motifs in clips])
    idf = inverse_document_frequency(counts)
    return np.stack([signature(row, idf) for row in counts]), idf


def window_signatures(motifs: IntArray, idf: Float64Array, n_words: int) -> Float32Array:
    """[max(1, w - n_words + 1), K] signatures of a window of `n_words` words sliding over a clip (sections 6.1, 6.2).

    A clip of fewer words than a window gives one, of all its words.

    Args:
        motifs: [w] motif of each word of a clip, in time, one at least.
        idf: [K].
        n_words: words of a window.
    """
    width = min(n_words, len(motifs))
    first = np.arange(len(motifs) - width + 1)
    return range_signatures(motifs, idf, first, first + width)


def range_signatures(motifs: IntArray, idf: Float64Array, first: Int64Array, last: Int64Array) -> Float32Array:
    """[n, K] signatures of the words `first[i]:last[i]` of a clip, `motifs` [w]."""
    return tf_idf(range_sums(np.eye(len(idf), dtype=np.int64)[motifs], first, last), idf)


def range_sums(rows: NDArray[Number], first: Int64Array, last: Int64Array) -> NDArray[Number]:
    """[n, c] sums of the rows `first[i]:last[i]` of `rows` [w, c]."""
    running = np.zeros((len(rows) + 1, rows.shape[1]), rows.dtype)
    np.cumsum(rows, axis=0, out=running[1:])
    return running[last] - running[first]


@dataclass(frozen=True)
class CorpusClip:
    """What is known of one clip; `frames` at its own rate `fps`."""

    clip: str
    dataset: str
    label: str | None
    subject: str | None
    split: str | None
    fps: float
    frames: int
    synthetic: bool = False


@dataclass(frozen=True)
class Corpus:
    """n clips, W words in the order of clips and of time, K motifs.

    Attributes:
        clips: n, by name.
        offsets: [n + 1]; the words of clip i are `offsets[i]:offsets[i + 1]`.
        motifs: [W] motif of each word.
        starts: [W] first frame of each word, at the clip's own rate.
        stops: [W] frame after its last.
        centroids: [K, d] of the motifs.
        idf: [K], frozen with the motifs.
        strength: [K] density of the motifs.
        model: name of the motifs: signatures of two models do not compare.
    """

    clips: list[CorpusClip]
    offsets: Int64Array
    motifs: Int32Array
    starts: Int64Array
    stops: Int64Array
    centroids: Float32Array
    idf: Float64Array
    strength: Float64Array
    model: str

    @cached_property
    def ground(self) -> Float64Array:
        """[K, K] distances of the motifs."""
        return ground_distances(self.centroids)

    @cached_property
    def positions(self) -> dict[str, int]:
        """Index of each clip by its name."""
        return {c.clip: i for i, c in enumerate(self.clips)}

    def words_of(self, clip: int) -> slice:
        """Where the words of a clip stand."""
        return slice(int(self.offsets[clip]), int(self.offsets[clip + 1]))

    def windows_of(self, clip: int, n_words: int) -> Float32Array:
        """`window_signatures` of a clip."""
        return window_signatures(self.motifs[self.words_of(clip)], self.idf, n_words)
