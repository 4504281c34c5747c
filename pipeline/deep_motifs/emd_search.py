"""Exact nearest signatures by the Earth Mover's Distance, solving few of the transports.

A cheap bound orders the signatures, the distances of a few give a threshold, a tight bound is computed where
the cheap one is below it, and what is left is solved in ascending order of its bound until the next bound
exceeds the k-th smallest distance. Answers are those of solving them all, to the last bit.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, FloatArray, Int32Array, Int64Array, IntArray
from motionlake.deep_motifs.emd import (
    Signature,
    check_model,
    projection_bounds,
    transfer_bounds,
    transport,
    unit_mass,
    unit_masses,
)
from numpy.typing import NDArray

# The threshold comes from the k tightest among so many times k signatures that the cheap bound puts first.
PROBES: Final = 8
ROWS: Final = 4096


class Nearest(NamedTuple):
    """The nearest signatures, nearest first, ties by index; `solved` transports were solved for them."""

    indices: Int64Array
    distances: Float64Array
    solved: int


@dataclass(frozen=True)
class SignatureIndex:
    """n signatures prepared for search, once for any number of queries; see `build`.

    Attributes:
        ground: [K, K] distances of the motifs, a metric.
        offsets: [n + 1]; signature i is `masses` at `motifs`, from `offsets[i]` to `offsets[i + 1]`.
        motifs: [nnz] motifs where a signature has mass.
        masses: [nnz] their mass, 1 in all for a signature.
        projected: [n, K] float32 means of the distance from each motif.
        neighbours: [K, K] motifs by their distance from each.
        model: name of the motifs, where it is known.
    """

    ground: Float64Array
    offsets: Int64Array
    motifs: Int32Array
    masses: Float64Array
    projected: Float32Array
    neighbours: Int32Array
    model: str | None = None

    @classmethod
    def build(cls, signatures: FloatArray, ground: Float64Array, model: str | None = None) -> SignatureIndex:
        """From `signatures` [n, K] over motifs at `ground` distances [K, K] of one another.

        Raises:
            ValueError: a signature of another length, with negative weights or without mass.
        """
        lengths, motifs, masses, projected = [np.zeros(1, np.int64)], [], [], []
        for start in range(0, len(signatures), ROWS):
            rows = unit_masses(signatures[start : start + ROWS], ground)
            at = np.nonzero(rows)
            lengths.append(np.count_nonzero(rows, axis=1))
            motifs.append(at[1].astype(np.int32))
            masses.append(rows[at])
            projected.append((rows @ ground).astype(np.float32))
        return cls(
            ground,
            np.cumsum(np.concatenate(lengths)),
            np.concatenate([np.zeros(0, np.int32), *motifs]),
            np.concatenate([np.zeros(0), *masses]),
            np.concatenate([np.zeros((0, len(ground)), np.float32), *projected]),
            np.argsort(ground, axis=1, kind="stable").astype(np.int32),
            model,
        )

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @cached_property
    def diameter(self) -> float:
        """The largest ground distance."""
        return float(self.ground.max(initial=0.0))

    def mass(self, i: int) -> Float64Array:
        """[K] signature i at mass 1."""
        dense = np.zeros(len(self.ground))
        span = slice(self.offsets[i], self.offsets[i + 1])
        dense[self.motifs[span]] = self.masses[span]
        return dense

    def nearest(self, query: Signature, k: int, among: IntArray | None = None, model: str | None = None) -> Nearest:
        """The k signatures nearest to a query by `emd`; all where there are fewer.

        Args:
            query: [K] non-negative weights with a positive sum.
            k: how many.
            among: [m] indices of the signatures to choose from, each once; all by default.
            model: name of the query's motifs, where it is known.

        Raises:
            ValueError: k < 1, or a query that is no signature over the motifs of the index.
        """
        if k < 1:
            raise ValueError(f"k = {k}: ask for at least 1 nearest signature")
        check_model(model, self.model)
        p = unit_mass(query, self.ground)
        chosen = np.arange(len(self)) if among is None else np.asarray(among, dtype=np.int64)
        answers = _Answers(self, p, k)
        if len(chosen):
            cheap = self.cheap_bounds(p, chosen)
            probes, rest = _split(cheap, PROBES * k)
            answers.solve(chosen[probes], self.tight_bounds(p, chosen[probes]), at_most=k)
            rest = np.concatenate([probes, rest[cheap[rest] <= answers.threshold]])
            answers.solve(chosen[rest], self.tight_bounds(p, chosen[rest], answers.threshold))
        return answers.best()

    def cheap_bounds(self, mass: Float64Array, candidates: Int64Array) -> Float64Array:
        """[c] `projection_bounds` of a query of mass 1 [K] from signatures of the index."""
        return projection_bounds(mass @ self.ground, self.projected, candidates, self.diameter)

    def tight_bounds(self, mass: Float64Array, candidates: Int64Array, enough: float = np.inf) -> Float64Array:
        """[c] `transfer_bounds` of a query of mass 1 [K] from signatures of the index."""
        parts = (self.offsets, self.motifs, self.masses, self.ground, self.neighbours)
        return np.asarray(transfer_bounds(mass, *parts, candidates, enough), dtype=np.float64)


def nearest_signatures(
    query: Signature, signatures: FloatArray | SignatureIndex, ground: Float64Array, k: int
) -> tuple[Int64Array, Float64Array]:
    """The k signatures nearest to a query, and their distances; the same as sorting `emd_many`, ties by index.

    Args:
        query: [K] non-negative weights with a positive sum.
        signatures: [n, K], or the index of them, which spares building it again for every query.
        ground: [K, K] distances of the motifs, a metric.
        k: how many; all where there are fewer.

    Raises:
        ValueError: k < 1, or what is no signature over those motifs.
    """
    index = signatures if isinstance(signatures, SignatureIndex) else SignatureIndex.build(signatures, ground)
    found = index.nearest(query, k)
    return found.indices, found.distances


def nearest_many(
    queries: FloatArray,
    index: SignatureIndex,
    k: int,
    query_groups: NDArray[np.generic] | None = None,
    groups: NDArray[np.generic] | None = None,
) -> list[Nearest]:
    """The k signatures nearest to each of `queries` [m, K]; see `SignatureIndex.nearest`.

    Args:
        queries: [m, K].
        index: what is searched.
        k: how many for each.
        query_groups: [m] a query gets no answers from its own group: the clip or take that it comes from.
        groups: [n] groups of the signatures of the index; given with `query_groups`.

    Raises:
        ValueError: as `SignatureIndex.nearest`, or groups of other lengths.
    """
    if query_groups is None or groups is None:
        return [index.nearest(query, k) for query in queries]
    if len(query_groups) != len(queries) or len(groups) != len(index):
        raise ValueError(
            f"groups of {len(query_groups)} queries and {len(groups)} signatures, for {len(queries)} and {len(index)}"
        )
    others = {group: np.flatnonzero(groups != group) for group in np.unique(query_groups)}
    return [index.nearest(query, k, others[group]) for query, group in zip(queries, query_groups, strict=True)]


@dataclass
class _Answers:
    """Solved transports of one query, and the k-th smallest distance among them."""

    index: SignatureIndex
    mass: Float64Array
    k: int
    found: dict[int, float] = field(default_factory=dict)
    largest: list[float] = field(default_factory=list)

    @property
    def threshold(self) -> float:
        """What is farther is no answer."""
        return -self.largest[0] if len(self.largest) == self.k else np.inf

    def solve(self, candidates: Int64Array, bounds: Float64Array, at_most: int | None = None) -> None:
        """Solve candidates in the order of their bounds until one exceeds the threshold."""
        for at in np.argsort(bounds, kind="stable")[:at_most].tolist():
            if bounds[at] > self.threshold:
                break
            candidate = int(candidates[at])
            if candidate in self.found:
                continue
            distance = transport(self.mass, self.index.mass(candidate), self.index.ground)
            self.found[candidate] = distance
            if len(self.largest) < self.k:
                heapq.heappush(self.largest, -distance)
            else:
                heapq.heappushpop(self.largest, -distance)

    def best(self) -> Nearest:
        indices = np.array(list(self.found), dtype=np.int64)
        distances = np.array(list(self.found.values()), dtype=np.float64)
        order = np.lexsort((indices, distances))[: self.k]
        return Nearest(indices[order], distances[order], len(indices))


def _split(bounds: Float64Array, count: int) -> tuple[Int64Array, Int64Array]:
    """Positions of the `count` smallest bounds, and all others."""
    if count >= len(bounds):
        return np.arange(len(bounds)), np.zeros(0, dtype=np.int64)
    order = np.argpartition(bounds, count)
    return order[:count], order[count:]
