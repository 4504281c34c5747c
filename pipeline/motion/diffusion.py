"""How near clips are along the neighbour graph of a lake: a clip is near that is near to what is near (diffusion).

Donoser and Bischof, "Diffusion Processes for Retrieval Revisited" (CVPR 2013); Yang et al., "Efficient Diffusion on
Region Manifolds" (CVPR 2017), whose truncation to the nearest clips of the query is taken here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, Int64Array

RESTART: Final = 0.05  # share of what starts at the query in every step; the rest passes on to neighbours
JOINED: Final = 10  # neighbours that a clip is joined to, at most
FEWEST: Final = 4  # clips of a lake for each of them
_LEAST: Final = 1e-12  # of distances that others are divided by
NOWHERE: Final = -1  # in place of the node of a clip that the graph does not hold


def joined_of(clips: int, most: int = JOINED) -> int:
    """How many neighbours a clip is joined to in a lake of so many: in a small one of all kinds ten are most of it."""
    return max(1, min(most, clips // FEWEST))


@dataclass(frozen=True)
class NeighbourGraph:
    """The nearest other clips of each of n clips, more of them than are joined to it.

    Attributes:
        neighbours: [n, m] nodes, nearest first; `NOWHERE` where there are fewer.
        distances: [n, m] theirs; infinite where there are fewer.
        joined: neighbours that a clip is joined to.
    """

    neighbours: Int64Array
    distances: Float64Array
    joined: int = JOINED

    def scales(self, nodes: Int64Array) -> Float64Array:
        """[m] distance of each node from its tenth (`joined`) neighbour, or the last; 0 without neighbours."""
        if not len(self.distances):
            return np.zeros(len(nodes))
        near = self.distances[nodes][:, : self.joined]
        return np.asarray(np.where(np.isfinite(near), near, 0.0).max(axis=1, initial=0.0))


def scale(distances: Float64Array, joined: int = JOINED) -> float:
    """Of a query with sorted `distances` from clips: that of the tenth (`joined`), or the last; above 0."""
    return max(float(distances[:joined][-1]) if len(distances) else 1.0, _LEAST)


def diffused(graph: NeighbourGraph, nodes: Int64Array, distances: Float64Array, own: int = NOWHERE) -> Float64Array:
    """[m] how near clips are to a query along the graph, from 0 to 1.

    The weight of an edge is exp(-d^2 / (s t)), where s and t are the distances of its ends from their tenth neighbours.
    A clip is joined to the ten of its neighbours whose edges weigh most, and to those that are so joined to it. In
    every step what is at a clip passes on along its edges by their weights.

    Args:
        graph: of the lake.
        nodes: [m] the nearest clips to the query, nearest first, without the query itself; `NOWHERE` for those that
            the graph does not hold.
        distances: [m] of the query from them.
        own: node of the query, where it is a clip of the lake.
    """
    count = len(nodes)
    if not count:
        return np.zeros(0)
    everyone = np.append(nodes, own)
    scales = np.append(np.where(nodes >= 0, graph.scales(nodes), 0.0), scale(distances, graph.joined))
    scales = np.where(scales > 0, scales, scales[count])
    weights, outside, least = _joined(graph, everyone, scales)
    edges = _weight(distances, scales[count], scales[:count])
    joined = (edges >= _largest(edges[None], graph.joined)) | (edges >= least[:count])
    weights[count, :count] = weights[:count, count] = np.where(joined, edges, 0.0)
    degrees = weights.sum(axis=1) + outside
    root = 1 / np.sqrt(np.where(degrees > 0, degrees, 1.0))
    spread = np.linalg.inv(np.eye(count + 1) - (1 - RESTART) * weights * root[:, None] * root)
    lengths = np.sqrt(np.diag(spread))
    return np.asarray(spread[count, :count] / (lengths[count] * lengths[:count]))


def way_between(distances: Float64Array, most: int = JOINED) -> Float64Array:
    """[n, n] how near all of n clips are to one another along their graph, from 0 to 1: `diffused` of every clip.

    Args:
        distances: [n, n], symmetric, zero on the diagonal; two clips at least.
        most: neighbours that a clip is joined to, at most.
    """
    count = len(distances)
    joined = min(joined_of(count, most), count - 1)
    others = distances + np.diag(np.full(count, np.inf))
    scales = np.maximum(np.sort(others, axis=1)[:, joined - 1], _LEAST)
    edges = _weight(others, scales[:, None], scales)
    edges[edges < _largest(edges, joined)[:, None]] = 0.0
    weights = np.maximum(edges, edges.T)
    degrees = weights.sum(axis=1)
    root = 1 / np.sqrt(np.where(degrees > 0, degrees, 1.0))
    spread = np.linalg.inv(np.eye(count) - (1 - RESTART) * weights * root[:, None] * root)
    lengths = np.sqrt(np.diag(spread))
    return np.asarray((spread + spread.T) / 2 / (lengths[:, None] * lengths))


def _weight(distances: Float64Array, one: Float64Array | float, other: Float64Array) -> Float64Array:
    with np.errstate(over="ignore"):
        return np.asarray(np.exp(-(distances / one) * (distances / other)))


def _largest(edges: Float64Array, k: int) -> Float64Array:
    """[n] the k-th largest of each row of edges [n, m], or the smallest of fewer."""
    return np.asarray(np.sort(edges, axis=1)[:, -min(k, edges.shape[1])])


def _joined(
    graph: NeighbourGraph, nodes: Int64Array, scales: Float64Array
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """[m, m] weights of the edges between nodes; [m] what each has besides, of edges to other clips; [m] the least
    that an edge of its own weighs."""
    weights, outside, least = np.zeros((len(nodes), len(nodes))), np.zeros(len(nodes)), np.full(len(nodes), np.inf)
    inside = np.flatnonzero(nodes >= 0)
    if not len(inside) or not graph.neighbours.shape[1]:
        return weights, outside, least
    place = np.full(len(graph.neighbours) + 1, NOWHERE)
    place[nodes] = np.arange(len(nodes))
    place[NOWHERE] = NOWHERE  # the last, which stands for all that the graph does not hold
    others = graph.neighbours[nodes[inside]]
    theirs = np.maximum(graph.scales(others.ravel()).reshape(others.shape), _LEAST)
    apart = np.where(others >= 0, graph.distances[nodes[inside]], np.inf)
    edges = np.where(others >= 0, _weight(apart, scales[inside, None], theirs), 0.0)
    least[inside] = _largest(edges, graph.joined)
    edges[edges < least[inside, None]] = 0.0
    at = np.where(others >= 0, place[others], NOWHERE)
    rows, columns = np.nonzero(at >= 0)
    weights[inside[rows], at[rows, columns]] = edges[rows, columns]
    outside[inside] = np.where(at < 0, edges, 0.0).sum(axis=1)
    return np.maximum(weights, weights.T), outside, least
