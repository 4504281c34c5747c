"""Stage "postures": a dictionary, pretrained or trained on the lake, turns every frame at its rate into a symbol.

PESTA, sections 5.1 and 5.2.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.columns import numbers, read_parquet
from motionlake.lake import frames
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import Lake
from motionlake.lake.loaded import loaded
from motionlake.lake.models import file_hash
from motionlake.motion.features import word_features
from motionlake.stages.part_clips import clips_of_shard, of_clips
from motionlake.stages.posture_dictionary import POSTURE_DICTIONARY
from motionlake.stages.reader import LakeReader
from motionlake.stages.stage import PART_KEYS, Part, PartStage, Shard, clips_of, part_keys
from numpy.typing import NDArray

ROWS = pa.schema([*PART_KEYS, ("symbol", pa.int32())])


class Postures(PartStage):
    """Coded frames. The dictionary enters the catalog together with the strings over it, so that the two agree."""

    name = "postures"
    about = "train the posture dictionary if there is none, code every frame"
    model = POSTURE_DICTIONARY
    folder = "postures"
    schema = ROWS
    version = 2  # without calibration poses

    def spec(self, at: LakeReader, part: Part) -> Mapping[str, Any]:
        return {"dictionary": POSTURE_DICTIONARY.serving(at).file, "clips": clips_of(at.con, part.part)}

    def rows(self, lake: Lake, shard: Shard) -> Iterator[pa.Table]:
        from motionlake.pesta.dictionary import load_dictionary

        dictionary = loaded(load_dictionary, lake, shard.spec["dictionary"])
        for clip in clips_of_shard(lake, shard, rotations=dictionary.config.frames.reads_rotations):
            positions, rotations = clip.positions.astype(float), clip.rotations.astype(float)
            codes = dictionary.encode(word_features(positions, rotations, clip.fps, dictionary.config.frames))
            keys = part_keys(clip.clip, shard, len(codes))
            yield pa.Table.from_arrays([*keys, pa.array(codes, pa.int32())], schema=ROWS)


POSTURES: Final = Postures()


def codes_of_clips(con: Connection, lake: Lake, model: str, clips: Sequence[str]) -> dict[str, NDArray[np.int32]]:
    """[T] symbols of the postures of clips by a dictionary, parts read once; without clips that are being recoded."""
    dictionary = fetch(con, "model_file", {"model": model})[0]["file"]
    parts = {row["clip"]: row["part"] for row in fetch(con, "parts_of", {"clips": list(clips)})}
    files = POSTURES.files_of(lake, parts.values(), (loaded(file_hash, lake, dictionary),))
    return of_clips(lake, files, parts, _some_codes)


def _some_codes(path: Path, clips: Container[str]) -> dict[str, NDArray[np.int32]]:
    return {clip: codes for clip, codes in read_codes(path, threads=False) if clip in clips}


def read_codes(path: Path, *, threads: bool = True) -> Iterator[tuple[str, NDArray[np.int32]]]:
    """(clip, [T] symbols) of every clip of a part of coded postures, in order; `threads`: as `read_parquet`."""
    table = read_parquet(path, ["clip", "symbol"], threads=threads)
    symbols = numbers(table.column("symbol"))
    for clip, rows in frames.runs_of(table.column("clip")):
        yield clip, symbols[rows]
