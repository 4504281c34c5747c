"""The sub-motion encoder of a file, with torch where its recipe needs it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from motionlake.arrays import Float32Array, Int64Array
from motionlake.deephums.config import SUBMOTION_KEY
from motionlake.deephums.piece_encoder import PieceEncoder
from motionlake.weights import read_tensors


class SubmotionEncoder(Protocol):
    """Makes vectors, of length one, of pieces and windows of clips as `clip_sequence` has them."""

    def embed(self, sequences: Sequence[Float32Array]) -> Float32Array:
        """[n, 512] of n pieces [T, 15, 3]."""
        ...

    def embed_windows(self, sequence: Float32Array, windows: Int64Array) -> Float32Array:
        """[n, 512] of the windows [n, 2] of one clip, each [first, last)."""
        ...


def load_encoder(path: Path) -> SubmotionEncoder:
    """The encoder of a file that `submotions.TrainedSubmotion.save` wrote; recipe "deephums" takes torch.

    Raises:
        ValueError: the file holds something else.
    """
    tensors, kept = read_tensors(path, SUBMOTION_KEY)
    if kept["config"]["recipe"] == "default":
        return PieceEncoder(tensors)
    from motionlake.deephums.submotions import load_submotion

    return load_submotion(path)
