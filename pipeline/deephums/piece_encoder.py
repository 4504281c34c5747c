"""The trained sub-motion encoder without torch, whose import takes longer than all else that finds a piece.

What the network of recipe "default" (`submotions.FramePooling`) makes of pieces, to rounding.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import erf, sqrt
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float32Array, Int64Array
from motionlake.deephums.config import DIMENSION
from motionlake.deephums.sequence import BONES
from motionlake.kernels import njit
from motionlake.motion.skeleton import COMMON
from numpy.typing import NDArray

# Brings joints (body lengths) near the range where weights start.
SCALE: Final = 4.0
SMALLEST: Final = 1e-3  # of an average body's bones, how long those of a frame are at least
_EPSILON: Final = 1e-5  # of torch's layer norm
_TINY: Final = 1e-12  # of torch's normalise
_SIDES: Final = tuple([COMMON.index(f"{side}_{joint}") for joint in ("hip", "shoulder")] for side in ("left", "right"))
_BONES: Final = tuple(zip(*([COMMON.index(name) for name in bone] for bone in BONES), strict=True))


class PieceEncoder:
    """Recipe "default" by NumPy; a `submotion_encoder.SubmotionEncoder`.

    Args:
        tensors: the weights of a `submotions.FramePooling`, by name.
    """

    def __init__(self, tensors: Mapping[str, NDArray[Any]]) -> None:
        around = tensors["around.weight"]  # [hidden, 90, width]
        self._reach = around.shape[2] // 2
        self._around = np.ascontiguousarray(around.transpose(2, 1, 0).reshape(-1, len(around)), dtype=np.float32)
        self._tensors = {name: np.asarray(value, dtype=np.float32) for name, value in tensors.items()}

    def embed(self, sequences: Sequence[Float32Array]) -> Float32Array:
        """As `submotions.TrainedSubmotion.embed`."""
        found = [self._projected(self._frames(sequence).max(axis=0)[None])[0] for sequence in sequences]
        return np.array(found, dtype=np.float32).reshape(-1, DIMENSION)

    def embed_windows(self, sequence: Float32Array, windows: Int64Array) -> Float32Array:
        """As `submotions.TrainedSubmotion.embed_windows`."""
        return self._projected(greatest(self._frames(sequence), windows))

    def _frames(self, sequence: Float32Array) -> Float32Array:
        """[T, 2 hidden] what is seen around each frame of a piece."""
        seen = np.pad(frame_by_frame(sequence), ((self._reach, self._reach), (0, 0)))
        count = len(sequence)
        stacked = np.concatenate([seen[step : step + count] for step in range(2 * self._reach + 1)], axis=1)
        first = self._normed(stacked @ self._around + self._tensors["around.bias"], "first")
        widened = first @ self._tensors["widen.weight"].T + self._tensors["widen.bias"]
        return self._normed(widened, "second")

    def _normed(self, values: Float32Array, layer: str) -> Float32Array:
        weight, bias = (self._tensors[f"{layer}.{name}"] for name in ("weight", "bias"))
        found = np.empty_like(values)
        _gelu_of_normed(values, weight, bias, _EPSILON, found)
        return found

    def _projected(self, pooled: Float32Array) -> Float32Array:
        vectors = pooled @ self._tensors["project.weight"].T
        return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), _TINY), dtype=np.float32)


def frame_by_frame(clip: Float32Array) -> Float32Array:
    """[T, 90] of a piece [T, 15, 3], as `submotions.frame_by_frame` of several."""
    at_root = clip.copy()
    at_root[:, 0] = 0
    bones = np.linalg.norm(at_root[:, _BONES[0]] - at_root[:, _BONES[1]], axis=2).sum(axis=1)
    sized = clip / np.maximum(bones / np.float32(sum(BONES.values())), SMALLEST)[:, None, None]
    left, right = _SIDES
    across = _unit(sized[:, left] - sized[:, right]).sum(axis=1)
    flat = _unit(across[:, [0, 2]] + np.float32(1e-6))
    cos, sin = flat[:, :1], -flat[:, 1:]

    def turned(values: Float32Array) -> Float32Array:
        x, y, z = values[..., 0], values[..., 1], values[..., 2]
        return np.stack([x * cos - z * sin, y, x * sin + z * cos], axis=-1)

    body = turned(sized)
    body[:, 0] = 0
    motion = _to_next(body)
    motion[:, :1] = turned(_to_next(sized[:, :1]))
    return np.asarray(np.concatenate([body.reshape(len(clip), -1), motion.reshape(len(clip), -1)], axis=1) * SCALE)


def greatest(frames: Float32Array, windows: Int64Array) -> Float32Array:
    """[n, D] maximum over the frames [T, D] of each of the windows [n, 2], [first, last); none is empty."""
    ended = np.concatenate([frames, frames[-1:]])  # so that the frame after the last can be named
    return np.maximum.reduceat(ended, windows.ravel(), axis=0)[::2]


def _unit(vectors: Float32Array) -> Float32Array:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), np.float32(_TINY)))


def _to_next(clip: Float32Array) -> Float32Array:
    """[T, J, 3] from each frame to the next; zero in the last."""
    motion = np.zeros_like(clip)
    motion[:-1] = clip[1:] - clip[:-1]
    return motion


@njit(cache=True, nogil=True)
def _gelu_of_normed(
    values: Float32Array, weight: Float32Array, bias: Float32Array, epsilon: float, out: Float32Array
) -> None:
    """Kernel: rows [T, D] brought to mean zero and variance one, weighed [D], and through torch's exact `gelu`."""
    rows, width = values.shape
    for t in range(rows):
        mean = 0.0
        for d in range(width):
            mean += values[t, d]
        mean /= width
        spread = 0.0
        for d in range(width):
            spread += (values[t, d] - mean) ** 2
        by = 1 / sqrt(spread / width + epsilon)
        for d in range(width):
            x = (values[t, d] - mean) * by * weight[d] + bias[d]
            out[t, d] = 0.5 * x * (1 + erf(x / sqrt(2.0)))
