"""Stage "motifs": clusters of embedded words, fitted once and frozen; every word is assigned to one."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from motionlake.deep_motifs.motifs import Motifs, assign, fit_motifs
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection
from motionlake.lake.config import LakeConfig, config_hash
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model, file_hash, fitting_model
from motionlake.lake.parts import write_part
from motionlake.stages import embed
from motionlake.stages.derived import Part, derive, due
from motionlake.stages.shard import Shard, ShardResult
from numpy.typing import NDArray

NAME = "motifs"
VERSION = 1
MOTIFS = "motifs"
SAMPLE = 200_000
FILE_ROWS = pa.schema([("motif", pa.int32()), ("centroid", pa.list_(pa.float32())), ("strength", pa.float64())])


def motifs_key(config: LakeConfig, network: Model) -> str:
    """Covers the configuration and the network whose space the motifs live in."""
    return config_hash(MOTIFS, VERSION, config.motifs, network.model, network.key)


def fitting_motifs(con: Connection, config: LakeConfig, network: Model) -> Model | None:
    """The current motifs if they were made for this configuration and network."""
    return fitting_model(con, MOTIFS, motifs_key(config, network))


def fit(con: Connection, lake: Lake, config: LakeConfig, network: Model, file: str) -> dict[str, float]:
    """Cluster the embedded words of the lake (a random sample where there are many); write `file`.

    Raises:
        UserError: the lake holds fewer words than motifs are asked for.
    """
    parts = [p for p in embed.keyed(con, lake, config, network) if not p.synthetic]
    vectors = _sample([lake.path(embed.embeddings_file(p.key)) for p in parts], config.motifs.seed)
    if len(vectors) < config.motifs.k:
        raise UserError(
            f"{lake.root}: holds {len(vectors)} words, too few for {config.motifs.k} motifs; "
            f"take in more clips, or set k below [motifs] in {lake.config_file} to {len(vectors)} or less"
        )
    motifs = fit_motifs(vectors, config.motifs.k, config.motifs.seed)
    centroids = [row.tolist() for row in motifs.centroids]
    rows = pa.Table.from_arrays(
        [
            pa.array(np.arange(len(centroids), dtype=np.int32)),
            pa.array(centroids, FILE_ROWS.field("centroid").type),
            pa.array(motifs.strength, pa.float64()),
        ],
        schema=FILE_ROWS,
    )
    write_part(lake.path(file), rows, {})
    return {"k": float(len(centroids)), "words": float(len(vectors))}


def _sample(files: Sequence[Path], seed: int) -> NDArray[np.float32]:
    share = max(1, SAMPLE // max(1, len(files)))
    random = np.random.default_rng(seed)
    chosen = []
    for file in files:
        vectors = embed.read_embeddings(file)[1]
        if len(vectors) > share:
            vectors = vectors[np.sort(random.choice(len(vectors), share, replace=False))]
        chosen.append(vectors)
    return np.concatenate(chosen)


def read_motifs(path: Path) -> Motifs:
    """The motifs of a model file."""

    table = pq.read_table(path)
    centroids = np.array(table.column("centroid").to_pylist(), dtype=np.float32)
    return Motifs(centroids, table.column("strength").to_numpy())


def keyed(con: Connection, lake: Lake, config: LakeConfig, network: Model, motifs: Model) -> list[Part]:
    """Every live part with the key its assignment must have."""
    centroids = file_hash(lake.path(motifs.file))
    return derive(embed.keyed(con, lake, config, network), NAME, VERSION, centroids)


def plan(con: Connection, lake: Lake, config: LakeConfig, network: Model, motifs: Model) -> list[Shard]:
    def spec(part: Part) -> dict[str, object]:
        return {"embeddings": embed.embeddings_file(part.upstream), "motifs": motifs.file}

    return due(con, NAME, embed.NAME, keyed(con, lake, config, network, motifs), spec)


def assigned_file(key: str) -> str:
    return f"assigned/{key[:16]}.parquet"


def run(lake_root: Path, shard: Shard) -> ShardResult:
    """The nearest motif of every word of one embeddings part."""
    started = time.perf_counter()
    lake = Lake(lake_root)
    rows, vectors = embed.read_embeddings(lake.path(shard.spec["embeddings"]))
    motifs = assign(vectors, read_motifs(lake.path(shard.spec["motifs"])))
    file = assigned_file(shard.key)
    size = write_part(lake.path(file), rows.append_column("motif", pa.array(motifs, pa.int32())), {"key": shard.key})
    return ShardResult(shard, rows.num_rows, size, (file,), time.perf_counter() - started)


def load(_con: Connection, _root: Path, _results: Sequence[ShardResult]) -> None:
    """Motifs enter the catalog together with the signatures they make, so that the two always agree."""
