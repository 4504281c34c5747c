"""The neighbour graph of a lake, as the stage "graph" made it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from motionlake.arrays import Float64Array, Int64Array
from motionlake.columns import numbers, read_parquet
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.motion.diffusion import NOWHERE, NeighbourGraph


@dataclass(frozen=True)
class LakeNeighbours:
    """The neighbours of clips by each method, and the node that stands for each clip."""

    nodes: Mapping[str, int]
    methods: Mapping[str, NeighbourGraph]

    @cached_property
    def mutual(self) -> dict[str, float]:
        """How many neighbours are mutual, by method (`NeighbourGraph.mutual`)."""
        return {name: graph.mutual() for name, graph in self.methods.items()}

    def of(self, clips: list[str]) -> Int64Array:
        """[m] nodes of clips; `NOWHERE` for those that are not in the graph."""
        return np.array([self.nodes.get(clip, NOWHERE) for clip in clips], dtype=np.int64)


def read_neighbours(lake: Lake) -> LakeNeighbours:
    """The graph of a lake; empty where the stage has not made it.

    Raises:
        DamagedError: a part is not as it was written.
    """
    with reading(lake) as con:
        files = [row["file"] for row in fetch(con, "graph_files")]
    if not files:
        return LakeNeighbours({}, {})
    rows = pa.concat_tables([read_parquet(sound(lake, file)) for file in files])
    nodes = dict(zip(rows["clip"].to_pylist(), rows["node"].to_pylist(), strict=True))
    own, lengths = numbers(rows["node"]), numbers(pc.list_value_length(rows["neighbours"]))
    neighbours, distances = (numbers(pc.list_flatten(rows[name])) for name in ("neighbours", "distances"))
    # Clips whose own lists could not be made may still be neighbours of others.
    count = 1 + max(int(own.max()), int(neighbours.max(initial=0)))
    method_of = np.array(rows["method"].to_pylist())  # not `filter` of Arrow, whose values import pandas
    methods = {}
    for name in dict.fromkeys(method_of.tolist()):
        chosen = method_of == name
        listed = np.repeat(chosen, lengths)
        methods[name] = _graph(own[chosen], lengths[chosen], neighbours[listed], distances[listed], count)
    return LakeNeighbours(nodes, methods)


def _graph(
    nodes: Int64Array, lengths: Int64Array, neighbours: Int64Array, distances: Float64Array, count: int
) -> NeighbourGraph:
    """Of `count` nodes, from the lists of some one after another."""
    graph = np.full((count, max(lengths.max(initial=0), 1)), NOWHERE)
    far = np.full(graph.shape, np.inf)
    at = np.repeat(nodes, lengths), np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    graph[at], far[at] = neighbours, distances
    return NeighbourGraph(graph, far, int((lengths > 0).sum()))
