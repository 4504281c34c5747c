"""Short vectors in the place of long sequences: near ones are looked at, far ones are not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, FloatArray
from motionlake.kernels import few, njit
from motionlake.motion.resampling import interpolated, paced_places
from numpy.typing import NDArray

LARGEST: Final = 8191
MOST: Final = np.iinfo(np.int16).max  # steps of a query
WHOLE: Final = np.iinfo(np.int32).max  # as large are products of vectors and a query, both in whole numbers
TINY: Final = float(np.finfo(np.float32).tiny)
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
    """Short vectors of n clips, in whole numbers of steps: half the memory that a search would go through.

    In numbers of one byte most clips would lie within a few steps of one another, for a few lie far out.

    Attributes:
        places: [n, w].
        steps: [w] how long a step is along each direction.
        norms: [n] minus half the squared length of each; minus infinity for one that is not known.
    """

    places: NDArray[np.int16]
    steps: Float32Array
    norms: Float32Array

    @staticmethod
    def of(vectors: Float32Array, known: BoolArray) -> Sketches:
        """Of vectors [n, w], some of which are known."""
        farthest = np.abs(vectors).max(axis=0, initial=0)
        steps = np.where(farthest > 0, farthest / LARGEST, 1).astype(np.float32)
        places = np.rint(vectors / steps).astype(np.int16)
        rounded = places * steps
        norms = np.where(known, -np.einsum("nw,nw->n", rounded, rounded) / 2, -np.inf)
        return Sketches(places, steps, norms.astype(np.float32))

    def nearness(self, sketch: Float32Array) -> Float32Array:
        """[n] greater for what is nearer to a sketch [w]: half its squared length less half the squared distance."""
        asked = self.steps * sketch
        finest = min(MOST, WHOLE // (LARGEST * max(1, len(asked))))
        step = np.float32(max(float(np.abs(asked).max(initial=0)) / finest, TINY))
        query = np.rint(asked / step).astype(np.int16)
        products = (_products_plainly if few(0) else _products)(self.places, query)
        return np.asarray(self.norms + products * step, dtype=np.float32)


@njit(cache=True, nogil=True)
def _products(places: NDArray[np.int16], query: NDArray[np.int16]) -> Float32Array:
    """Kernel: [n] products of places [n, w] and a query [w]: of whole numbers, so that they are the same everywhere."""
    found = np.empty(len(places), np.float32)
    for row in range(len(places)):
        total = np.int32(0)
        for i in range(len(query)):
            total += np.int32(places[row, i]) * np.int32(query[i])
        found[row] = total
    return found


def _products_plainly(places: NDArray[np.int16], query: NDArray[np.int16]) -> Float32Array:
    """What `_products` does, without a kernel."""
    found = np.empty(len(places), np.float32)
    for first in range(0, len(places), BLOCK):
        found[first : first + BLOCK] = places[first : first + BLOCK].astype(np.float64) @ query.astype(np.float64)
    return found
