"""How nodes of a scene stand below their parents: translations, rotations and scales at the frames of a clip."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array, FloatArray
from motionlake.errors import ClipError
from motionlake.motion.rotations import IDENTITY, from_matrix, normalise

FLATTEST: Final = 1e-12  # a matrix whose determinant is smaller, its largest number being 1, turns a body into a plane
UNEQUAL: Final = 1e-3  # of a scale's largest number


@dataclass(frozen=True)
class Placing:
    """How one node stands below its parent, at F frames or, with F = 1, at all of them.

    Attributes:
        translation: [F, 3].
        rotation: [F, 4] unit quaternions (w, x, y, z).
        scale: [F, 3].
    """

    translation: Float64Array = field(default_factory=lambda: np.zeros((1, 3)))
    rotation: Float64Array = field(default_factory=lambda: IDENTITY[None])
    scale: Float64Array = field(default_factory=lambda: np.ones((1, 3)))

    @classmethod
    def of_matrices(cls, matrices: Float64Array) -> Placing:
        """Of [F, 4, 4] matrices that turn column vectors; shear is lost, as everywhere where nodes have none."""
        linear = matrices[:, :3, :3]
        if np.isfinite(matrices).all() and (linear == np.eye(3)).all():  # much of what rests
            return cls(matrices[:, :3, 3].copy(), *(np.tile(one, (len(matrices), 1)) for one in (IDENTITY, np.ones(3))))
        if not are_sound(matrices).all():
            raise ClipError("has a node whose matrix is no placement")
        scale = np.linalg.norm(linear, axis=1)
        scale[:, 0] *= np.where(np.linalg.det(linear) < 0, -1.0, 1.0)
        return cls(matrices[:, :3, 3].copy(), from_matrix(linear / scale[:, None, :]), scale)


@dataclass(frozen=True)
class Placings:
    """How N nodes stand below their parents; each part at F frames or, where it is one for all of them, at one.

    Attributes:
        translation: [F, N, 3].
        rotation: [F, N, 4] quaternions (w, x, y, z) of any length but zero.
        scale: [F, N, 3].
    """

    translation: FloatArray
    rotation: FloatArray
    scale: FloatArray

    @classmethod
    def of(cls, placings: Sequence[Placing]) -> Placings:
        """Of each node."""
        return cls(*(_stacked(parts) for parts in zip(*(vars(each).values() for each in placings), strict=True)))

    @property
    def first(self) -> Placings:
        """At the first frame."""
        return Placings(*(part[:1] for part in vars(self).values()))

    def of_nodes(self, nodes: Sequence[int]) -> list[Placing]:
        """Of some nodes; -1 is one that stands as its parent."""
        moves, turns, sizes = (np.asarray(part, np.float64) for part in vars(self).values())
        parts = (moves, normalise(turns), sizes)
        return [Placing() if node < 0 else Placing(*(part[:, node] for part in parts)) for node in nodes]

    @property
    def uneven(self) -> BoolArray:
        """[N] whether nodes are scaled more along one axis than along another."""
        size = np.abs(self.scale)
        if (size[..., :1] == size).all():
            return np.zeros(size.shape[1], bool)
        return np.asarray((np.ptp(size, axis=2) > UNEQUAL * size.max(axis=2)).any(axis=0))


def beside_each_other(placings: Sequence[Placings]) -> Placings:
    """Those of some nodes and those of others, in single precision where no number loses by it."""
    found = []
    for parts in zip(*(vars(each).values() for each in placings), strict=True):
        with np.errstate(over="ignore"):
            single = all(part.dtype.itemsize <= 4 or (part[:1].astype(np.float32) == part).all() for part in parts)
        nodes = [part.shape[1] for part in parts]
        whole = np.empty((max(map(len, parts)), sum(nodes), parts[0].shape[2]), np.float32 if single else np.float64)
        for part, end in zip(parts, itertools.accumulate(nodes), strict=True):
            whole[:, end - part.shape[1] : end] = part
        found.append(whole)
    return Placings(*found)


def are_sound(matrices: Float64Array) -> BoolArray:
    """[N] whether matrices [N, 4, 4] are placements that can be undone."""
    linear = matrices[:, :3, :3]
    with np.errstate(all="ignore"):
        size = np.abs(linear).max(axis=(1, 2))
        sized = (size > FLATTEST) & (size < 1 / FLATTEST) & np.isfinite(matrices).all(axis=(1, 2))
        scaled = np.where(sized[:, None, None], linear / size[:, None, None], 0.0)
        return np.asarray(sized & (np.abs(np.linalg.det(scaled)) > FLATTEST))


def _stacked(values: Sequence[Float64Array]) -> Float64Array:
    """[F, N, n] of [F, n] or [1, n] of each node."""
    stacked = np.empty((max(map(len, values)), len(values), values[0].shape[1]))
    for number, each in enumerate(values):
        stacked[:, number] = each
    return stacked
