"""Stage "descriptors": a network, ready-made or trained on clips of the lake, turns every clip into one vector.

DeepHuMS, section 3.2. Descriptors of two networks do not compare, so a lake serves those of one.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array
from motionlake.deephums.config import DIMENSION, PRETRAINED_DESCRIPTORS
from motionlake.deephums.sequence import clip_sequence
from motionlake.lake import frames
from motionlake.lake.catalog import Connection, fetch, run_sql
from motionlake.lake.config import LakeConfig, config_hash
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model, copy_weights, file_hash, fitting_model, model_of
from motionlake.lake.parts import write_part
from motionlake.stages.derived import Part, clips_of, derive, due, frames_parts
from motionlake.stages.shard import Shard, ShardResult

NAME = "descriptors"
VERSION = 1
NETWORK = "descriptors"
AT_ONCE = 64  # clips in memory
ROWS = pa.schema([("clip", pa.string()), ("descriptor", pa.list_(pa.float32(), DIMENSION)), ("part", pa.string())])


def network_key(config: LakeConfig) -> str:
    """Covers all that shapes a network but the clips it is trained on: those it keeps once trained."""
    return config_hash(NETWORK, VERSION, config.descriptors)


def fitting_network(con: Connection, config: LakeConfig) -> Model | None:
    """The current network if it was made for this configuration."""
    return fitting_model(con, NETWORK, network_key(config))


def takes_ready_made(_con: Connection, config: LakeConfig) -> bool:
    """Whether the lake starts with the ready-made network, and does not train one."""
    return PRETRAINED_DESCRIPTORS.fits(config.descriptors)


def take_weights(lake: Lake, _config: LakeConfig, weights: Path, file: str) -> dict[str, Any]:
    """Copy a ready-made network into the lake as `file`; returns its figures."""
    from motionlake.deephums.trained import load_descriptor

    return copy_weights(lake, weights, file, load_descriptor(weights).figures, "clips", "classes", "supervision")


def keyed(con: Connection, lake: Lake, network: Model) -> list[Part]:
    """Every live part with the key its descriptors must have: all change with the network's version."""
    return derive(frames_parts(con), NAME, VERSION, network.model, file_hash(lake.path(network.file)))


def plan(con: Connection, lake: Lake, network: Model) -> list[Shard]:
    def spec(part: Part) -> dict[str, object]:
        return {"network": network.file, "model": network.model, "clips": clips_of(con, part.part)}

    return due(con, NAME, "frames", keyed(con, lake, network), spec)


def rows_file(key: str) -> str:
    return f"staging/descriptors-{key[:16]}.parquet"


def run(lake_root: Path, shard: Shard) -> ShardResult:
    """The descriptor of every clip of one frames part."""
    from motionlake.deephums.trained import load_descriptor

    started = time.perf_counter()
    lake = Lake(lake_root)
    network = load_descriptor(lake.path(shard.spec["network"]))
    file = lake.path(lake.frames_part(shard.dataset, shard.part))
    names: list[str] = []
    found = [np.zeros((0, DIMENSION), dtype=np.float32)]
    for clips, sequences in _batches(file, shard.spec["clips"]):
        names.extend(clips)
        found.append(network.embed(sequences))
    size = write_part(lake.path(rows_file(shard.key)), _rows(names, np.concatenate(found), shard.part), {})
    return ShardResult(shard, len(names), size, (), time.perf_counter() - started)


def _batches(file: Path, clips: Sequence[str]) -> Iterator[tuple[list[str], list[Float32Array]]]:
    names: list[str] = []
    sequences: list[Float32Array] = []
    for clip in frames.read_part(file, clips):
        names.append(clip.clip)
        sequences.append(sequence_of(clip))
        if len(names) == AT_ONCE:
            yield names, sequences
            names, sequences = [], []
    if names:
        yield names, sequences


def sequence_of(clip: frames.Frames) -> Float32Array:
    """[T, J, 3] a clip of the lake as the network reads it."""
    return clip_sequence(clip.positions.astype(float), clip.fps)


def _rows(names: list[str], vectors: Float32Array, part: str) -> pa.Table:
    lists = pa.FixedSizeListArray.from_arrays(pa.array(vectors.ravel()), DIMENSION)
    return pa.Table.from_arrays([pa.array(names, pa.string()), lists, pa.repeat(part, len(names))], schema=ROWS)


def served_network(con: Connection) -> Model | None:
    """The network whose descriptors the lake serves: those of another do not compare with them."""
    rows = fetch(con, "served_descriptors")
    return model_of(rows[0]) if rows else None


def load(con: Connection, root: Path, results: Sequence[ShardResult]) -> None:
    """Replace the descriptors of the parts in the results; a new network's replace all of the old one's."""
    parameters = {
        "model": results[0].shard.spec["model"],
        "parts": [r.shard.part for r in results],
        "files": [str(root / rows_file(r.shard.key)) for r in results],
    }
    run_sql(con, "load_descriptors", parameters)
