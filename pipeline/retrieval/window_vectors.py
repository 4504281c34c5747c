"""The windows of some clips against the vector of a piece: their parts are read side by side."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array
from motionlake.columns import column_of, numbers, read_parquet
from motionlake.deephums.config import DIMENSION
from motionlake.lake.catalog import Connection, rows_of
from motionlake.lake.frames import runs_of
from motionlake.lake.integrity import sound_files
from motionlake.lake.layout import Lake
from motionlake.retrieval.known_clips import KnownClips
from motionlake.threads import in_threads

THREADS: Final = 2
COLUMNS: Final = ("clip", "start", "stop", "descriptor")


def holding_among(
    lake: Lake, con: Connection, known: KnownClips, files: Mapping[str, str], descriptor: Float32Array, k: int,
    without: Mapping[str, Any], parts: Mapping[str, str],
) -> list[dict[str, Any]]:  # fmt: skip
    """The k of some clips that hold the windows nearest to a descriptor [512], as the macro `clips_holding` gives them.

    Args:
        lake, con: the lake, and its catalog.
        known: what the catalog says of its clips.
        files: by frames part, the file of the vectors of its windows.
        descriptor: of a piece.
        k: clips.
        without: `clip`, `first`, `last`: windows of this clip that overlap these frames are no answer.
        parts: by name the part of each clip that may be an answer.

    Raises:
        DamagedError: a file is not as it was written.
    """
    held: dict[str, set[str]] = {}
    for clip, part in parts.items():
        if part in files:
            held.setdefault(files[part], set()).add(clip)
    asked = list(zip(sound_files(lake, held), held.values(), strict=True))
    windows = in_threads(lambda one: _windows(*one), asked, THREADS)
    return nearest_among(con, known, pa.concat_tables(windows), descriptor, k, without) if windows else []


def nearest_among(
    con: Connection, known: KnownClips, windows: pa.Table, descriptor: Float32Array, k: int, without: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """The same of some windows: `clip`, `start`, `stop` and `descriptor` in single precision."""
    asked = {"descriptor": descriptor.tolist(), "k": k, **without}
    found = {clip: distance for distance, clip in rows_of(con, "clips_holding_among", windows, asked)}
    return [{"distance": found[facts.clip], **asdict(facts)} for facts in known.facts_of(known.entries(found))]


def _windows(path: Path, clips: Collection[str]) -> pa.Table:
    """The windows of some clips of a part, with vectors in single precision."""
    table = read_parquet(path, COLUMNS, threads=False)
    wanted = [table.slice(run.start, run.stop - run.start) for clip, run in runs_of(table["clip"]) if clip in clips]
    some = pa.concat_tables([table.slice(0, 0), *wanted]).combine_chunks()
    vectors = numbers(some["descriptor"].combine_chunks().flatten()).astype(np.float32)
    lists = pa.FixedSizeListArray.from_arrays(column_of(vectors), DIMENSION)
    return some.set_column(len(COLUMNS) - 1, COLUMNS[-1], lists)
