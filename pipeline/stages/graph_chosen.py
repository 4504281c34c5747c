"""Of a large lake, the clips that the neighbour graph compares with each clip: those that short vectors find near.

To compare all clips with all costs more with every clip. Each method has a vector a clip that is made in no time and
whose distances follow the method's; what is near by any of them is compared by all.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Int64Array

CHOSEN: Final = 64  # nearest clips by each method
BLOCK: Final = 256  # clips whose distances from all are worked out at a time
ALIKE: Final = 4  # times as many are taken where they are as far as the last of the nearest
SLACK: Final = 1e-5  # relative, of distances in single precision


@dataclass(frozen=True)
class Chosen:
    """The clips that one clip is compared with.

    Attributes:
        nodes: [c] ascending.
        apart: by method, [c] squared distances by its vectors; infinite where it has none of either.
        radii: by method, the distance up to which it chose; negative where it chose none, or not all at one distance.
    """

    nodes: Int64Array
    apart: Mapping[str, Float32Array]
    radii: Mapping[str, float]

    def within(self, radii: Mapping[str, float]) -> BoolArray:
        """[c] which of them these radii would have chosen, too."""
        inside = np.zeros(len(self.nodes), dtype=np.bool_)
        for method, apart in self.apart.items():
            inside |= apart <= _reach(radii.get(method, -1.0))
        return inside


@dataclass(frozen=True)
class Vectors:
    """The short vectors of one method: [n, D], and the node of each row, ascending."""

    nodes: Int64Array
    rows: Float32Array


def chosen_of(vectors: Mapping[str, Vectors], own: Sequence[int], count: int = CHOSEN) -> Iterator[Chosen]:
    """For each of some nodes the clips that are among the `count` nearest to it by any method, without itself.

    Those as far as the last of them are chosen, too: so the choice does not hang on the order of clips.
    """
    nodes = np.unique(np.concatenate([each.nodes for each in vectors.values()]))
    for start in range(0, len(own), BLOCK):
        block = np.array(own[start : start + BLOCK], dtype=np.int64)
        apart = {method: _apart(each, block, nodes) for method, each in vectors.items()}
        for at in range(len(block)):
            yield _chosen(nodes, {method: rows[at] for method, rows in apart.items()}, count)


def _apart(vectors: Vectors, block: Int64Array, nodes: Int64Array) -> Float32Array:
    """[b, n] squared distances of some nodes from all; infinite from itself, and where there is no vector."""
    found = np.full((len(block), len(nodes)), np.inf, dtype=np.float32)
    known = np.isin(block, vectors.nodes)
    asked = vectors.rows[np.searchsorted(vectors.nodes, block[known])]
    squares = np.einsum("nd,nd->n", vectors.rows, vectors.rows)
    between = np.einsum("bd,bd->b", asked, asked)[:, None] + squares - 2 * (asked @ vectors.rows.T)
    found[np.ix_(known, np.searchsorted(nodes, vectors.nodes))] = np.maximum(between, 0)
    found[np.arange(len(block)), np.searchsorted(nodes, block)] = np.inf
    return found


def _chosen(nodes: Int64Array, apart: Mapping[str, Float32Array], count: int) -> Chosen:
    taken = np.zeros(len(nodes), dtype=np.bool_)
    radii: dict[str, float] = {}
    for method, row in apart.items():
        there = row[np.isfinite(row)]
        last = min(count, len(there)) - 1
        radius = float(np.partition(there, last)[last]) if len(there) else -1.0
        near = np.flatnonzero(row <= _reach(radius))
        if len(near) > ALIKE * count:
            near, radius = near[np.argsort(row[near], kind="stable")[: ALIKE * count]], -1.0
        taken[near] = True
        radii[method] = radius
    return Chosen(nodes[taken], {method: row[taken] for method, row in apart.items()}, radii)


def _reach(radius: float) -> float:
    return radius + SLACK * abs(radius)
