"""Many words at once, kept as the frames that they share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from motionlake.deep_motifs.words.windows import padded, windows
from motionlake.motion.features import Float32Array, WordConfig
from numpy.typing import NDArray

Index = NDArray[np.int64]


@dataclass(frozen=True)
class WordSet:
    """N words of `length` frames: word i is `frames[starts[i] : starts[i] + length]`.

    Words of stride 4 and length 16 share their frames, so that N words of clips take 4 N frames of memory.

    Attributes:
        frames: [T, D] float32, C-contiguous.
        starts: [N] first frame of each word.
        length: frames of a word.

    Raises:
        ValueError: frames that are not two-dimensional, or a word that reaches beyond them.
    """

    frames: Float32Array
    starts: Index
    length: int

    def __post_init__(self) -> None:
        if self.frames.ndim != 2 or self.length < 1:
            raise ValueError(f"frames of shape {self.frames.shape} hold no words of {self.length} frames")
        if len(self) and (self.starts.min() < 0 or self.starts.max() + self.length > len(self.frames)):
            raise ValueError("a word reaches beyond its clip")

    @classmethod
    def of_words(cls, words: Float32Array) -> Self:
        """`words` [N, length, D], each with frames of its own."""
        if words.ndim != 3 or not words.shape[1]:
            raise ValueError(f"words have shape {words.shape}, not [N, length, D]")
        n, length, width = words.shape
        frames = np.ascontiguousarray(words, dtype=np.float32).reshape(n * length, width)
        return cls(frames, np.arange(n, dtype=np.int64) * length, length)

    @classmethod
    def of_clips(cls, features: Sequence[Float32Array], config: WordConfig) -> tuple[Self, Index]:
        """The words of clips of [T, D] frames each, and [N] the index of the clip each word is of.

        Raises:
            ValueError: no clip, or a clip without frames.
        """
        if not features:
            raise ValueError("no clips: no words")
        filled = [padded(np.asarray(clip, dtype=np.float32), config) for clip in features]
        firsts = np.cumsum([0, *(len(clip) for clip in filled[:-1])])
        starts = [windows(len(clip), config) for clip in features]
        clips = np.repeat(np.arange(len(features)), [len(s) for s in starts])
        placed = np.concatenate([first + s for first, s in zip(firsts, starts, strict=True)])
        return cls(np.ascontiguousarray(np.concatenate(filled)), placed, config.length), clips

    def __len__(self) -> int:
        return len(self.starts)

    @property
    def width(self) -> int:
        """D: numbers a frame."""
        return int(self.frames.shape[1])

    def take(self, chosen: slice | Index) -> Float32Array:
        """[n, length, D] copies of chosen words."""
        return np.asarray(self.frames[self.starts[chosen][:, None] + np.arange(self.length)])

    def chosen(self, chosen: slice | Index) -> WordSet:
        """Some of the words, with the same frames."""
        return WordSet(self.frames, self.starts[chosen], self.length)
