"""How near clips are along the neighbour graph of a lake: a clip is near that is near to what is near (diffusion).

Two clips are joined where each is among the nearest of the other (Qin et al., CVPR 2011), so that a clip of a small
class is not joined to those of others for want of nearer ones.

Donoser and Bischof, "Diffusion Processes for Retrieval Revisited" (CVPR 2013); Yang et al., "Efficient Diffusion on
Region Manifolds" (CVPR 2017), whose truncation to the nearest clips of the query is taken here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array, Int64Array

RESTART: Final = 0.05  # share of what starts at the query in every step; the rest passes on to neighbours
RECIPROCAL: Final = 24  # two clips are joined where each is among so many nearest of the other
AGAIN: Final = 12  # the same of `diffused_again`, by how near clips are along the ways before
UNIT: Final = 10  # the distance of the tenth neighbour is the scale of a clip
SHARPNESS: Final = 2.0  # of the weight of an edge by its distance
JOINED: Final = 10  # nearest that a clip is joined to in `way_between`, at most
FEWEST: Final = 4  # clips of a lake for each neighbour of a clip
_LEAST: Final = 1e-12  # of distances that others are divided by
_ROUNDING: Final = 1e-6  # of a distance: what lists in single precision change
NOWHERE: Final = -1  # in place of the node of a clip that the graph does not hold


def joined_of(clips: int, most: int = JOINED) -> int:
    """How many neighbours count in a lake of so many clips: in a small one of all kinds ten are most of it."""
    return max(1, min(most, clips // FEWEST))


@dataclass(frozen=True)
class NeighbourGraph:
    """The nearest other clips of each of n clips.

    Attributes:
        neighbours: [n, m] nodes, nearest first; `NOWHERE` where there are fewer.
        distances: [n, m] theirs; infinite where there are fewer.
        clips: that the lake holds, by which fewer neighbours count in a small one.
    """

    neighbours: Int64Array
    distances: Float64Array
    clips: int

    def scales(self, nodes: Int64Array) -> Float64Array:
        """[k] distance of each of k nodes from its tenth neighbour (`UNIT`), or the last; 0 without neighbours."""
        return self._of_neighbour(nodes, joined_of(self.clips, UNIT))

    def radii(self, nodes: Int64Array) -> Float64Array:
        """[k] the same of the last neighbour that it may be joined to (`RECIPROCAL`)."""
        return self._of_neighbour(nodes, joined_of(self.clips, RECIPROCAL))

    def mutual(self) -> float:
        """The share of the nearest neighbours of all clips (`UNIT`) of which the clip is such a neighbour itself.

        Where distances tell clips apart, neighbours are mutual; where they do not, some clips are near to all others
        (hubs: Radovanović et al., JMLR 2010). 1 without neighbours.
        """
        near = self.neighbours[:, : joined_of(self.clips, UNIT)]
        clips, places = np.nonzero(near >= 0)
        others, count = near[clips, places], len(near)
        return float(np.isin(others * count + clips, clips * count + others).mean()) if len(clips) else 1.0

    def _of_neighbour(self, nodes: Int64Array, k: int) -> Float64Array:
        if not len(self.distances):
            return np.zeros(len(nodes))
        near = self.distances[nodes][:, :k]
        return np.asarray(np.where(np.isfinite(near), near, 0.0).max(axis=1, initial=0.0))


def scale(distances: Float64Array, k: int = UNIT) -> float:
    """Of a query with sorted `distances` from clips: that of the tenth (k), or the last; above 0."""
    return max(float(distances[:k][-1]) if len(distances) else 1.0, _LEAST)


def diffused(graph: NeighbourGraph, nodes: Int64Array, distances: Float64Array, own: int = NOWHERE) -> Float64Array:
    """[m + 1, m + 1] how near m clips and a query, the last, are to one another along the graph, from 0 to 1.

    The weight of an edge is exp(-2 d^2 / (s t)), where s and t are the distances of its ends from their tenth
    neighbours. In every step what is at a clip passes on along its edges by their weights.

    Args:
        graph: of the lake.
        nodes: [m] the nearest clips to the query, nearest first, without the query itself; `NOWHERE` for those that
            the graph does not hold.
        distances: [m] of the query from them.
        own: node of the query, where it is a clip of the lake.
    """
    count = len(nodes)
    everyone = np.append(nodes, own)
    scales = _with_query(nodes, graph.scales(nodes), scale(distances, joined_of(graph.clips, UNIT)))
    radii = _with_query(nodes, graph.radii(nodes), scale(distances, joined_of(graph.clips, RECIPROCAL)))
    weights, outside = _joined(graph, everyone, scales, radii)
    edges = _weight(distances, scales[count], scales[:count], SHARPNESS)
    weights[count, :count] = weights[:count, count] = np.where(
        _within(distances, radii[count]) & _within(distances, radii[:count]), edges, 0.0
    )
    return _spread(weights, outside)


def diffused_again(near: Float64Array, clips: int) -> Float64Array:
    """[m + 1, m + 1] how near m clips and a query are to one another along the graph of what is near along other ways.

    Args:
        near: [m + 1, m + 1] of the clips and of the query, the last; from 0 to 1.
        clips: that the lake holds.
    """
    apart = 1 - (near + near.T) / 2
    np.fill_diagonal(apart, np.inf)
    last = max(0, len(apart) - 2)
    places = [min(joined_of(clips, k) - 1, last) for k in (UNIT, AGAIN)]
    scales, radii = np.partition(apart, sorted(set(places)), axis=1)[:, places].T
    scales = np.maximum(scales, _LEAST)
    mutual = _within(apart, radii[:, None]) & _within(apart, radii)
    return _spread(np.where(mutual, _weight(apart, scales[:, None], scales), 0.0))


def way_between(distances: Float64Array, most: int = JOINED) -> Float64Array:
    """[n, n] how near all of n clips are to one another along the graph in which each is joined to its nearest.

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
    spread = _spread(weights)
    return (spread + spread.T) / 2


