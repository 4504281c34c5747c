"""Stage "graph": the clips nearest to every clip by each method, which the default search goes along.

All clips are compared with all, in lakes of more than `ALL` clips with those that short vectors find near: a shard
lists the neighbours of some, and depends on every part of the lake. What the graph of the lake as it was still tells is
taken from it, so that a few new clips cost a few comparisons.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Int64Array
from motionlake.lake.catalog import Connection, fetch, run_sql
from motionlake.lake.config import config_hash, load_config
from motionlake.lake.layout import Lake
from motionlake.lake.parts import write_part
from motionlake.motion.moves import KIND
from motionlake.stages.descriptors import DESCRIPTORS
from motionlake.stages.graph_before import NO_GRAPH, Before, Listed, footer_of, merged
from motionlake.stages.graph_chosen import Chosen, Vectors, chosen_of
from motionlake.stages.graph_methods import COMPARE, Compared
from motionlake.stages.moves import MOVES
from motionlake.stages.reader import LakeReader, lake_reader
from motionlake.stages.shortlist_files import MOST
from motionlake.stages.signatures import SIGNATURES
from motionlake.stages.stage import Part, PartStage, Shard, ShardResult, ShardStage, live_parts
from motionlake.stages.symbols import SYMBOLS

KEPT: Final = 32  # neighbours of a clip that are kept
CLIPS: Final = 2048  # of a shard, at least, but for the last of a dataset
ALL: Final = 1000  # clips of a lake up to which each is compared with every other
STAYED: Final = 0.5  # share of the clips that must be as they were for their lists to be looked at
SOURCES: Final[Mapping[str, PartStage]] = {
    "signature": SIGNATURES, "alignment": SYMBOLS, "moves": MOVES, "descriptor": DESCRIPTORS
}  # fmt: skip
ROWS: Final = pa.schema(
    [
        ("clip", pa.string()), ("key", pa.string()), ("method", pa.string()), ("node", pa.int32()),
        ("neighbours", pa.list_(pa.int32())), ("distances", pa.list_(pa.float64())), ("radius", pa.float64()),
    ]
)  # fmt: skip


class Graph(ShardStage):
    """Lists of neighbours; those of a new lake replace the old together."""

    name = "graph"
    version = 4  # large lakes: those that are near by short vectors
    about = "the clips nearest to each clip, along which search goes"
    reads_catalog = True
    upstream = tuple(stage.name for stage in SOURCES.values())
    folders = ("graph",)

    def at_once(self, at: LakeReader) -> bool:
        return True

    def due(self, at: LakeReader) -> int:
        return len(self.plan(at))

    def plan(self, at: LakeReader) -> list[Shard]:
        """Nothing where no method has what it compares, or the lake holds more than `MOST` clips."""
        every = at.once("every", self.name, lambda: self.every(at))
        return [shard for shard in every if shard.key not in at.done(self.name)]

    def again(self, at: LakeReader, key: str) -> Shard | None:
        """What was made before is at fault where it is made again: nothing is taken from it."""
        return next((shard for shard in self.every(at, before=False) if shard.key == key), None)

    def every(self, at: LakeReader, *, before: bool = True) -> list[Shard]:
        """All shards that the lake as it stands needs, done or not; `before`: they take from those of before."""
        live = live_parts(at)
        made = {method: made_keys(at, stage) for method, stage in SOURCES.items()}
        methods = [method for method, keys in made.items() if keys]
        if not methods or not 1 < sum(part.clips for part in live) <= MOST:
            return []
        clips, digest = at.clips()
        alignment = at.config.alignment.spec
        spec = {
            "methods": methods,
            "alignment": alignment,
            "moves": [MOVES.file(part.key) for part in MOVES.made(at)],
            "settings": config_hash(self.name, self.version, KIND, methods, alignment, clips > ALL),
            "made": made_of(at, live),
            "before": _files_of(at, self.name) if before else [],
        }
        of = config_hash(self.name, self.version, KIND, made, digest, alignment)
        return [_shard(self.name, of, spec, group) for group in _groups(live)]

    def run(self, root: Path, shard: Shard, /) -> ShardResult:
        started = time.perf_counter()
        lake = Lake(root)
        with lake_reader(lake, load_config(lake.config_file)) as at:
            parts = {row["clip"]: row["part"] for row in fetch(at.con, "clips_with_parts")}
            nodes = {clip: node for node, clip in enumerate(parts)}
            here = set(shard.spec["parts"])
            own = [clip for clip, part in parts.items() if part in here]
            said = shard.spec["settings"], shard.spec["made"]
            before = Before.read(lake, shard.spec["before"], *said, parts)
            if len(before.clips) < STAYED * len(nodes):
                before = NO_GRAPH
            compared = {method: COMPARE[method](at, shard) for method in shard.spec["methods"]}
            chosen = None if len(nodes) <= ALL else _chosen(compared, nodes, own)
            if chosen is not None:
                before = before.among(chosen, nodes)
            tables = [
                _rows(shard, method, nodes, own, lists_of(each, method, nodes, own, before, chosen), chosen)
                for method, each in compared.items()
            ]
        table = pa.concat_tables(tables)
        file = f"{self.folders[0]}/{shard.key[:16]}.parquet"
        size = write_part(lake.path(file), table, {"key": shard.key, **footer_of(*said)})
        return ShardResult(shard, table.num_rows, size, (file,), time.perf_counter() - started)

    def load(self, con: Connection, root: Path, results: Sequence[ShardResult], /) -> None:
        """Only the lists stay that go with these: all of one lake are made together."""
        run_sql(con, "forget_other_shards", {"stage": self.name, "keys": [r.shard.key for r in results]})


GRAPH: Final = Graph()


def _shard(stage: str, of: str, spec: Mapping[str, Any], group: Sequence[Part]) -> Shard:
    parts = [part.part for part in group]
    clips = sum(part.clips for part in group)
    return Shard(stage, config_hash(of, parts), "+".join(parts), group[0].dataset, {**spec, "parts": parts}, clips)


def made_keys(at: LakeReader, stage: PartStage) -> list[str]:
    """Keys of what a stage has made of the lake as it stands."""
    return sorted(part.key for part in stage.made(at))


def _groups(parts: Sequence[Part]) -> Iterator[list[Part]]:
    """Parts of one dataset, `CLIPS` clips together."""
    group: list[Part] = []
    for part in sorted(parts, key=lambda part: (part.dataset, part.part)):
        if group and (group[0].dataset != part.dataset or sum(each.clips for each in group) >= CLIPS):
            yield group
            group = []
        group.append(part)
    if group:
        yield group


def _files_of(at: LakeReader, stage: str) -> list[str]:
    """What a stage has made of the lake as it was."""
    return [file for row in fetch(at.con, "shards", {"stage": stage}) if row["state"] == "ok" for file in row["files"]]


def made_of(at: LakeReader, live: Sequence[Part]) -> dict[str, str]:
    """By frames part, what each method compares of its clips."""
    keys: dict[str, list[tuple[str, str]]] = {part.part: [] for part in live}
    for method, stage in SOURCES.items():
        done = at.done(stage.name)
        for part in stage.parts(at) or []:
            if part.key in done and part.part in keys:
                keys[part.part].append((method, part.key))
    return {part: config_hash(made) for part, made in keys.items()}


def lists_of(
    compared: Compared,
    method: str,
    nodes: Mapping[str, int],
    own: Sequence[str],
    before: Before,
    chosen: Mapping[str, Chosen] | None = None,
) -> list[Listed]:
    """The nearest of every clip of `own`, as far as the method compares it; `chosen`: among those chosen for it."""
    places = {clip: place for place, clip in enumerate(compared.clips)}
    as_nodes = np.array([nodes[clip] for clip in compared.clips], dtype=np.int64)
    every = np.arange(len(as_nodes))
    new_here = np.array([clip not in before.clips for clip in compared.clips], dtype=np.bool_)
    came = np.flatnonzero(new_here)
    with_all = with_new = None
    found: list[Listed] = []
    for clip in own:
        place = places.get(clip)
        if place is None:
            found.append(_NONE)
            continue
        known = before.still(method, clip, nodes, KEPT) if clip in before.held else None
        if chosen is not None:
            rows = _places_of(as_nodes, chosen[clip].nodes)
            near, apart = compared.nearest_of(place, rows if known is None else rows[new_here[rows]], KEPT)
        elif known is None:
            with_all = with_all or compared.nearest(every)
            near, apart = with_all(place, KEPT)
        else:
            with_new = with_new or compared.nearest(came)
            near, apart = with_new(place, KEPT)
        new = as_nodes[near], apart
        found.append(new if known is None else merged([known, new], KEPT))
    return found


def _places_of(every: Int64Array, some: Int64Array) -> Int64Array:
    """Where some nodes stand among all, those that do; both ascending."""
    at = np.searchsorted(every, some)
    found: Int64Array = at[np.append(every, -1)[at] == some]
    return found


def _chosen(compared: Mapping[str, Compared], nodes: Mapping[str, int], own: Sequence[str]) -> dict[str, Chosen]:
    vectors = {
        method: Vectors(np.array([nodes[clip] for clip in each.clips], dtype=np.int64), each.vectors())
        for method, each in compared.items()
    }
    return dict(zip(own, chosen_of(vectors, [nodes[clip] for clip in own]), strict=True))


_NONE: Final[Listed] = (np.zeros(0, dtype=np.int64), np.zeros(0))


def _rows(
    shard: Shard,
    method: str,
    nodes: Mapping[str, int],
    own: Sequence[str],
    lists: Sequence[Listed],
    chosen: Mapping[str, Chosen] | None,
) -> pa.Table:
    columns: list[Any] = [
        own,
        [shard.key] * len(own),
        [method] * len(own),
        [nodes[clip] for clip in own],
        [others for others, _ in lists],
        [apart for _, apart in lists],
        [None if chosen is None else chosen[clip].radii[method] for clip in own],
    ]
    return pa.Table.from_arrays([pa.array(c, t) for c, t in zip(columns, ROWS.types, strict=True)], schema=ROWS)
