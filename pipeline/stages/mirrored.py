"""Stage "mirrored": the signature that each clip would have if it were mirrored left to right.

Words of the mirrored features go through the network and the motifs that the lake serves, and are weighed
with the frozen idf, as the clip's own words are.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pyarrow as pa
from motionlake.deep_motifs.motifs import assign
from motionlake.deep_motifs.words.windows import word_windows
from motionlake.lake.catalog import Connection, run_sql
from motionlake.lake.config import LakeConfig
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model
from motionlake.lake.parts import write_part
from motionlake.motion.features import WordConfig
from motionlake.motion.mirror import mirrored_features
from motionlake.stages import motifs, signatures, words
from motionlake.stages.derived import Part, derive, due
from motionlake.stages.shard import Shard, ShardResult

NAME = "mirrored"
VERSION = 1
ROWS = pa.schema([("clip", pa.string()), ("part", pa.string()), ("motif", pa.int32())])


def keyed(signed: list[Part]) -> list[Part]:
    """Parts of the stage "signatures" with the key their mirrored signatures must have."""
    return derive(signed, NAME, VERSION)


def plan(con: Connection, lake: Lake, config: LakeConfig, network: Model, model: Model) -> list[Shard]:
    """A shard for every part whose signatures are served: mirrored ones must be of the same motifs."""
    features = {p.part: words.features_file(p.key) for p in words.keyed(con, config.words)}

    def spec(part: Part) -> dict[str, object]:
        return {
            "features": features[part.part],
            "network": network.file,
            "motifs": model.file,
            "words": asdict(config.words),
        }

    parts = keyed(signatures.keyed(motifs.keyed(con, lake, config, network, model), model))
    return due(con, NAME, signatures.NAME, parts, spec)


def rows_file(key: str) -> str:
    return f"staging/mirrored-{key[:16]}.parquet"


def run(lake_root: Path, shard: Shard) -> ShardResult:
    """The motif of every mirrored word of one features part."""
    from motionlake.deep_motifs.words.network import load_network

    started = time.perf_counter()
    lake = Lake(lake_root)
    config = WordConfig(**shard.spec["words"])
    network = load_network(lake.path(shard.spec["network"]))
    vocabulary = motifs.read_motifs(lake.path(shard.spec["motifs"]))
    rows = []
    for clip, features in words.read_features(lake.path(shard.spec["features"])):
        found = assign(network.embed(word_windows(mirrored_features(features, config), config)), vocabulary)
        rows.append(_rows(clip, shard, found))
    table = pa.concat_tables(rows)
    size = write_part(lake.path(rows_file(shard.key)), table, {})
    return ShardResult(shard, table.num_rows, size, (), time.perf_counter() - started)


def _rows(clip: str, shard: Shard, found: np.ndarray) -> pa.Table:
    keys = [pa.repeat(pa.scalar(value), len(found)) for value in (clip, shard.part)]
    return pa.Table.from_arrays([*keys, pa.array(found, pa.int32())], schema=ROWS)


def load(con: Connection, root: Path, results: Sequence[ShardResult]) -> None:
    """Replace the mirrored signatures of the parts in the results."""
    parameters = {
        "parts": [r.shard.part for r in results],
        "files": [str(root / rows_file(r.shard.key)) for r in results],
    }
    run_sql(con, "load_mirrored", parameters)
