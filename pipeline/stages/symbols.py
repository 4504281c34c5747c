"""Stage "symbols": coded postures become the reduced string of each clip, served together with the dictionary."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
from motionlake.lake import frames
from motionlake.lake.catalog import Connection, fetch, load_rows, run_sql
from motionlake.lake.config import LakeConfig
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model
from motionlake.lake.parts import write_part
from motionlake.pesta.config import SymbolsConfig
from motionlake.stages import postures
from motionlake.stages.derived import Part, clips_of, derive, due
from motionlake.stages.shard import Shard, ShardResult
from safetensors import safe_open

if TYPE_CHECKING:
    from motionlake.pesta.symbols import SymbolString

NAME = "symbols"
VERSION = 1
ROWS = pa.schema(
    [
        ("clip", pa.string()), ("symbols", pa.list_(pa.int32())), ("starts", pa.list_(pa.int64())),
        ("part", pa.string()),
    ]
)  # fmt: skip
POSTURE_ROWS = pa.schema(
    [("symbol", pa.int32()), ("code", pa.list_(pa.float32())), ("posture", pa.list_(pa.float32()))]
)


def keyed(con: Connection, lake: Lake, config: LakeConfig, dictionary: Model) -> list[Part]:
    """Every live part with the key its strings must have: all change with the dictionary's version."""
    return derive(postures.keyed(con, lake, dictionary), NAME, VERSION, config.symbols, dictionary.model)


def plan(con: Connection, lake: Lake, config: LakeConfig, dictionary: Model) -> list[Shard]:
    def spec(part: Part) -> dict[str, object]:
        return {
            "codes": postures.codes_file(part.upstream),
            "codes_fps": config.postures.fps,
            "clips": clips_of(con, part.part),
            "symbols": asdict(config.symbols),
            "dictionary": dictionary.file,
            "model": dictionary.model,
        }

    return due(con, NAME, postures.NAME, keyed(con, lake, config, dictionary), spec)


def rows_file(key: str) -> str:
    return f"staging/symbols-{key[:16]}.parquet"


def run(lake_root: Path, shard: Shard) -> ShardResult:
    """The string of every clip of one part of coded postures."""
    from motionlake.pesta.symbols import symbolise

    started = time.perf_counter()
    lake = Lake(lake_root)
    config, clips = SymbolsConfig(**shard.spec["symbols"]), shard.spec["clips"]
    lengths = frames.lengths(lake.path(lake.frames_part(shard.dataset, shard.part)))
    names, strings = [], []
    for clip, codes in postures.read_codes(lake.path(shard.spec["codes"])):
        if clip not in clips:
            continue  # left the lake since the part was coded
        fps, n_frames = lengths[clip]
        string = symbolise(codes, codes_fps=shard.spec["codes_fps"], fps=fps, n_frames=n_frames, config=config)
        names.append(clip)
        strings.append(string)
    table = _rows(names, strings, shard.part)
    size = write_part(lake.path(rows_file(shard.key)), table, {})
    return ShardResult(shard, sum(map(len, strings)), size, (), time.perf_counter() - started)


def _rows(names: list[str], strings: list[SymbolString], part: str) -> pa.Table:
    offsets = pa.array(np.cumsum([0, *map(len, strings)]).astype(np.int32))
    symbols = np.concatenate([s.symbols for s in strings]) if strings else np.zeros(0, dtype=np.int32)
    starts = np.concatenate([s.starts for s in strings]) if strings else np.zeros(0, dtype=np.int64)
    lists = [pa.ListArray.from_arrays(offsets, pa.array(values)) for values in (symbols, starts)]
    return pa.Table.from_arrays([pa.array(names, pa.string()), *lists, pa.repeat(part, len(names))], schema=ROWS)


def served_model(con: Connection) -> str | None:
    """The name of the dictionary whose strings the lake serves."""
    rows = fetch(con, "served_postures")
    return str(rows[0]["model"]) if rows else None


def load(con: Connection, root: Path, results: Sequence[ShardResult]) -> None:
    """Replace the strings of the parts in the results; a new dictionary replaces the old, with all of its strings.

    When the dictionary is new, `results` must hold every part of the lake: strings over two dictionaries do not
    compare.
    """
    spec = results[0].shard.spec
    new = served_model(con) != spec["model"]
    if new:
        run_sql(con, "clear_symbols")
    parts = [r.shard.part for r in results]
    staged = [str(root / rows_file(r.shard.key)) for r in results]
    run_sql(con, "load_symbols", {"parts": parts, "files": staged})
    if new:
        codes = [str(root / r.shard.spec["codes"]) for r in results]
        rows = _postures(root / spec["dictionary"])
        load_rows(con, "load_postures", rows, {"codes": codes, "model": spec["model"]})


def _postures(file: Path) -> pa.Table:
    with safe_open(file, framework="numpy") as tensors:
        codes, typical = tensors.get_tensor("codes"), tensors.get_tensor("postures")
    columns = [pa.array(np.arange(len(codes), dtype=np.int32)), pa.array(list(codes)), pa.array(list(typical))]
    return pa.Table.from_arrays(columns, schema=POSTURE_ROWS)
