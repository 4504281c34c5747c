"""Stage "embed": a word network, ready-made or trained on the lake, turns every motion word into a vector."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from motionlake.deep_motifs.words.windows import word_windows
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.config import LakeConfig, config_hash
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model, checkpoint_file, copy_weights, file_hash, fitting_model, save_model
from motionlake.lake.parts import PartWriter, check_part, replacing
from motionlake.motion.features import WordConfig
from motionlake.stages import words
from motionlake.stages.derived import PART_KEYS, Part, derive, due
from motionlake.stages.shard import Shard, ShardResult
from numpy.typing import NDArray

NAME = "embed"
VERSION = 1
NETWORK = "network"
ROWS = pa.schema([*PART_KEYS, ("word", pa.int32()), ("embedding", pa.list_(pa.float32()))])


def network_key(config: LakeConfig) -> str:
    """Covers all that shapes a network but the clips it is trained on: those it keeps once trained."""
    return config_hash(NETWORK, VERSION, config.words, config.network)


def fitting_network(con: Connection, config: LakeConfig) -> Model | None:
    """The current network if it was made for this configuration."""
    return fitting_model(con, NETWORK, network_key(config))


def training_sample(con: Connection, lake: Lake, config: LakeConfig) -> list[NDArray[np.float32]]:
    """Features of whole clips, drawn at random until they hold `max_words` words; in order of the clips."""
    rows = fetch(con, "recorded_words")
    order = np.random.default_rng(config.network.seed).permutation(len(rows))
    total, chosen = 0, set()
    for i in order.tolist():
        if total >= config.network.max_words:
            break
        total += rows[i]["words"]
        chosen.add(rows[i]["clip"])
    live = {p.part: p.key for p in words.keyed(con, config.words)}
    parts = sorted({r["part"] for r in rows if r["clip"] in chosen})
    found: dict[str, NDArray[np.float32]] = {}
    for part in parts:
        for clip, features in words.read_features(lake.path(words.features_file(live[part]))):
            if clip in chosen:
                found[clip] = features
    return [found[clip] for clip in sorted(found)]


def train(
    lake: Lake,
    features: Sequence[NDArray[np.float32]],
    config: LakeConfig,
    file: str,
    start: str | None = None,
    progress: Callable[[int, int, float], None] | None = None,
) -> dict[str, Any]:
    """Train the network of the configuration, save it as `file`; returns its figures.

    Args:
        features: [T, D] of each clip.
        start: a network of the lake to go on from.
        progress: told of (steps done, steps, loss).

    A training that was interrupted goes on from its checkpoint in the lake.
    """
    from motionlake.deep_motifs.words.network import load_network
    from motionlake.deep_motifs.words.training import train_words

    checkpoint = checkpoint_file(lake, "words")
    before = load_network(lake.path(start)) if start else None
    trained = train_words(
        list(features), config.words, config.network, start=before, checkpoint=checkpoint, progress=progress
    )
    save_model(lake, file, trained.save)
    return dict(trained.figures)


def take_weights(lake: Lake, config: LakeConfig, weights: Path, file: str) -> dict[str, Any]:
    """Copy ready-made weights into the lake as `file`; returns their figures.

    Raises:
        ValueError: they are of other words or of another architecture than the configuration's.
    """
    from motionlake.deep_motifs.words.network import load_network

    network = load_network(weights)
    if (network.words, network.architecture) != (config.words, config.network.architecture):
        raise ValueError(f"{weights} embeds other words than config.toml says")
    return copy_weights(lake, weights, file, network.figures, "words")


def keyed(con: Connection, lake: Lake, config: LakeConfig, network: Model) -> list[Part]:
    """Every live part with the key its embeddings must have."""
    weights = file_hash(lake.path(network.file))
    return derive(words.keyed(con, config.words), NAME, VERSION, weights)


def plan(con: Connection, lake: Lake, config: LakeConfig, network: Model) -> list[Shard]:
    def spec(part: Part) -> dict[str, object]:
        return {"features": words.features_file(part.upstream), "network": network.file, "words": asdict(config.words)}

    return due(con, NAME, words.NAME, keyed(con, lake, config, network), spec)


def embeddings_file(key: str) -> str:
    return f"embeddings/{key[:16]}.parquet"


def run(lake_root: Path, shard: Shard) -> ShardResult:
    """Embed every word of one features part."""
    from motionlake.deep_motifs.words.network import load_network

    started = time.perf_counter()
    lake = Lake(lake_root)
    config = WordConfig(**shard.spec["words"])
    network = load_network(lake.path(shard.spec["network"]))
    file = embeddings_file(shard.key)
    with replacing(lake.path(file)) as temporary:
        writer = PartWriter(temporary, ROWS, {"key": shard.key})
        for clip, features in words.read_features(lake.path(shard.spec["features"])):
            writer.append(_rows(clip, shard, network.embed(word_windows(features, config))))
        writer.close()
    size = check_part(lake.path(file), writer.rows)
    return ShardResult(shard, writer.rows, size, (file,), time.perf_counter() - started)


def _rows(clip: str, shard: Shard, vectors: NDArray[np.float32]) -> pa.Table:
    count, width = vectors.shape
    offsets = pa.array(np.arange(0, count * width + 1, width, dtype=np.int32))
    keys = [pa.repeat(pa.scalar(value), count) for value in (clip, shard.part, shard.key)]
    lists = pa.ListArray.from_arrays(offsets, pa.array(vectors.ravel()))
    return pa.Table.from_arrays([*keys, pa.array(np.arange(count, dtype=np.int32)), lists], schema=ROWS)


def read_embeddings(path: Path) -> tuple[pa.Table, NDArray[np.float32]]:
    """(clip, part, word) rows and [n, d] vectors of an embeddings part."""
    table = pq.read_table(path)
    vectors = table.column("embedding").combine_chunks().flatten().to_numpy()
    return table.select(["clip", "part", "word"]), vectors.reshape(table.num_rows, -1)


def load(_con: Connection, _root: Path, _results: Sequence[ShardResult]) -> None:
    """Embeddings are served from their parts: the manifest's row is all that is entered."""
