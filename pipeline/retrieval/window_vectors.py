"""The windows of some clips against the vector of a piece: their parts are read side by side."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array
from motionlake.columns import numbers, read_parquet
from motionlake.deep_motifs.signatures import CorpusClip
from motionlake.deephums.config import DIMENSION
from motionlake.lake.catalog import Connection, fetch, rows_of
from motionlake.lake.integrity import sound_files
from motionlake.lake.layout import Lake

THREADS: Final = 2
_FACTS: Final = [each.name for each in fields(CorpusClip)]
COLUMNS: Final = ("clip", "start", "stop", "descriptor")


def holding_among(
    lake: Lake, con: Connection, files: Mapping[str, str], descriptor: Float32Array, k: int, without: Mapping[str, Any],
    clips: Collection[str],
) -> list[dict[str, Any]]:  # fmt: skip
    """The k of some clips that hold the windows nearest to a descriptor [512], as the macro `clips_holding` gives them.

    Args:
        lake, con: the lake, and its catalog.
        files: by frames part, the file of the vectors of its windows.
        descriptor: of a piece.
        k: clips.
        without: `clip`, `first`, `last`: windows of this clip that overlap these frames are no answer.
        clips: that may be answers.

    Raises:
        DamagedError: a file is not as it was written.
    """
    held: dict[str, set[str]] = {}
    for row in fetch(con, "some_clips_with_parts", {"clips": list(clips)}):
        if row["part"] in files:
            held.setdefault(files[row["part"]], set()).add(row["clip"])
    with ThreadPoolExecutor(THREADS) as pool:
        windows = list(pool.map(_windows, sound_files(lake, held), held.values()))
    if not windows:
        return []
    names = ("distance", *_FACTS)
    asked = {"descriptor": descriptor.tolist(), "k": k, **without}
    found = rows_of(con, "clips_holding_among", pa.concat_tables(windows), asked)
    return [dict(zip(names, row, strict=True)) for row in found]


def _windows(path: Path, clips: Collection[str]) -> pa.Table:
    """The windows of some clips of a part, with vectors in single precision."""
    table = read_parquet(path, COLUMNS, threads=False)
    names = table["clip"].to_pylist()
    rows = np.array([row for row, clip in enumerate(names) if clip in clips], dtype=np.int64)
    vectors = numbers(table["descriptor"].combine_chunks().flatten()).reshape(-1, DIMENSION)[rows]
    lists = pa.FixedSizeListArray.from_arrays(pa.array(vectors.astype(np.float32).ravel()), DIMENSION)
    bounds = [pa.array(numbers(table[name])[rows]) for name in ("start", "stop")]
    return pa.Table.from_arrays([pa.array([names[row] for row in rows.tolist()], pa.string()), *bounds, lists], COLUMNS)
