"""Stage "graph": the clips nearest to every clip by each method, which the default search goes along.

All clips are compared with all: a shard lists the neighbours of some, and depends on every part of the lake.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float64Array, Int64Array
from motionlake.deephums.scans import scan_of
from motionlake.lake.catalog import Connection, fetch, run_sql
from motionlake.lake.config import config_hash, load_config
from motionlake.lake.corpus import read_descriptors, read_signatures
from motionlake.lake.layout import Lake
from motionlake.lake.parts import write_part
from motionlake.motion.moves import KIND
from motionlake.pesta.config import AlignmentConfig
from motionlake.stages.descriptors import DESCRIPTORS
from motionlake.stages.moves import MOVES, made_parts, tracks_in
from motionlake.stages.reader import LakeReader, lake_reader
from motionlake.stages.shortlist_files import MOST
from motionlake.stages.signatures import SIGNATURES
from motionlake.stages.stage import Part, PartStage, Shard, ShardResult, ShardStage, frames_parts
from motionlake.stages.symbols import SYMBOLS
from numpy.typing import ArrayLike

KEPT: Final = 32  # neighbours of a clip that are kept
CLIPS: Final = 2048  # of a shard, at least, but for the last of a dataset
SOURCES: Final[Mapping[str, PartStage]] = {
    "signature": SIGNATURES, "alignment": SYMBOLS, "moves": MOVES, "descriptor": DESCRIPTORS
}  # fmt: skip
ROWS: Final = pa.schema(
    [
        ("clip", pa.string()), ("key", pa.string()), ("method", pa.string()), ("node", pa.int32()),
        ("neighbours", pa.list_(pa.int32())), ("distances", pa.list_(pa.float32())),
    ]
)  # fmt: skip
Nearest = Callable[[str], tuple[Int64Array, Float64Array]]


class Graph(ShardStage):
    """Lists of neighbours; those of a new lake replace the old together."""

    name = "graph"
    version = 2
    about = "the clips nearest to each clip, along which search goes"
    upstream = tuple(stage.name for stage in SOURCES.values())
    folders = ("graph",)

    def at_once(self, at: LakeReader) -> bool:
        return True

    def due(self, at: LakeReader) -> int:
        return len(self.plan(at))

    def plan(self, at: LakeReader) -> list[Shard]:
        """Nothing where no method has what it compares, or the lake holds more than `MOST` clips: the work grows with
        their square.
        """
        every = at.once("every", self.name, lambda: self._every(at))
        return [shard for shard in every if shard.key not in at.done(self.name)]

    def again(self, at: LakeReader, key: str) -> Shard | None:
        return next((shard for shard in self._every(at) if shard.key == key), None)

    def _every(self, at: LakeReader) -> list[Shard]:
        live = frames_parts(at.con)
        made = {method: made_keys(at, stage) for method, stage in SOURCES.items()}
        methods = [method for method, keys in made.items() if keys]
        if not methods or not 1 < sum(part.clips for part in live) <= MOST:
            return []
        clips = [row["clip"] for row in fetch(at.con, "clips_with_parts")]
        of = config_hash(self.name, self.version, KIND, made, clips, at.config.alignment.spec)
        moves = [MOVES.file(part.key) for part in made_parts(at)]
        spec = {"methods": methods, "alignment": at.config.alignment.spec, "moves": moves}
        return [_shard(self.name, of, spec, group) for group in _groups(live)]

    def run(self, root: Path, shard: Shard, /) -> ShardResult:
        started = time.perf_counter()
        lake = Lake(root)
        with lake_reader(lake, load_config(lake.config_file)) as at:
            clips = fetch(at.con, "clips_with_parts")
            nodes = {row["clip"]: node for node, row in enumerate(clips)}
            own = [row["clip"] for row in clips if row["part"] in set(shard.spec["parts"])]
            tables = [
                _rows(shard, method, nodes, own, NEAREST[method](at, nodes, shard)) for method in shard.spec["methods"]
            ]
        table = pa.concat_tables(tables)
        file = f"{self.folders[0]}/{shard.key[:16]}.parquet"
        size = write_part(lake.path(file), table, {"key": shard.key})
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
    done = at.done(stage.name)
    return sorted(part.key for part in stage.parts(at) or [] if part.key in done)


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


def _rows(shard: Shard, method: str, nodes: Mapping[str, int], own: Sequence[str], nearest: Nearest) -> pa.Table:
    found = [(clip, *nearest(clip)) for clip in own]
    columns: list[Any] = [
        [clip for clip, _, _ in found],
        [shard.key] * len(found),
        [method] * len(found),
        [nodes[clip] for clip in own],
        [others for _, others, _ in found],
        [apart for _, _, apart in found],
    ]
    return pa.Table.from_arrays([pa.array(c, t) for c, t in zip(columns, ROWS.types, strict=True)], schema=ROWS)


_NONE: Final = (np.zeros(0, dtype=np.int64), np.zeros(0))


@dataclass(frozen=True)
class _Listed:
    """Clips that a method compares, and what it finds for one of them, itself among it or not."""

    clips: Sequence[str]
    nodes: Mapping[str, int]
    nearest: Callable[[int, int], tuple[ArrayLike, ArrayLike]]

    def of(self) -> Nearest:
        places = {clip: place for place, clip in enumerate(self.clips)}
        as_nodes = np.array([self.nodes[clip] for clip in self.clips], dtype=np.int64)

        def nearest(clip: str) -> tuple[Int64Array, Float64Array]:
            place = places.get(clip)
            if place is None:
                return _NONE
            near, distances = self.nearest(place, KEPT + 1)
            found, apart = np.array(near, dtype=np.int64), np.array(distances, dtype=np.float64)
            others = np.flatnonzero(found != place)[:KEPT]
            return as_nodes[found[others]], apart[others]

        return nearest


def _by_signature(at: LakeReader, nodes: Mapping[str, int], _: Shard) -> Nearest:
    from motionlake.deep_motifs.emd import ground_distances
    from motionlake.deep_motifs.emd_search import SignatureIndex

    motifs, clips, signatures = read_signatures(at.con)
    index = SignatureIndex.build(signatures, ground_distances(np.array([m["centroid"] for m in motifs], np.float32)))
    every = np.arange(len(clips))

    def nearest(place: int, k: int) -> tuple[ArrayLike, ArrayLike]:
        found = index.nearest(signatures[place], k, every)
        return found.indices, found.distances

    return _Listed([clip.clip for clip in clips], nodes, nearest).of()


def _by_alignment(at: LakeReader, nodes: Mapping[str, int], shard: Shard) -> Nearest:
    from motionlake.lake.strings import read_strings
    from motionlake.pesta.scan import nearest_strings

    strings, config = read_strings(at.con), AlignmentConfig(**shard.spec["alignment"])

    def nearest(place: int, k: int) -> tuple[ArrayLike, ArrayLike]:
        symbols = strings.repository.string(place)
        if len(symbols) < 2:  # a posture that is held is found anywhere
            return (), ()
        found = nearest_strings(symbols, strings.repository, strings.distances, k, config, without=place, threads=1)
        return [other for other, _ in found], [cost for _, cost in found]

    return _Listed([clip.clip for clip in strings.clips], nodes, nearest).of()


def _by_moves(at: LakeReader, nodes: Mapping[str, int], shard: Shard) -> Nearest:
    from motionlake.motion.moves_index import MovesIndex

    tracks = dict(pair for file in shard.spec["moves"] for pair in tracks_in(at.lake, file) if pair[0] in nodes)
    clips = sorted(tracks)
    moves = [tracks[clip].moves() for clip in clips]
    index = MovesIndex(moves)
    return _Listed(clips, nodes, lambda place, k: index.nearest(moves[place], k)).of()


def _by_descriptor(at: LakeReader, nodes: Mapping[str, int], _: Shard) -> Nearest:
    clips, descriptors = read_descriptors(at.con)
    scan = scan_of(descriptors)

    def nearest(place: int, k: int) -> tuple[ArrayLike, ArrayLike]:
        found = scan.nearest(descriptors[place], k)
        return found.indices[0], found.distances[0]

    return _Listed([clip.clip for clip in clips], nodes, nearest).of()


NEAREST: Final[Mapping[str, Callable[[LakeReader, Mapping[str, int], Shard], Nearest]]] = {
    "signature": _by_signature,
    "alignment": _by_alignment,
    "moves": _by_moves,
    "descriptor": _by_descriptor,
}
