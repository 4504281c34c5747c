"""Stage "shortlist": what the default search reads instead of all signatures, strings and moves of a lake.

Of every clip it keeps a short vector by each method, by which the search chooses some hundred clips, and what these
are then compared by: signature, symbols and moves; in a large lake also the motifs of its words and its windows, among
which pieces are looked for. The files are laid out so that little of them is read. All clips are compared along the
same directions, so all are done together; but moves, windows, postures and joints are read of clips alone that came
since (`motionlake.stages.shortlist_before`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import reduce
from operator import or_
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array
from motionlake.columns import numbers
from motionlake.lake.catalog import Connection, fetch, fetch_table, run_sql
from motionlake.lake.config import config_hash, load_config
from motionlake.lake.layout import Lake
from motionlake.motion.moves import KIND
from motionlake.motion.sketches import Directions
from motionlake.stages.graph import SOURCES, made_keys
from motionlake.stages.reader import LakeReader, lake_reader
from motionlake.stages.shortlist_files import (
    CLIPS,
    CODES,
    FOLDER,
    MOST,
    SAMPLE,
    WHOLE,
    WIDTHS,
    Made,
    Places,
    file_of,
    no_sketches,
    string_sketch,
    write_clips,
    write_directions,
    write_lists,
    write_sketches,
)
from motionlake.stages.shortlist_moves import moves_of_clips, moves_of_parts, moves_to_read
from motionlake.stages.shortlist_rows import ROWS
from motionlake.stages.shortlist_windows import vectors_of_parts, windows_of_clips, windows_to_read
from motionlake.stages.stage import PartStage, Shard, ShardResult, ShardStage, live_parts
from motionlake.stages.submotions import SUBMOTIONS
from numpy.typing import NDArray

COMPARED: Final[Mapping[str, PartStage]] = {method: SOURCES[method] for method in WIDTHS}
KEPT: Final[Mapping[str, PartStage]] = {**COMPARED, "windows": SUBMOTIONS, **{rows.name: rows.stage for rows in ROWS}}
BLOCK: Final = 4096  # clips whose sketches are made at a time
WORDS: Final = 16_384  # clips the motifs of whose words are read at a time


class Shortlist(ShardStage):
    """One shard for the whole lake."""

    name = "shortlist"
    version = 14  # with sketches in whole numbers of two bytes
    about = "short vectors by which a search chooses the clips that it compares"
    reads_catalog = True
    upstream = tuple(dict.fromkeys(stage.name for stage in KEPT.values()))
    folders = (FOLDER,)

    def due(self, at: LakeReader) -> int:
        return int(self._lacking(at) is not None)

    def plan(self, at: LakeReader) -> list[Shard]:
        """Nothing where no method has what it compares, or the lake holds no more than `WHOLE` clips."""
        shard = self._lacking(at)
        return [] if shard is None else [self._after(at, shard)]

    def _lacking(self, at: LakeReader) -> Shard | None:
        shard = at.once("every", self.name, lambda: self.whole(at))
        return None if shard is None or shard.key in at.done(self.name) else shard

    def again(self, at: LakeReader, key: str) -> Shard | None:
        """None also for one that took frames of an earlier one over: it would not write these again."""
        shard = self.whole(at)
        rows = [row for row in fetch(at.con, "shards", {"stage": self.name}) if row["key"] == key]
        own = all(file.startswith(file_of(key, "")) for row in rows for file in row["files"])
        return shard if shard is not None and shard.key == key and own else None

    def whole(self, at: LakeReader) -> Shard | None:
        """The shard that the lake as it stands needs, done or not; None where it needs none."""
        live = live_parts(at)
        count = sum(part.clips for part in live)
        made = {method: made_keys(at, stage) for method, stage in (KEPT if count > MOST else COMPARED).items()}
        methods = [method for method, keys in made.items() if keys]
        if not methods or count <= WHOLE:
            return None
        clips, digest = at.clips()
        key = config_hash(self.name, self.version, KIND, made, digest)
        read: dict[str, Any] = {"moves": list(moves_of_parts(at).values())}
        if count > MOST:  # pieces of clips are looked for in it
            read |= {"windows": vectors_of_parts(at), **{rows.name: rows.of_parts(at) for rows in ROWS}}
        # Named by its datasets: it serves on where a part of them leaves the lake.
        datasets = "+".join(sorted({part.dataset for part in live}))
        return Shard(self.name, key, datasets, datasets, {"methods": methods, **read}, clips)

    def _after(self, at: LakeReader, shard: Shard) -> Shard:
        """The shard that takes over what it can of the shortlist that is there."""
        there = [row for row in fetch(at.con, "shards", {"stage": self.name}) if row["state"] == "ok"]
        if not there:
            return shard
        clips = fetch_table(at.con, "clips_with_parts")
        read = [TO_READ[method](at, there[0]["files"], clips) for method in shard.spec["methods"] if method in TO_READ]
        return replace(shard, spec=reduce(or_, read, dict(shard.spec)))

    def run(self, root: Path, shard: Shard, /) -> ShardResult:
        started = time.perf_counter()
        lake = Lake(root)
        with lake_reader(lake, load_config(lake.config_file)) as at:
            clips = fetch_table(at.con, "clips_with_parts").select(["clip", "part"])
            places = Places(clips["clip"].to_pylist())
            made = [MAKE[method](at, shard, clips, places) for method in shard.spec["methods"]]
            models = {row["method"]: row["model"] for row in fetch(at.con, "models_compared")}
        columns = {name: column for each in made for name, column in each.columns.items()}
        said = {name: text for each in made for name, text in each.said.items()}
        table = pa.table({"clip": clips["clip"], "part": clips["part"], **columns})
        table = table.replace_schema_metadata({**models, "moves": KIND, **said})
        files = [*(file for each in made for file in each.files), write_clips(lake, file_of(shard.key, CLIPS), table)]
        size = sum(lake.path(file).stat().st_size for file in files)
        sums = tuple(one for each in made for one in each.sums)
        return ShardResult(shard, table.num_rows, size, tuple(files), time.perf_counter() - started, sums)

    def load(self, con: Connection, root: Path, results: Sequence[ShardResult], /) -> None:
        """That of the lake as it was before goes."""
        run_sql(con, "forget_other_shards", {"stage": self.name, "keys": [r.shard.key for r in results]})


SHORTLIST: Final = Shortlist()


def _sketches(
    lake: Lake, shard: Shard, method: str, places: Places, clips: Sequence[str], rows: Iterator[Float32Array],
    directions: Directions,
) -> list[str]:  # fmt: skip
    """Write sketches of clips, given the vectors [b, D] of some after the other, and the directions."""
    kept = no_sketches(len(places), directions)
    first = 0
    for block in rows:
        at = places.of(clips[first : first + len(block)])
        kept[at] = directions.project(block)
        first += len(block)
    return [*write_directions(lake, shard.key, method, directions), *write_sketches(lake, shard.key, method, kept)]


def _by_signature(at: LakeReader, shard: Shard, _: pa.Table, places: Places) -> Made:
    from motionlake.deep_motifs.emd import ground_distances
    from motionlake.lake.corpus import read_signatures

    motifs, clips, signatures = read_signatures(at.con)
    ground = ground_distances(np.array([m["centroid"] for m in motifs], np.float32))
    names = [clip.clip for clip in clips]
    blocks = range(0, len(names), BLOCK)
    directions = Directions.of(signatures[:: max(1, len(names) // SAMPLE)] @ ground, WIDTHS["signature"])
    rows = (np.asarray(signatures[b : b + BLOCK] @ ground, dtype=np.float32) for b in blocks)
    files = _sketches(at.lake, shard, "signature", places, names, rows, directions)
    held, at_motif = np.nonzero(signatures)
    counts = np.zeros(len(places), dtype=np.int64)
    rows_of = places.of(names)
    counts[rows_of] = np.bincount(held, minlength=len(names))
    order = np.argsort(rows_of[held], kind="stable")
    lists: dict[str, NDArray[Any]] = {"motifs": at_motif[order], "weights": signatures[held, at_motif][order]}
    return Made({}, [*files, *write_lists(at.lake, shard.key, counts, lists), *_words(at, shard, places)])


def _words(at: LakeReader, shard: Shard, places: Places) -> list[str]:
    """Write the motifs of the words of each clip; those of some clips are read at a time."""
    con = at.con
    table = fetch_table(con, "words_of_clips")
    names, counts = table["clip"].to_pylist(), np.zeros(len(places), dtype=np.int64)
    counts[places.of(names)] = numbers(table["words"])
    motifs = [np.zeros(0, dtype=np.uint16)]
    for first in range(0, len(names), WORDS):
        block = names[first : first + WORDS]
        motifs.append(numbers(fetch_table(con, "motifs_of_words", {"first": block[0], "last": block[-1]})["motif"]))
    return write_lists(at.lake, shard.key, counts, {"words": np.concatenate(motifs)})


def _by_alignment(at: LakeReader, shard: Shard, _: pa.Table, places: Places) -> Made:
    from motionlake.motion.moves_of_clips import instants_of_clips

    table = fetch_table(at.con, "symbol_strings", {"clips": None}).combine_chunks()
    names, strings = table["clip"].to_pylist(), table["symbols"].chunk(0)
    symbols, frames = numbers(strings.flatten()), numbers(table["starts"].chunk(0).flatten())
    starts = np.asarray(numbers(strings.offsets), dtype=np.int64)
    starts -= starts[0]
    codes = np.array([row["code"] for row in fetch(at.con, "posture_codes")], dtype=np.float64)
    chosen = range(0, len(names), max(1, len(names) // SAMPLE))
    some = np.stack([string_sketch(symbols[starts[row] : starts[row + 1]], codes) for row in chosen])

    def blocks() -> Iterator[Float32Array]:
        for first in range(0, len(names), BLOCK):
            own = starts[first : first + BLOCK + 1]
            looked = instants_of_clips(codes[symbols[own[0] : own[-1]]], own - own[0], CODES)
            yield looked.reshape(len(looked), -1)

    directions = Directions.of(some, WIDTHS["alignment"])
    files = _sketches(at.lake, shard, "alignment", places, names, blocks(), directions)
    rows = places.of(names)
    counts = np.zeros(len(places), dtype=np.int64)
    counts[rows] = np.diff(starts)
    order = np.argsort(np.repeat(rows, np.diff(starts)), kind="stable")
    lists = {"symbols": symbols[order], "symbol_starts": frames[order].astype(np.int32)}
    return Made({}, [*files, *write_lists(at.lake, shard.key, counts, lists)])


MAKE: Final[Mapping[str, Callable[[LakeReader, Shard, pa.Table, Places], Made]]] = {
    "signature": _by_signature, "alignment": _by_alignment, "moves": moves_of_clips, "windows": windows_of_clips,
    **{rows.name: rows.of_clips for rows in ROWS},
}  # fmt: skip
TO_READ: Final = {"moves": moves_to_read, "windows": windows_to_read, **{rows.name: rows.to_read for rows in ROWS}}
