"""Clips as batches that a network reads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import torch
from motionlake.motion.features import Float32Array
from numpy.typing import NDArray
from torch import Tensor

# A longer clip is read in windows of at most so many frames (at 30 a second), each half over the one before.
LONGEST: Final = 600


def resampled(clip: Float32Array, frames: int) -> Float32Array:
    """[frames, J, 3] a clip [T, J, 3] at so many instants, evenly from its first frame to its last."""
    at = np.linspace(0, len(clip) - 1, frames)
    before = np.minimum(at.astype(int), max(0, len(clip) - 2))
    after = np.minimum(before + 1, len(clip) - 1)
    share = (at - before).astype(np.float32)[:, None, None]
    return np.asarray(clip[before] + (clip[after] - clip[before]) * share, dtype=np.float32)


def windows(clip: Float32Array, longest: int = LONGEST) -> list[Float32Array]:
    """A clip in windows of equal length, each starting half a window after the one before; itself if it is short."""
    if len(clip) <= longest:
        return [clip]
    count = int(np.ceil(2 * len(clip) / longest)) - 1
    starts = np.linspace(0, len(clip) - longest, count).round().astype(int)
    return [_from_root(clip[start : start + longest]) for start in starts]


def padded(clips: Sequence[Float32Array]) -> tuple[Tensor, Tensor]:
    """[B, T, J, 3] clips of any length, filled up with their last frame, and their lengths [B]."""
    lengths = np.array([len(clip) for clip in clips])
    filled = [np.pad(clip, [(0, lengths.max() - len(clip)), (0, 0), (0, 0)], mode="edge") for clip in clips]
    return torch.from_numpy(np.stack(filled)), torch.from_numpy(lengths)


def at_speeds(clip: Float32Array) -> list[Float32Array]:
    """The clip, every other frame of it, and with a frame put between each two (DeepHuMS, section 3.3.2)."""
    return [clip, clip[::2], resampled(clip, max(1, 2 * len(clip) - 1))]


def _from_root(clip: Float32Array) -> Float32Array:
    """The clip with its root path starting at zero."""
    moved = clip.copy()
    moved[:, 0] -= clip[0, 0]
    return moved


def order(count: int, batch: int, rng: np.random.Generator) -> list[NDArray[np.int64]]:
    """Indices of the batches of an epoch: all in random order, no batch smaller than half of `batch`."""
    shuffled = rng.permutation(count)
    return np.array_split(shuffled, max(1, round(count / batch)))