def _weight(
    distances: Float64Array, one: Float64Array | float, other: Float64Array, sharpness: float = 1.0
) -> Float64Array:
    with np.errstate(over="ignore"):
        return np.asarray(np.exp(-sharpness * (distances / one) * (distances / other)))


def _within(distances: Float64Array, radius: Float64Array | float) -> BoolArray:
    return np.asarray(distances <= np.asarray(radius) * (1 + _ROUNDING))


def _with_query(nodes: Int64Array, found: Float64Array, of_query: float) -> Float64Array:
    """[m + 1] what was found for nodes [m]; the query's for itself and for those of which nothing is known."""
    known = np.where(nodes >= 0, found, 0.0)
    return np.append(np.where(known > 0, known, of_query), of_query)


def _spread(weights: Float64Array, outside: Float64Array | float = 0.0) -> Float64Array:
    """[n, n] diffusion along edges of weights [n, n], each end having `outside` [n] besides; 1 on the diagonal."""
    degrees = weights.sum(axis=1) + outside
    root = 1 / np.sqrt(np.where(degrees > 0, degrees, 1.0))
    spread = np.linalg.inv(np.eye(len(weights)) - (1 - RESTART) * weights * root[:, None] * root)
    lengths = np.sqrt(np.diag(spread))
    return np.asarray(spread / (lengths[:, None] * lengths))


def _largest(edges: Float64Array, k: int) -> Float64Array:
    """[n] the k-th largest of each row of edges [n, m], or the smallest of fewer."""
    return np.asarray(np.sort(edges, axis=1)[:, -min(k, edges.shape[1])])


def _joined(
    graph: NeighbourGraph, nodes: Int64Array, scales: Float64Array, radii: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """[m, m] weights of the edges between nodes with their scales and radii [m]; [m] what each has besides, of edges to
    other clips."""
    weights, outside = np.zeros((len(nodes), len(nodes))), np.zeros(len(nodes))
    inside = np.flatnonzero(nodes >= 0)
    if not len(inside) or not graph.neighbours.shape[1]:
        return weights, outside
    place = np.full(len(graph.neighbours) + 1, NOWHERE)
    place[nodes] = np.arange(len(nodes))
    place[NOWHERE] = NOWHERE  # the last, which stands for all that the graph does not hold
    others = graph.neighbours[nodes[inside]]
    theirs = np.maximum(graph.scales(others.ravel()).reshape(others.shape), _LEAST)
    reach = np.minimum(graph.radii(others.ravel()).reshape(others.shape), radii[inside, None])
    apart = np.where(others >= 0, graph.distances[nodes[inside]], np.inf)
    mutual = (others >= 0) & _within(apart, reach)
    edges = np.where(mutual, _weight(apart, scales[inside, None], theirs, SHARPNESS), 0.0)
    at = np.where(others >= 0, place[others], NOWHERE)
    rows, columns = np.nonzero(at >= 0)
    weights[inside[rows], at[rows, columns]] = edges[rows, columns]
    outside[inside] = np.where(at < 0, edges, 0.0).sum(axis=1)
    return np.maximum(weights, weights.T), outside
