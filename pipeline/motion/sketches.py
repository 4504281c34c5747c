"""Short vectors in the place of long sequences: near ones are looked at, far ones are not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, FloatArray
from motionlake.kernels import few, njit
from motionlake.motion.resampling import interpolated, paced_places
from numpy.typing import NDArray

LARGEST: Final = 127
BLOCK: Final = 16_384  # rows that are multiplied at a time without a kernel
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


@dataclass(frozen=True)
class Sketches:
    """Short vectors of n clips, in whole numbers of steps: a quarter of the memory that a search goes through.

    Attributes:
        places: [n, w].
        steps: [w] how long a step is along each direction.
        norms: [n] minus half the squared length of each; minus infinity for one that is not known.
    """

    places: NDArray[np.int8]
    steps: Float32Array
    norms: Float32Array

    @staticmethod
    def of(vectors: Float32Array, known: BoolArray) -> Sketches:
        """Of vectors [n, w], some of which are known."""
        farthest = np.abs(vectors).max(axis=0, initial=0)
        steps = np.where(farthest > 0, farthest / LARGEST, 1).astype(np.float32)
        places = np.rint(vectors / steps).astype(np.int8)
        rounded = places * steps
        norms = np.where(known, -np.einsum("nw,nw->n", rounded, rounded) / 2, -np.inf)
        return Sketches(places, steps, norms.astype(np.float32))

    def nearness(self, sketch: Float32Array) -> Float32Array:
        """[n] greater for what is nearer to a sketch [w]: half its squared length less half the squared distance."""
        found = self.norms.copy()
        multiply = _add_products_plainly if few(0) else _add_products
        multiply(self.places, self.steps * sketch, found)
        return found


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def _add_products(places: NDArray[np.int8], query: Float32Array, found: Float32Array) -> None:
    """Kernel: add to found [n] the products of places [n, w] and a query [w]."""
    for row in range(len(places)):
        total = np.float32(0)
        for i in range(len(query)):
            total += np.float32(places[row, i]) * query[i]
        found[row] += total


def _add_products_plainly(places: NDArray[np.int8], query: Float32Array, found: Float32Array) -> None:
    """What `_add_products` does, without a kernel."""
    for first in range(0, len(places), BLOCK):
        found[first : first + BLOCK] += places[first : first + BLOCK].astype(np.float32) @ query
