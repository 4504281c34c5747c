"""Stage "words": frames become features at the words' rate, and the ranges of the motion words."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from motionlake.deep_motifs.words.windows import native_range, windows
from motionlake.lake import frames
from motionlake.lake.catalog import Connection, run_sql
from motionlake.lake.layout import Lake
from motionlake.lake.parts import PartWriter, check_part, replacing, write_part
from motionlake.motion.features import WordConfig, word_features
from motionlake.stages.derived import PART_KEYS, Part, clips_of, derive, due, frames_parts
from motionlake.stages.shard import Shard, ShardResult
from numpy.typing import NDArray

NAME = "words"
VERSION = 1
WORD_ROWS = pa.schema(
    [("clip", pa.string()), ("word", pa.int32()), ("start", pa.int64()), ("stop", pa.int64()), ("part", pa.string())]
)


def keyed(con: Connection, config: WordConfig) -> list[Part]:
    """Every live part with the key its words must have."""
    return derive(frames_parts(con), NAME, VERSION, config)


def plan(con: Connection, config: WordConfig) -> list[Shard]:
    def spec(part: Part) -> dict[str, Any]:
        return {"config": asdict(config), "clips": clips_of(con, part.part)}

    return due(con, NAME, "frames", keyed(con, config), spec)


def features_file(key: str) -> str:
    return f"features/{key[:16]}.parquet"


def rows_file(key: str) -> str:
    return f"staging/words-{key[:16]}.parquet"


def run(lake_root: Path, shard: Shard) -> ShardResult:
    """Features and word ranges of every clip of one frames part."""
    started = time.perf_counter()
    lake = Lake(lake_root)
    config = WordConfig(**shard.spec["config"])
    file, staged = features_file(shard.key), rows_file(shard.key)
    ranges: list[pa.Table] = []
    source = lake.path(lake.frames_part(shard.dataset, shard.part))
    with replacing(lake.path(file)) as temporary:
        writer: PartWriter | None = None
        for clip in frames.read_part(source, shard.spec["clips"]):
            features = word_features(clip.positions.astype(float), clip.rotations.astype(float), clip.fps, config)
            ranges.append(_ranges(clip.clip, shard.part, len(features), clip.fps, len(clip.positions), config))
            table = features_table(clip.clip, shard, features)
            writer = writer or PartWriter(temporary, table.schema, {"key": shard.key})
            writer.append(table)
        if writer is None:
            raise ValueError(f"part {shard.part} holds no clip of the lake")
        writer.close()
    words = pa.concat_tables(ranges)
    write_part(lake.path(staged), words, {})
    size = check_part(lake.path(file), writer.rows)
    return ShardResult(shard, words.num_rows, size, (file,), time.perf_counter() - started)


def _ranges(clip: str, part: str, count: int, fps: float, n_frames: int, config: WordConfig) -> pa.Table:
    ranges = [native_range(int(s), fps, n_frames, config) for s in windows(count, config)]
    starts, stops = zip(*ranges, strict=True)
    columns = [pa.repeat(clip, len(ranges)), np.arange(len(ranges)), starts, stops, pa.repeat(part, len(ranges))]
    return pa.Table.from_arrays(
        [pa.array(c, t) for c, t in zip(columns, WORD_ROWS.types, strict=True)], schema=WORD_ROWS
    )


def features_table(clip: str, shard: Shard, features: NDArray[np.float32]) -> pa.Table:
    count, width = features.shape
    keys = [pa.repeat(pa.scalar(value), count) for value in (clip, shard.part, shard.key)]
    names = [*(name for name, _ in PART_KEYS), *(f"f{i}" for i in range(width))]
    return pa.Table.from_arrays([*keys, *frames.columns_of(features)], names=names)


def read_features(path: Path) -> Iterator[tuple[str, NDArray[np.float32]]]:
    """(clip, [T, D]) of every clip of a features part, in order."""
    table = pq.read_table(path)
    columns = [n for n in table.column_names if n not in {name for name, _ in PART_KEYS}]
    matrix = np.column_stack([table.column(n).to_numpy() for n in columns])
    start = 0
    for clip, stop in frames.runs_of(table.column("clip")):
        yield clip, matrix[start:stop]
        start = stop


def load(con: Connection, root: Path, results: Sequence[ShardResult]) -> None:
    """Replace the words of the parts in the results."""
    parameters: dict[str, Any] = {
        "parts": [r.shard.part for r in results],
        "files": [str(root / rows_file(r.shard.key)) for r in results],
    }
    run_sql(con, "load_words", parameters)
