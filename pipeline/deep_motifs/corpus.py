"""The signed words of a lake as arrays: what every application of motifs and signatures reads."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from motionlake.arrays import Float32Array, Float64Array, Int32Array, Int64Array
from motionlake.deep_motifs.emd import ground_distances
from motionlake.deep_motifs.signatures import window_signatures


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
        """[max(1, w - n_words + 1), K] signatures of a window of `n_words` words sliding over a clip of w.

        A clip of fewer words gives one window, the whole of it.
        """
        return window_signatures(self.motifs[self.words_of(clip)], self.idf, n_words)
