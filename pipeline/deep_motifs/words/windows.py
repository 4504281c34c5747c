"""Motion words: windows of features of one length and stride, and sets of them (Deep Motifs, section 3.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from motionlake.arrays import Float32Array, Int64Array
from motionlake.motion.features import WordConfig


def windows(n_frames: int, config: WordConfig) -> Int64Array:
    """[n] first frames of the words of a clip of `n_frames` feature frames.

    Raises:
        ValueError: a clip without frames.
    """
    if n_frames < 1:
        raise ValueError("a clip without frames has no words")
    return np.arange(0, max(n_frames - config.length, 0) + 1, config.stride, dtype=np.int64)


def padded(features: Float32Array, config: WordConfig) -> Float32Array:
    """[max(T, length), D]: the features, a short clip's last frame repeated until it fills one word."""
    missing = config.length - len(features)
    return features if missing <= 0 else np.pad(features, ((0, missing), (0, 0)), mode="edge")


def word_windows(features: Float32Array, config: WordConfig) -> Float32Array:
    """[n, length, D] words of a clip, read-only views on `features` ([T, D]) where it is long enough."""
    views = np.lib.stride_tricks.sliding_window_view(padded(features, config), config.length, axis=0)
    return views.transpose(0, 2, 1)[:: config.stride]


def native_range(start: int, fps: float, n_frames: int, config: WordConfig) -> tuple[int, int]:
    """The half-open range of a clip's own frames that a word covers.

    Args:
        start: the word's first frame at the words' rate, as `windows` gives it.
        fps: the clip's own frame rate.
        n_frames: F, frames of the clip at its own rate.

    Returns:
        (start, stop), never empty and inside the clip. Words that follow each other without overlap have
        ranges that do so too.
    """
    ratio = fps / config.fps
    first = min(round(start * ratio), n_frames - 1)
    return first, max(first + 1, min(round((start + config.length) * ratio), n_frames))


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
    starts: Int64Array
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
    def of_clips(cls, features: Sequence[Float32Array], config: WordConfig) -> tuple[Self, Int64Array]:
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

    def take(self, chosen: slice | Int64Array) -> Float32Array:
        """[n, length, D] copies of chosen words."""
        return np.asarray(self.frames[self.starts[chosen][:, None] + np.arange(self.length)])

    def chosen(self, chosen: slice | Int64Array) -> WordSet:
        """Some of the words, with the same frames."""
        return WordSet(self.frames, self.starts[chosen], self.length)
