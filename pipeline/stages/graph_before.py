"""The neighbour graph of a lake as it was: which of its lists still hold when clips have come and gone.

The distance of two clips does not change while what the methods made of them stays. So the list of a clip that stays
needs to be compared with the new clips alone; and only where a clip of a full list has left, anew with all.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from motionlake.arrays import Float64Array, Int64Array
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake

FOOTER: Final = "made_of"
Listed = tuple[Int64Array, Float64Array]  # nodes, nearest first, and their distances


def footer_of(settings: str, made: Mapping[str, str]) -> dict[str, str]:
    """What a part of the graph says of itself: the settings of all methods, and what each part's clips were made of."""
    return {FOOTER: json.dumps({"settings": settings, "made": made}, sort_keys=True)}


@dataclass(frozen=True)
class Before:
    """Lists that still hold, but for clips that came since and, where they are named, clips that left.

    Attributes:
        lists: by method and clip: names of the neighbours, nearest first, and their distances.
        clips: whose lists these are.
    """

    lists: Mapping[tuple[str, str], tuple[list[str], Float64Array]]
    clips: frozenset[str]

    @staticmethod
    def read(
        lake: Lake, files: Iterable[str], settings: str, made: Mapping[str, str], parts: Mapping[str, str]
    ) -> Before:
        """What parts of the graph, as they were made before, tell of clips that are what they were.

        Args:
            lake: the lake.
            files: those parts.
            settings: of the methods today.
            made: what the clips of each frames part are made of today.
            parts: the frames part of every clip today.
        """
        tables = [table for file in files if (table := _same_settings(lake, file, settings)) is not None]
        names: dict[int, str] = {}
        for table, _ in tables:
            names |= zip(table["node"].to_pylist(), table["clip"].to_pylist(), strict=True)
        lists: dict[tuple[str, str], tuple[list[str], Float64Array]] = {}
        for table, then in tables:
            columns = (table[name].to_pylist() for name in ("clip", "method", "neighbours", "distances"))
            for clip, method, near, apart in zip(*columns, strict=True):
                part = parts.get(clip, "")
                if part in then and then[part] == made.get(part):
                    lists[method, clip] = [names.get(node, "") for node in near], np.array(apart, dtype=np.float64)
        return Before(lists, frozenset(clip for _, clip in lists))

    def still(self, method: str, clip: str, nodes: Mapping[str, int], full: int) -> Listed | None:
        """The list of a clip without those that are no longer what they were; None where it was full and they were."""
        names, distances = self.lists[method, clip]
        kept = [at for at, name in enumerate(names) if name in self.clips and name in nodes]
        if len(names) >= full and len(kept) < len(names):
            return None
        return np.array([nodes[names[at]] for at in kept], dtype=np.int64), distances[kept]


def _same_settings(lake: Lake, file: str, settings: str) -> tuple[pa.Table, Mapping[str, str]] | None:
    table = pq.read_table(sound(lake, file))
    said: dict[str, Any] = json.loads((table.schema.metadata or {}).get(FOOTER.encode(), b"{}"))
    return (table, said["made"]) if said.get("settings") == settings else None


def merged(lists: Sequence[Listed], most: int) -> Listed:
    """Lists of one clip as one: the nearest of all, ties by node."""
    nodes = np.concatenate([nodes for nodes, _ in lists])
    distances = np.concatenate([distances for _, distances in lists])
    order = np.lexsort((nodes, distances))[:most]
    return nodes[order], distances[order]


NO_GRAPH: Final = Before({}, frozenset())
