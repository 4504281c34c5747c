"""Stage "map": where every clip lies on a map of all of them, as the browser application shows it.

All clips are placed together, by their descriptors, or by their signatures where there are none: a new clip moves the
others, so the whole map is one shard.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import pyarrow as pa
from motionlake.arrays import Float32Array
from motionlake.deep_motifs.clip_map import places
from motionlake.lake.catalog import Connection, run_sql
from motionlake.lake.config import config_hash, load_config
from motionlake.lake.layout import Lake
from motionlake.lake.parts import write_part
from motionlake.stages.descriptors import DESCRIPTORS
from motionlake.stages.graph import made_keys
from motionlake.stages.reader import LakeReader, lake_reader
from motionlake.stages.signatures import SIGNATURES
from motionlake.stages.stage import Shard, ShardResult, ShardStage, live_parts

FOLDER: Final = "map"
SOURCES: Final = (DESCRIPTORS, SIGNATURES)  # the first of which there is any
ROWS: Final = pa.schema([("clip", pa.string()), ("key", pa.string()), ("x", pa.float64()), ("y", pa.float64())])


def clip_vectors(con: Connection, stage: str) -> tuple[list[str], Float32Array]:
    """The n clips of which a stage has made vectors, by name, and these [n, D]."""
    from motionlake.lake.corpus import read_descriptors, read_signatures

    if stage == DESCRIPTORS.name:
        clips, vectors = read_descriptors(con)
    else:
        _, clips, vectors = read_signatures(con)
    return [clip.clip for clip in clips], vectors


class ClipMap(ShardStage):
    """One shard for the whole lake; that of the lake as it was before goes."""

    name = "map"
    about = "where every clip lies on a map of all, near those that move like it"
    upstream = tuple(stage.name for stage in SOURCES)
    folders = (FOLDER,)
    by_name = True
    reads_catalog = True

    def due(self, at: LakeReader) -> int:
        return len(self.plan(at))

    def plan(self, at: LakeReader) -> list[Shard]:
        """Nothing where there are no vectors of clips yet."""
        shard = at.once("every", self.name, lambda: self.whole(at))
        return [] if shard is None or shard.key in at.done(self.name) else [shard]

    def lacking(self, at: LakeReader) -> str | None:
        return "what `run all` makes" if self.whole(at) is None else None

    def again(self, at: LakeReader, key: str) -> Shard | None:
        shard = self.whole(at)
        return shard if shard is not None and shard.key == key else None

    def whole(self, at: LakeReader) -> Shard | None:
        """The map of the lake as it stands, made or not; None where there are no vectors of clips yet."""
        made = {stage.name: made_keys(at, stage) for stage in SOURCES}
        source = next((name for name, keys in made.items() if keys), None)
        if source is None:
            return None
        clips, digest = at.clips()
        key = config_hash(self.name, self.version, source, made[source], digest)
        # Named by its datasets: it serves on where a part of them leaves the lake.
        datasets = "+".join(sorted({part.dataset for part in live_parts(at)}))
        return Shard(self.name, key, datasets, datasets, {"source": source}, clips)

    def run(self, root: Path, shard: Shard, /) -> ShardResult:
        started = time.perf_counter()
        lake = Lake(root)
        with lake_reader(lake, load_config(lake.config_file)) as at:
            names, vectors = clip_vectors(at.con, shard.spec["source"])
        points = places(vectors, names)
        columns = [names, [shard.key] * len(names), points[:, 0], points[:, 1]]
        table = pa.Table.from_arrays([pa.array(c, t) for c, t in zip(columns, ROWS.types, strict=True)], schema=ROWS)
        file = f"{FOLDER}/{shard.key[:16]}.parquet"
        size = write_part(lake.path(file), table, {"key": shard.key})
        return ShardResult(shard, table.num_rows, size, (file,), time.perf_counter() - started)

    def load(self, con: Connection, root: Path, results: Sequence[ShardResult], /) -> None:
        run_sql(con, "forget_other_shards", {"stage": self.name, "keys": [r.shard.key for r in results]})


CLIP_MAP: Final = ClipMap()
