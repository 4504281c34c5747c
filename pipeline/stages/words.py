"""Stage "words": frames become features at the words' rate, and the ranges of the motion words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.lake.catalog import Connection
from motionlake.lake.config import config_hash
from motionlake.lake.layout import Lake
from motionlake.lake.parts import write_part
from motionlake.motion.features import WordConfig, native_ranges, windows, word_features
from motionlake.stages.mapped_part import MappedStage, lists_of, read_rows, rows_of_clips
from motionlake.stages.part_clips import by_file, clips_of_shard
from motionlake.stages.reader import LakeReader
from motionlake.stages.stage import (
    STAGING,
    Part,
    Shard,
    clips_of,
    frames_parts,
)
from numpy.typing import NDArray

FEATURES: Final = "features"  # a column
WORD_ROWS = pa.schema(
    [("clip", pa.string()), ("word", pa.int32()), ("start", pa.int64()), ("stop", pa.int64()), ("part", pa.string())]
)


class Words(MappedStage):
    """Features of frames, and the ranges of words."""

    name = "words"
    about = "frames to the features and ranges of motion words"
    tables = ("words",)
    folder = "features"
    statement = "load_words"
    version = 3  # parts that are mapped into memory

    def shaping(self, at: LakeReader) -> Sequence[Any]:
        return (at.config.words,)

    def spec(self, at: LakeReader, part: Part) -> Mapping[str, Any]:
        return {"config": asdict(at.config.words), "clips": clips_of(at.con, part.part)}

    def rows(self, lake: Lake, shard: Shard) -> Iterator[pa.Table]:
        config = WordConfig(**shard.spec["config"])
        ranges: list[pa.Table] = []
        for clip in clips_of_shard(lake, shard, rotations=config.reads_rotations):
            features = word_features(clip.positions.astype(float), clip.rotations.astype(float), clip.fps, config)
            ranges.append(_ranges(clip.clip, shard.part, len(features), clip.fps, len(clip.positions), config))
            yield pa.table([pa.repeat(clip.clip, len(features)), lists_of(features)], names=["clip", FEATURES])
        if ranges:
            write_part(lake.path(self.entered(shard.key)), pa.concat_tables(ranges), {})

    def count(self, table: pa.Table, shard: Shard) -> int:
        return len(windows(table.num_rows, WordConfig(**shard.spec["config"])))

    def entered(self, key: str) -> str:
        return f"{STAGING}/{self.name}-{key[:16]}.parquet"


WORDS: Final = Words()


def features_files(con: Connection, config: WordConfig) -> dict[str, str]:
    """Of every live frames part the part of its features, relative to the lake, whether it is there yet or not."""
    keys = {p.part: config_hash(WORDS.name, WORDS.version, p.key, config) for p in frames_parts(con)}
    return {part: WORDS.file(key) for part, key in keys.items()}


def _ranges(clip: str, part: str, count: int, fps: float, n_frames: int, config: WordConfig) -> pa.Table:
    starts, stops = native_ranges(windows(count, config), fps, n_frames, config).T
    columns = [pa.repeat(clip, len(starts)), np.arange(len(starts)), starts, stops, pa.repeat(part, len(starts))]
    return pa.Table.from_arrays(
        [pa.array(c, t) for c, t in zip(columns, WORD_ROWS.types, strict=True)], schema=WORD_ROWS
    )


def read_features(path: Path) -> Iterator[tuple[str, NDArray[np.float32]]]:
    """(clip, [T, D]) of every clip of a features part, in order."""
    yield from read_rows(path, FEATURES)


def features_of(lake: Lake, files: Mapping[str, str], clips: Mapping[str, str]) -> dict[str, NDArray[np.float32]]:
    """[T, D] of some clips, given the features of each frames part, and the part of each clip.

    Raises:
        DamagedError: as `rows_of_clips`.
    """
    return rows_of_clips(lake, by_file(lake, files, clips), FEATURES)
