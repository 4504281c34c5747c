"""Cutting a clip's features into motion words (Deep Motifs, section 3.1).

A clip of T frames gives max(1, (T - length) // stride + 1) words, the first at frame 0. A clip shorter than
one word gives one word, padded by repeating its last frame: every clip has at least one word.
"""

from __future__ import annotations

import numpy as np
from motionlake.motion.features import Float32Array, WordConfig
from numpy.typing import NDArray


def windows(n_frames: int, config: WordConfig) -> NDArray[np.int64]:
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
