"""Stage "shortlist": what the default search of a large lake reads instead of all signatures, strings and moves.

Of every clip it keeps a short vector by each method, by which the search chooses some hundred clips, and what these
are then compared by: signature, symbols and moves. The files are laid out so that little of them is read. All clips
are compared along the same directions, so all are done together.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array, Int64Array
from motionlake.columns import numbers
from motionlake.lake.catalog import Connection, fetch, fetch_table, run_sql
from motionlake.lake.config import config_hash, load_config
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.motion.moves import KIND, WIDTH
from motionlake.motion.sketches import Directions, instants, searchable
from motionlake.stages.graph import SOURCES, made_keys
from motionlake.stages.moves import MOVES, made_parts, tracks_in
from motionlake.stages.reader import LakeReader, lake_reader
from motionlake.stages.shortlist_files import (
    CLIPS,
    CODES,
    FOLDER,
    FRAMES,
    HALF,
    INSTANTS,
    MOST,
    FramesWriter,
    Places,
    file_of,
    string_sketch,
    write_array,
    write_clips,
)
from motionlake.stages.stage import PartStage, Shard, ShardResult, ShardStage, frames_parts
from motionlake.stages.words import read_features

WIDTHS: Final[Mapping[str, int]] = {"signature": 32, "alignment": 64, "moves": 64}  # of sketches
COMPARED: Final[Mapping[str, PartStage]] = {method: SOURCES[method] for method in WIDTHS}
DIRECTIONS: Final = 24  # of frames of moves, in outlines
SAMPLE: Final = 2048  # clips that directions are fitted to
SPREAD: Final = 16  # parts that they are from, at least
BLOCK: Final = 4096  # clips whose sketches are made at a time


class Shortlist(ShardStage):
    """One shard for the whole lake."""

    name = "shortlist"
    version = 2
    about = "short vectors by which the search of a large lake chooses the clips that it compares"
    upstream = tuple(stage.name for stage in COMPARED.values())
    folders = (FOLDER,)

    def due(self, at: LakeReader) -> int:
        return len(self.plan(at))

    def plan(self, at: LakeReader) -> list[Shard]:
        """Nothing where no method has what it compares, or the lake holds no more than `MOST` clips."""
        shard = at.once("every", self.name, lambda: self.whole(at))
        return [] if shard is None or shard.key in at.done(self.name) else [shard]

    def again(self, at: LakeReader, key: str) -> Shard | None:
        shard = self.whole(at)
        return shard if shard is not None and shard.key == key else None

    def whole(self, at: LakeReader) -> Shard | None:
        """The shard that the lake as it stands needs, done or not; None where it needs none."""
        live = frames_parts(at.con)
        made = {method: made_keys(at, stage) for method, stage in COMPARED.items()}
        methods = [method for method, keys in made.items() if keys]
        if not methods or sum(part.clips for part in live) <= MOST:
            return None
        (clips,) = fetch(at.con, "digest_of_clips")
        key = config_hash(self.name, self.version, KIND, made, clips["digest"])
        files = [MOVES.file(part.key) for part in made_parts(at)]
        # Named by its datasets: it serves on where a part of them leaves the lake.
        datasets = "+".join(sorted({part.dataset for part in live}))
        return Shard(self.name, key, datasets, datasets, {"methods": methods, "moves": files}, clips["clips"])

    def run(self, root: Path, shard: Shard, /) -> ShardResult:
        started = time.perf_counter()
        lake = Lake(root)
        with lake_reader(lake, load_config(lake.config_file)) as at:
            clips = fetch_table(at.con, "clips_with_parts").select(["clip", "part"])
            places = Places(clips["clip"].to_pylist())
            columns: dict[str, Any] = {"clip": clips["clip"], "part": clips["part"]}
            files: list[str] = []
            for method in shard.spec["methods"]:
                more, written = MAKE[method](at, shard, places)
                columns |= more
                files += written
            models = {row["method"]: row["model"] for row in fetch(at.con, "models_compared")}
        table = pa.table(columns).replace_schema_metadata({**models, "moves": KIND, "key": shard.key})
        files.append(write_clips(lake, file_of(shard.key, CLIPS), table))
        size = sum(lake.path(file).stat().st_size for file in files)
        return ShardResult(shard, table.num_rows, size, tuple(files), time.perf_counter() - started)

    def load(self, con: Connection, root: Path, results: Sequence[ShardResult], /) -> None:
        """That of the lake as it was before goes."""
        run_sql(con, "forget_other_shards", {"stage": self.name, "keys": [r.shard.key for r in results]})


SHORTLIST: Final = Shortlist()
Made = tuple[dict[str, Any], list[str]]  # columns of the table of clips, files


def _sketches(
    lake: Lake, shard: Shard, method: str, places: Places, clips: Sequence[str], rows: Iterator[Float32Array],
    directions: Directions,
) -> list[str]:  # fmt: skip
    """Write sketches of clips, given the vectors [b, D] of some after the other, and the directions."""
    kept = np.zeros((len(places), directions.matrix.shape[1] + 1), dtype=np.float32)
    kept[:, -1] = -np.inf  # of clips that the method does not know: none is farther
    first = 0
    for block in rows:
        at = places.of(clips[first : first + len(block)])
        kept[at] = searchable(directions.project(block))
        first += len(block)
    return [*_directions(lake, shard, method, directions), _array(lake, shard, f"{method}-sketches", kept)]


def _directions(lake: Lake, shard: Shard, name: str, directions: Directions) -> list[str]:
    return [
        _array(lake, shard, f"{name}-mean", directions.mean),
        _array(lake, shard, f"{name}-directions", directions.matrix),
    ]


def _array(lake: Lake, shard: Shard, name: str, values: Any) -> str:
    return write_array(lake, file_of(shard.key, f"{name}.npy"), values)


def _by_signature(at: LakeReader, shard: Shard, places: Places) -> Made:
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
    lists = {"motifs": at_motif.astype(np.int32)[order], "weights": signatures[held, at_motif][order]}
    return {name: _lists(counts, values) for name, values in lists.items()}, files


def _by_alignment(at: LakeReader, shard: Shard, places: Places) -> Made:
    from motionlake.motion.moves_of_clips import instants_of_clips

    table = fetch_table(at.con, "symbol_strings").combine_chunks()
    names, strings = table["clip"].to_pylist(), table["symbols"].chunk(0)
    symbols, starts = numbers(strings.flatten()), np.asarray(numbers(strings.offsets), dtype=np.int64)
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
    return {"symbols": _lists(counts, symbols[order])}, files


def _by_moves(at: LakeReader, shard: Shard, places: Places) -> Made:
    from motionlake.motion.moves_of_clips import instants_of_clips

    lake, files = at.lake, shard.spec["moves"]
    some = list(_some_moves(at, files, places))
    directions = Directions.of(np.stack([instants(moves, INSTANTS).ravel() for moves in some]), WIDTHS["moves"])
    frames = Directions.of(np.concatenate(some), DIRECTIONS, centred=False)
    outlines = np.zeros((len(places), INSTANTS, frames.matrix.shape[1]), dtype=np.float16)
    names: list[str] = []

    def blocks(writer: FramesWriter) -> Iterator[Float32Array]:
        for file in files:
            clips, moves, starts = _moves_in(lake, file, places)
            if not clips:
                continue
            looked, rows = instants_of_clips(moves, starts, INSTANTS), places.of(clips)
            names.extend(clips)
            outlines[rows] = frames.project(looked)
            halves = moves.astype(HALF)
            for row, start, stop in zip(rows.tolist(), starts[:-1].tolist(), starts[1:].tolist(), strict=True):
                writer.add(row, halves[start:stop])
            yield looked.reshape(len(looked), -1)

    with FramesWriter(lake, file_of(shard.key, FRAMES), len(places)) as writer:
        written = _sketches(lake, shard, "moves", places, names, blocks(writer), directions)
    written += _directions(lake, shard, "outlines", frames)
    written += [_array(lake, shard, "moves-outlines", outlines), writer.file]
    return writer.columns(), written


def _moves_in(lake: Lake, file: str, places: Places) -> tuple[list[str], Float32Array, Int64Array]:
    """The clips of a part that have a row; their moves [M, D], and where those of each begin [n + 1]."""
    from motionlake.motion.moves_of_clips import moves_of_clips

    known = [(clip, joints) for clip, joints in read_features(sound(lake, file)) if clip in places]
    starts = np.cumsum([0, *(len(joints) for _, joints in known)], dtype=np.int64)
    if not known:
        return [], np.zeros((0, WIDTH), dtype=np.float32), starts
    return [clip for clip, _ in known], *moves_of_clips(np.concatenate([joints for _, joints in known]), starts)


def _some_moves(at: LakeReader, files: Sequence[str], places: Places) -> Iterator[Float32Array]:
    """Moves of about `SAMPLE` clips of parts all over the lake."""
    wanted = max(SPREAD, -(-SAMPLE * len(files) // len(places)))
    chosen = files[:: max(1, len(files) // wanted)]
    each = -(-SAMPLE // len(chosen))
    for file in chosen:
        known = [track for clip, track in tracks_in(at.lake, file) if clip in places]
        for track in known[:: max(1, len(known) // each)]:
            yield track.moves()


def _lists(counts: Any, values: Any) -> pa.Array:
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    return pa.ListArray.from_arrays(pa.array(offsets), pa.array(values))


MAKE: Final = {"signature": _by_signature, "alignment": _by_alignment, "moves": _by_moves}
