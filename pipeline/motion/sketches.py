"""Short vectors in the place of long sequences: near ones are looked at, far ones are not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, FloatArray
from motionlake.motion.resampling import interpolated, paced_places

BY_PATH: Final = 0.5  # how much of an instant is told by the way gone so far; the rest by time


def instants(frames: FloatArray, count: int) -> Float32Array:
    """[count, D] a sequence [m, D] at so many instants, half of them by time and half by the way that it has gone.

    Two performances of one motion, of which one hurries where the other lingers, are nearer at the same share of their
    way than of their time.
    """
    exact = np.asarray(frames, dtype=np.float64)
    places = paced_places(exact, count, BY_PATH)
    return np.asarray(interpolated(exact, places), dtype=np.float32)


@dataclass(frozen=True)
class Directions:
    """What is left of vectors [D]: where they lie along `matrix` [D, w] from `mean` [D]."""

    mean: Float32Array
    matrix: Float32Array

    @staticmethod
    def of(rows: FloatArray, width: int) -> Directions:
        """The principal directions of rows [n, D] about their mean, as many as `width` or D."""
        exact = np.asarray(rows, dtype=np.float64)
        mean = exact.mean(axis=0) if len(exact) else np.zeros(exact.shape[1])
        apart = exact - mean
        _, found = np.linalg.eigh(apart.T @ apart)
        matrix = np.ascontiguousarray(found[:, ::-1][:, :width], dtype=np.float32)
        return Directions(mean.astype(np.float32), matrix)

    def project(self, rows: FloatArray) -> Float32Array:
        """[..., w] of rows [..., D]."""
        return np.asarray((rows - self.mean) @ self.matrix, dtype=np.float32)


def searchable(sketches: Float32Array) -> Float32Array:
    """[n, w + 1] sketches [n, w] with a column more, by which one product tells how near each is (`nearness`)."""
    return np.column_stack([sketches, -np.einsum("nw,nw->n", sketches, sketches) / 2])


def nearness(kept: Float32Array, sketch: Float32Array) -> Float32Array:
    """[n] greater for what is nearer to a sketch [w], of rows as `searchable` gives them."""
    return np.asarray(kept @ np.append(sketch, np.float32(1)))
