"""The neighbour graph of a lake, as the stage "graph" made it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from motionlake.arrays import Int64Array
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
    rows = pa.concat_tables([pq.read_table(sound(lake, file)) for file in files])
    nodes = dict(zip(rows["clip"].to_pylist(), rows["node"].to_pylist(), strict=True))
    # Clips whose own lists could not be made may still be neighbours of others.
    named = pc.max(pc.list_flatten(rows["neighbours"])).as_py() or 0
    count = 1 + max(pc.max(rows["node"]).as_py(), named)
    methods = rows["method"].unique().to_pylist()
    return LakeNeighbours(nodes, {name: _graph(rows.filter(pc.field("method") == name), count) for name in methods})


def _graph(rows: pa.Table, count: int) -> NeighbourGraph:
    lengths = pc.list_value_length(rows["neighbours"]).to_numpy()
    neighbours = np.full((count, max(lengths.max(initial=0), 1)), NOWHERE)
    distances = np.full(neighbours.shape, np.inf)
    at = np.repeat(rows["node"].to_numpy(), lengths), np.concatenate([np.arange(length) for length in lengths])
    neighbours[at] = pc.list_flatten(rows["neighbours"]).to_numpy()
    distances[at] = pc.list_flatten(rows["distances"]).to_numpy()
    return NeighbourGraph(neighbours, distances, int((lengths > 0).sum()))
