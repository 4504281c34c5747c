"""The neighbour graph of a lake as it was: which of its lists still hold when clips have come and gone.

The distance of two clips does not change while what the methods made of them stays. So the list of a clip that stays
needs to be compared with the new clips alone; and only where a clip of a full list has left, anew with all.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float64Array, Int64Array
from motionlake.columns import read_parquet
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.stages.graph_chosen import Chosen

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
        clips: that are what they were.
        held: those of them whose lists hold.
        radii: of a large lake, by clip, how far each method looked for those that it was compared with (`Chosen`).
    """

    lists: Mapping[tuple[str, str], tuple[list[str], Float64Array]]
    clips: frozenset[str]
    held: frozenset[str]
    radii: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

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
        radii: dict[str, dict[str, float]] = {}
        for table, then in tables:
            columns = (table[name].to_pylist() for name in ("clip", "method", "neighbours", "distances", "radius"))
            for clip, method, near, apart, radius in zip(*columns, strict=True):
                part = parts.get(clip, "")
                if part in then and then[part] == made.get(part):
                    lists[method, clip] = [names.get(node, "") for node in near], np.array(apart, dtype=np.float64)
                    radii.setdefault(clip, {})[method] = -1.0 if radius is None else radius
        clips = frozenset(clip for _, clip in lists)
        return Before(lists, clips, clips, radii)

    def still(self, method: str, clip: str, nodes: Mapping[str, int], full: int) -> Listed | None:
        """The list of a clip without those that are no longer what they were; None where it was full and they were."""
        names, distances = self.lists[method, clip]
        kept = [at for at, name in enumerate(names) if name in self.clips and name in nodes]
        if len(names) >= full and len(kept) < len(names):
            return None
        return np.array([nodes[names[at]] for at in kept], dtype=np.int64), distances[kept]

    def among(self, chosen: Mapping[str, Chosen], nodes: Mapping[str, int]) -> Before:
        """Of a large lake: a list holds where all clips that are chosen for its own now, but for new ones, were chosen
        before, and all that it names are chosen still. What it does not name is then no nearer than what it does.
        """
        stayed = np.array([clip in self.clips for clip in nodes], dtype=np.bool_)
        held = frozenset(
            clip for clip, now in chosen.items()
            if clip in self.held and now.within(self.radii[clip])[stayed[now.nodes]].all()
            and self._listed(clip, now.apart, nodes) <= set(now.nodes.tolist())
        )  # fmt: skip
        return replace(self, held=held)

    def _listed(self, clip: str, methods: Iterable[str], nodes: Mapping[str, int]) -> set[int]:
        """The nodes of its neighbours, as far as they are what they were."""
        names = (name for method in methods for name in self.lists[method, clip][0])
        return {nodes[name] for name in names if name in self.clips and name in nodes}


def _same_settings(lake: Lake, file: str, settings: str) -> tuple[pa.Table, Mapping[str, str]] | None:
    table = read_parquet(sound(lake, file))
    said: dict[str, Any] = json.loads((table.schema.metadata or {}).get(FOOTER.encode(), b"{}"))
    return (table, said["made"]) if said.get("settings") == settings else None


def merged(lists: Sequence[Listed], most: int) -> Listed:
    """Lists of one clip as one: the nearest of all, ties by node."""
    nodes = np.concatenate([nodes for nodes, _ in lists])
    distances = np.concatenate([distances for _, distances in lists])
    order = np.lexsort((nodes, distances))[:most]
    return nodes[order], distances[order]


NO_GRAPH: Final = Before({}, frozenset(), frozenset())
