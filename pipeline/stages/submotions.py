"""Stage "submotions": a second network, ready-made or trained on clips of the lake, reads the windows of every clip.

DeepHuMS, section 3.3.5. What two networks make does not compare, so a lake serves that of one.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array
from motionlake.deephums.config import DIMENSION, PRETRAINED_SUBMOTION
from motionlake.deephums.sequence import clip_sequence
from motionlake.deephums.submotions import piece_windows
from motionlake.lake import frames
from motionlake.lake.catalog import Connection, fetch, run_sql
from motionlake.lake.config import LakeConfig, config_hash
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model, copy_weights, file_hash, fitting_model, model_of
from motionlake.lake.parts import write_part
from motionlake.stages.derived import Part, clips_of, derive, due, frames_parts
from motionlake.stages.shard import Shard, ShardResult

NAME = "submotions"
VERSION = 1
NETWORK = "submotion"
ROWS = pa.schema(
    [
        ("clip", pa.string()),
        ("start", pa.int64()),
        ("stop", pa.int64()),
        ("descriptor", pa.list_(pa.float32(), DIMENSION)),
        ("part", pa.string()),
    ]
)
Window = tuple[int, int]
Embed = Callable[[Sequence[Float32Array]], Float32Array]


def network_key(config: LakeConfig) -> str:
    """Covers all that shapes a network but the clips it is trained on: those it keeps once trained."""
    return config_hash(NETWORK, VERSION, config.submotion)


def fitting_network(con: Connection, config: LakeConfig) -> Model | None:
    """The current network if it was made for this configuration."""
    return fitting_model(con, NETWORK, network_key(config))


def takes_ready_made(_con: Connection, config: LakeConfig) -> bool:
    """Whether the lake starts with the ready-made network, and does not train one."""
    return PRETRAINED_SUBMOTION.fits(config.submotion)


def take_weights(lake: Lake, _config: LakeConfig, weights: Path, file: str) -> dict[str, Any]:
    """Copy a ready-made network into the lake as `file`; returns its figures."""
    from motionlake.deephums.submotions import load_submotion

    return copy_weights(lake, weights, file, load_submotion(weights).figures, "clips", "loss")


def keyed(con: Connection, lake: Lake, network: Model) -> list[Part]:
    """Every live part with the key its rows must have: all change with the network's version."""
    return derive(frames_parts(con), NAME, VERSION, network.model, file_hash(lake.path(network.file)))


def plan(con: Connection, lake: Lake, network: Model) -> list[Shard]:
    described = network.figures.get("descriptors")  # recipe "deephums": the network it was trained to agree with
    first = fetch(con, "model_file", {"model": described})[0]["file"] if described else None

    def spec(part: Part) -> dict[str, object]:
        clips = clips_of(con, part.part)
        return {"network": network.file, "model": network.model, "descriptors": first, "clips": clips}

    return due(con, NAME, "frames", keyed(con, lake, network), spec)


def rows_file(key: str) -> str:
    return f"staging/submotions-{key[:16]}.parquet"


def run(lake_root: Path, shard: Shard) -> ShardResult:
    """What the network makes of every window of every clip of one frames part."""
    started = time.perf_counter()
    lake = Lake(lake_root)
    embed, cut = _reader(lake, shard.spec)
    names: list[str] = []
    windows: list[Window] = []
    found = [np.zeros((0, DIMENSION), dtype=np.float32)]
    for clip in frames.read_part(lake.path(lake.frames_part(shard.dataset, shard.part)), shard.spec["clips"]):
        ranges = cut(len(clip.positions), clip.fps)
        names.extend([clip.clip] * len(ranges))
        windows.extend(ranges)
        positions = clip.positions.astype(float)
        found.append(embed([clip_sequence(positions[start:stop], clip.fps) for start, stop in ranges]))
    size = write_part(lake.path(rows_file(shard.key)), _rows(names, windows, np.concatenate(found), shard.part), {})
    return ShardResult(shard, len(names), size, (), time.perf_counter() - started)


def _reader(lake: Lake, spec: Mapping[str, Any]) -> tuple[Embed, Callable[[int, float], list[Window]]]:
    """What makes vectors of windows, and how clips are cut into them.

    Recipe "deephums" compares pieces with the descriptors that the first network gives to whole clips.
    """
    if spec["descriptors"] is None:
        from motionlake.deephums.submotions import load_submotion

        return load_submotion(lake.path(spec["network"])).embed, piece_windows
    from motionlake.deephums.trained import load_descriptor

    return load_descriptor(lake.path(spec["descriptors"])).embed, lambda n_frames, _fps: [(0, n_frames)]


def _rows(names: list[str], windows: list[Window], vectors: Float32Array, part: str) -> pa.Table:
    bounds = np.array(windows, dtype=np.int64).reshape(-1, 2)
    lists = pa.FixedSizeListArray.from_arrays(pa.array(vectors.ravel()), DIMENSION)
    columns = [pa.array(names, pa.string()), pa.array(bounds[:, 0]), pa.array(bounds[:, 1]), lists]
    return pa.Table.from_arrays([*columns, pa.repeat(part, len(names))], schema=ROWS)


def served_network(con: Connection) -> Model | None:
    """The network whose windows the lake serves: those of another do not compare with them."""
    rows = fetch(con, "served_submotions")
    return model_of(rows[0]) if rows else None


def load(con: Connection, root: Path, results: Sequence[ShardResult]) -> None:
    """Replace the rows of the parts in the results; a new network's replace all of the old one's."""
    parameters = {
        "model": results[0].shard.spec["model"],
        "parts": [r.shard.part for r in results],
        "files": [str(root / rows_file(r.shard.key)) for r in results],
    }
    run_sql(con, "load_submotions", parameters)
