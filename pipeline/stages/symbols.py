"""Stage "symbols": coded postures become the reduced string of each clip, served together with the dictionary."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pyarrow as pa
from motionlake.lake import frames
from motionlake.lake.catalog import Connection, fetch, load_rows, run_sql
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.pesta.config import DICTIONARY_KEY, SymbolsConfig
from motionlake.stages.posture_dictionary import POSTURE_DICTIONARY
from motionlake.stages.postures import POSTURES, read_codes
from motionlake.stages.reader import LakeReader
from motionlake.stages.stage import Part, PartStage, Shard, ShardResult, clips_of
from motionlake.weights import read_tensors

if TYPE_CHECKING:
    from motionlake.pesta.symbols import SymbolString

ROWS = pa.schema(
    [
        ("clip", pa.string()), ("symbols", pa.list_(pa.int32())), ("starts", pa.list_(pa.int64())),
        ("part", pa.string()),
    ]
)  # fmt: skip
POSTURE_ROWS = pa.schema(
    [("symbol", pa.int32()), ("code", pa.list_(pa.float32())), ("posture", pa.list_(pa.float32()))]
)


class Symbols(PartStage):
    """A string a clip."""

    name = "symbols"
    about = "coded frames to the symbol string of every clip"
    source = POSTURES
    tables = ("symbol_strings", "postures")
    schema = ROWS
    statement = "load_symbols"

    def shaping(self, at: LakeReader) -> Sequence[Any] | None:
        dictionary = POSTURE_DICTIONARY.fitting(at)
        return None if dictionary is None else (at.config.symbols, dictionary.model)

    def spec(self, at: LakeReader, part: Part) -> Mapping[str, Any]:
        dictionary = POSTURE_DICTIONARY.serving(at)
        return {
            "codes": POSTURES.file(part.upstream),
            "codes_fps": at.config.postures.fps,
            "clips": clips_of(at.con, part.part),
            "symbols": asdict(at.config.symbols),
            "dictionary": dictionary.file,
            "model": dictionary.model,
        }

    def at_once(self, at: LakeReader) -> bool:
        return True

    def rows(self, lake: Lake, shard: Shard) -> Iterator[pa.Table]:
        from motionlake.pesta.symbols import symbolise

        config, clips = SymbolsConfig(**shard.spec["symbols"]), shard.spec["clips"]
        lengths = frames.lengths(sound(lake, lake.frames_part(shard.dataset, shard.part)))
        names, strings = [], []
        for clip, codes in read_codes(sound(lake, shard.spec["codes"])):
            if clip not in clips:
                continue  # left the lake since the part was coded
            fps, n_frames = lengths[clip]
            string = symbolise(codes, codes_fps=shard.spec["codes_fps"], fps=fps, n_frames=n_frames, config=config)
            names.append(clip)
            strings.append(string)
        yield string_rows(names, strings, shard.part)

    def count(self, table: pa.Table, shard: Shard) -> int:
        return sum(map(len, table.column("symbols")))

    def load(self, con: Connection, root: Path, results: Sequence[ShardResult], /) -> None:
        """Replace the strings of the parts in the results; a new dictionary replaces the old, with all of its strings.

        When the dictionary is new, `results` must hold every part of the lake: strings over two dictionaries do not
        compare.
        """
        spec = results[0].shard.spec
        served = fetch(con, "served_postures")
        new = not served or served[0]["model"] != spec["model"]
        if new:
            run_sql(con, "clear_symbols")
        super().load(con, root, results)
        if new:
            found, _ = read_tensors(root / spec["dictionary"], DICTIONARY_KEY, "codes", "postures")
            codes, typical = list(found["codes"]), list(found["postures"])
            columns = [pa.array(np.arange(len(codes), dtype=np.int32)), pa.array(codes), pa.array(typical)]
            rows = pa.Table.from_arrays(columns, schema=POSTURE_ROWS)
            files = [str(root / r.shard.spec["codes"]) for r in results]
            load_rows(con, "load_postures", rows, {"codes": files, "model": spec["model"]})


SYMBOLS: Final = Symbols()


def string_rows(names: list[str], strings: list[SymbolString], part: str) -> pa.Table:
    offsets = pa.array(np.cumsum([0, *map(len, strings)]).astype(np.int32))
    symbols = np.concatenate([s.symbols for s in strings]) if strings else np.zeros(0, dtype=np.int32)
    starts = np.concatenate([s.starts for s in strings]) if strings else np.zeros(0, dtype=np.int64)
    lists = [pa.ListArray.from_arrays(offsets, pa.array(values)) for values in (symbols, starts)]
    return pa.Table.from_arrays([pa.array(names, pa.string()), *lists, pa.repeat(part, len(names))], schema=ROWS)
