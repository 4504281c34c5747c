"""Exact nearest signatures by the Earth Mover's Distance, solving few of the transports.

A cheap bound orders the signatures, the distances of a few give a threshold, a tight bound is computed where
the cheap one is below it, and what remains is solved in ascending order of its bound until the next bound
exceeds the k-th smallest distance. Answers are those of solving them all, to the last bit.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, FloatArray, Int32Array, Int64Array, IntArray
from motionlake.deep_motifs.emd import Signature, transport, unit_mass, unit_masses, work
from motionlake.kernels import few

# The threshold comes from the k tightest among so many times k signatures that the cheap bound puts first.
PROBES: Final = 8
ROWS: Final = 4096
TRANSPORT: Final = 3600  # cells of alignments that take as long as a transport (`motionlake.kernels.few`)
FLOAT32_SLACK: Final = 1e-6


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
        motifs, masses: [nnz] motifs where a signature has mass, and their mass, 1 in all for a signature.
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
        lengths, motifs = [np.zeros(1, np.int64)], [np.zeros(0, np.int32)]
        masses, projected = [np.zeros(0)], [np.zeros((0, len(ground)), np.float32)]
        for start in range(0, len(signatures), ROWS):
            rows = unit_masses(signatures[start : start + ROWS], ground)
            at = np.nonzero(rows)
            lengths.append(np.count_nonzero(rows, axis=1))
            motifs.append(at[1].astype(np.int32))
            masses.append(rows[at])
            projected.append((rows @ ground).astype(np.float32))
        offsets = np.cumsum(np.concatenate(lengths))
        neighbours = np.argsort(ground, axis=1, kind="stable").astype(np.int32)
        sparse = offsets, np.concatenate(motifs), np.concatenate(masses)
        return cls(ground, *sparse, np.concatenate(projected), neighbours, model)

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def mass(self, i: int) -> Float64Array:
        """[K] signature i at mass 1."""
        dense = np.zeros(len(self.ground))
        span = slice(self.offsets[i], self.offsets[i + 1])
        dense[self.motifs[span]] = self.masses[span]
        return dense

    def _plain(self, mass: Float64Array, i: int) -> float:
        """Distance of a query of mass 1 [K] from signature i."""
        return transport(mass, self.mass(i), self.ground)

    def _quick(self, mass: Float64Array, i: int) -> float:
        """The same to the last bit, by a kernel."""
        from motionlake.deep_motifs.emd_bounds import exchanged

        span = slice(self.offsets[i], self.offsets[i + 1])
        given, taken, costs = exchanged(mass, self.motifs[span], self.masses[span], self.ground)
        return work(given, taken, costs) if len(given) and len(taken) else 0.0

    def nearest(self, query: Signature, k: int, among: IntArray | None = None) -> Nearest:
        """The k signatures nearest to a query by `emd`; all where there are fewer.

        Args:
            query: [K] non-negative weights with a positive sum.
            k: how many.
            among: [m] indices of the signatures to choose from, each once; all by default.

        Raises:
            ValueError: k < 1, or a query that is no signature over the motifs of the index.
        """
        if k < 1:
            raise ValueError(f"k = {k}: ask for at least 1 nearest signature")
        p = unit_mass(query, self.ground)
        chosen = np.arange(len(self)) if among is None else np.asarray(among, dtype=np.int64)
        without = few(TRANSPORT * len(chosen))
        answers = _Answers(p, k, self._plain if without else self._quick)
        if without:
            answers.solve(chosen, self._slackened(np.abs(self._means(p) - self.projected[chosen]).max(1, initial=0)))
        elif len(chosen):
            cheap = self.cheap_bounds(p, chosen)
            first = min(PROBES * k, len(chosen))
            order = np.argpartition(cheap, first - 1)
            probes, rest = order[:first], order[first:]
            answers.solve(chosen[probes], self.tight_bounds(p, chosen[probes]), at_most=k)
            rest = np.concatenate([probes, rest[cheap[rest] <= answers.threshold]])
            answers.solve(chosen[rest], self.tight_bounds(p, chosen[rest], answers.threshold))
        return answers.best()

    def cheap_bounds(self, mass: Float64Array, candidates: Int64Array) -> Float64Array:
        """[c] lower bounds by means of distances: of a query of mass 1 [K] from signatures of the index."""
        from motionlake.deep_motifs.emd_bounds import largest_differences

        return self._slackened(largest_differences(self._means(mass), self.projected, candidates))

    def _means(self, mass: Float64Array) -> Float32Array:
        """[K] float32 means of the distance of a signature [K] from each motif."""
        return (mass @ self.ground).astype(np.float32)

    def _slackened(self, largest: FloatArray) -> Float64Array:
        slack = FLOAT32_SLACK * self.ground.max(initial=0.0)
        bounds: Float64Array = np.maximum(largest.astype(np.float64) - slack, 0)
        return bounds

    def tight_bounds(self, mass: Float64Array, candidates: Int64Array, enough: float = np.inf) -> Float64Array:
        """[c] lower bounds by transfers within capacity: of a query of mass 1 [K] from signatures of the index.

        Once a bound exceeds `enough`, it is not raised any further.
        """
        from motionlake.deep_motifs.emd_bounds import transfer_bounds

        parts = (self.offsets, self.motifs, self.masses, self.ground, self.neighbours)
        return np.asarray(transfer_bounds(mass, *parts, candidates, enough), dtype=np.float64)


@dataclass
class _Answers:
    """Solved transports of one query, and the k-th smallest distance among them."""

    mass: Float64Array
    k: int
    distance: Callable[[Float64Array, int], float]
    found: dict[int, float] = field(default_factory=dict)
    ranked: list[float] = field(default_factory=list)

    @property
    def threshold(self) -> float:
        """What is farther is no answer."""
        return self.ranked[self.k - 1] if len(self.ranked) >= self.k else np.inf

    def solve(self, candidates: Int64Array, bounds: Float64Array, at_most: int | None = None) -> None:
        """Solve candidates in the order of their bounds until one exceeds the threshold."""
        for at in np.argsort(bounds, kind="stable")[:at_most].tolist():
            if bounds[at] > self.threshold:
                break
            candidate = int(candidates[at])
            if candidate not in self.found:
                self.found[candidate] = self.distance(self.mass, candidate)
                insort(self.ranked, self.found[candidate])

    def best(self) -> Nearest:
        indices = np.array(list(self.found), dtype=np.int64)
        distances = np.array(list(self.found.values()), dtype=np.float64)
        order = np.lexsort((indices, distances))[: self.k]
        return Nearest(indices[order], distances[order], len(indices))
