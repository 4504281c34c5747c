"""The windows of a large lake in its shortlist: by some numbers of each, clips that may hold a piece are chosen.

They are what is left of the vectors of windows along directions of the lake, all in one file, so that a search opens
none of the parts of windows. The vectors of the clips that it chooses lie in pieces. Those of clips that stay as they
were are taken over.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array, Int64Array
from motionlake.columns import numbers, read_parquet
from motionlake.deephums.config import DIMENSION
from motionlake.lake.catalog import Connection
from motionlake.lake.frames import runs_of
from motionlake.lake.integrity import sound, sound_files
from motionlake.lake.layout import Lake
from motionlake.motion.sketches import Directions
from motionlake.stages.reader import LakeReader
from motionlake.stages.shortlist_before import (
    GROWN,
    NextPiece,
    Staying,
    as_named,
    files_by_part,
    named,
    rows_by_file,
    staying,
)
from motionlake.stages.shortlist_files import (
    CLIPS,
    HALF,
    Made,
    Places,
    is_of_windows,
    mapped_array,
    read_clips,
    said_of,
    write_array,
    write_directions,
)
from motionlake.stages.shortlist_pieces import Kind, Pieces
from motionlake.stages.stage import Shard
from motionlake.stages.submotions import SUBMOTIONS
from numpy.typing import NDArray

DIRECTIONS: Final = 64  # a multiple of 32, of which processors take as many at a time
LARGEST: Final = 127
SMALLEST: Final = 1e-3  # of the longest step, how long each is at least: few windows differ along few directions
SPREAD: Final = 16  # parts whose windows directions are fitted to
PIECES: Final = Kind(
    "windows", ".rows", ("windows_piece", "windows_start", "windows", "windows_crc32"),
    np.dtype([("start", "<i4"), ("stop", "<i4"), ("vector", HALF, (DIMENSION,))]),
)  # fmt: skip
KIND: Final = "windows"  # names in what a table of clips says of itself
FITTED: Final = "windows fitted"
WRITTEN: Final = "windows written"
LAYOUT: Final = 7
_ARRAYS: Final = ("mean", "directions", "steps", "numbers")


def kind_of(con: Connection) -> str | None:
    """What the windows of the lake are told by: those of another kind do not compare. None where there are none."""
    served = SUBMOTIONS.served(con)
    return None if served is None else json.dumps([LAYOUT, served.model, SUBMOTIONS.version])


@dataclass(frozen=True)
class ShortlistWindows:
    """The windows of n clips, one clip after another.

    Attributes:
        numbers: [N, DIRECTIONS] their places along the directions.
        starts: [n + 1] where those of each clip begin.
        directions: along which places are whole numbers of steps, from -127 to 127.
        steps: [DIRECTIONS] how long a step is; short where windows differ little, else rounding would hide near ones.
        clips: the table of the shortlist's clips.
        rows: their bounds and vectors.
        pieces: the files of these.
    """

    numbers: NDArray[np.int8]
    starts: Int64Array
    directions: Directions
    steps: Float32Array
    clips: pa.Table
    rows: Pieces
    pieces: Sequence[str]

    @staticmethod
    def open(lake: Lake, files: Sequence[str], kind: str | None) -> ShortlistWindows | None:
        """Those of a shortlist's files; None where it has none, or such of another kind.

        Raises:
            DamagedError: a file is not as it was written.
        """
        pieces = PIECES.among(files)
        own = [file for file in files if is_of_windows(file) and file not in pieces]
        if not own:
            return None
        clips = read_clips(lake, files)
        if said_of(clips).get(KIND) != kind:
            return None
        mean, matrix, steps, places = map(mapped_array, sound_files(lake, sorted(own, key=_order)))
        starts = np.concatenate([[0], np.cumsum(numbers(clips[KIND]), dtype=np.int64)])
        rows = Pieces(lake, pieces, clips, PIECES)
        return ShortlistWindows(places, starts, Directions(mean, matrix), steps, clips, rows, pieces)


def _order(file: str) -> int:
    return next(i for i, end in enumerate(_ARRAYS) if file.endswith(f"-{end}.npy"))


@dataclass(frozen=True)
class _Before(Staying):
    """What of an earlier shortlist's windows serves on: all that it has."""

    windows: ShortlistWindows

    @staticmethod
    def of(lake: Lake, files: Sequence[str], kind: str | None, clips: pa.Table) -> _Before | None:
        """None where all windows must be read: directions are fitted anew where the lake has grown much since."""
        there = ShortlistWindows.open(lake, files, kind)
        if there is None or len(clips) > GROWN * int(said_of(there.clips)[FITTED]):
            return None
        held, written = np.diff(there.starts), json.loads(said_of(there.clips)[WRITTEN])
        found = staying(there.clips, clips, PIECES, files, written, lambda old, _: held[old] > 0)
        return None if found is None else _Before(found.old, found.new, found.pieces, there)


def windows_to_read(at: LakeReader, there: Sequence[str], clips: pa.Table) -> dict[str, Any]:
    """What a shard of a lake reads of [n] clip and part: of the shortlist with some files what serves on, and parts."""
    files = vectors_of_parts(at)
    own = [file for file in there if is_of_windows(file) or file.endswith(CLIPS)]
    before = _Before.of(at.lake, own, kind_of(at.con), clips)
    if before is None:
        return {"windows": files}
    return {"windows": files_by_part(files, clips, before.others(len(clips))), **as_named("windows", own, before)}


def vectors_of_parts(at: LakeReader) -> dict[str, str]:
    """The vectors of the windows of every frames part of the lake as it stands."""
    return {part.part: SUBMOTIONS.file(part.key) for part in SUBMOTIONS.made(at)}


def windows_of_clips(at: LakeReader, shard: Shard, clips: pa.Table, places: Places) -> Made:
    """Those of all clips: of [n] clip and part. The shard says what is read, as `windows_to_read` does."""
    kind, read = kind_of(at.con), shard.spec["windows"]
    before = _Before.of(at.lake, named(shard.spec, "windows"), kind, clips)
    if before is None:
        (directions, steps), fitted = _fitted(at.lake, list(read.values())), len(clips)
    else:
        there = before.windows
        directions, steps, fitted = there.directions, there.steps, int(said_of(there.clips)[FITTED])
    with NextPiece(at, shard.key, PIECES, len(places), before) as piece:
        wanted = rows_by_file(read, clips, piece.others)
        starts = _starts(at.lake, wanted, before, len(clips))
        kept = np.empty((starts[-1], DIRECTIONS), dtype=np.int8)  # filled in place: of a large lake it has 200 MB
        if before is not None:
            _take_over(before, starts, kept)
            piece.take_over(before, before.windows.clips, before.windows.pieces)
        for file, rows in wanted.items():
            _read(sound(at.lake, file), rows, directions, starts, kept, piece)
    made, written = piece.made()
    arrays = [
        *write_directions(at.lake, shard.key, KIND, directions),
        write_array(at.lake, shard.key, f"{KIND}-steps", steps),
        write_array(at.lake, shard.key, f"{KIND}-numbers", kept),
    ]
    said = {KIND: str(kind), FITTED: str(fitted), WRITTEN: json.dumps(written)}
    return replace(made, files=[*arrays, *made.files], said=said)


def _starts(lake: Lake, wanted: Mapping[str, Mapping[str, int]], before: _Before | None, clips: int) -> Int64Array:
    """[n + 1] where the windows of each clip begin."""
    every = np.zeros(clips, dtype=np.int64)
    if before is not None:
        every[before.new] = np.diff(before.windows.starts)[before.old]
    for file, rows in wanted.items():
        for row, run in _runs(read_parquet(sound(lake, file), ["clip"]), rows):
            every[row] = run.stop - run.start
    return np.concatenate([[0], np.cumsum(every)])


def _runs(held: pa.Table, rows: Mapping[str, int]) -> Iterator[tuple[int, slice]]:
    """(row, its windows there) of some clips of a part."""
    yield from ((rows[clip], run) for clip, run in runs_of(held["clip"]) if clip in rows)


def _take_over(before: _Before, starts: Int64Array, kept: NDArray[np.int8]) -> None:
    """Write the numbers of the windows of clips that stay where those of each begin."""
    found = before.windows
    for old, new in zip(before.old.tolist(), before.new.tolist(), strict=True):
        kept[starts[new] : starts[new + 1]] = found.numbers[found.starts[old] : found.starts[old + 1]]


def _read(
    path: Path, rows: Mapping[str, int], directions: Directions, starts: Int64Array, kept: NDArray[np.int8],
    piece: NextPiece,
) -> None:  # fmt: skip
    """Write the windows of some clips of a part, and their numbers where those of each begin."""
    held = read_parquet(path, ["clip", "start", "stop", "descriptor"])
    windows = np.empty(len(held), dtype=PIECES.row)
    windows["start"], windows["stop"], windows["vector"] = numbers(held["start"]), numbers(held["stop"]), _vectors(held)
    for row, run in _runs(held, rows):
        along = directions.project(windows["vector"][run].astype(np.float32))
        kept[starts[row] : starts[row + 1]] = np.clip(np.rint(along), -LARGEST, LARGEST)
        piece.add(row, windows[run])


def _vectors(held: pa.Table) -> NDArray[np.float16]:
    """[w, 512] of the windows of a part."""
    found = numbers(held["descriptor"].combine_chunks().flatten()).reshape(-1, DIMENSION)
    return np.asarray(found, dtype=HALF)


def _fitted(lake: Lake, files: Sequence[str]) -> tuple[Directions, Float32Array]:
    """Directions of the windows of some parts, and steps by which 127 reach the farthest of these."""
    parts = files[:: max(1, len(files) // SPREAD)]
    vectors = [_vectors(read_parquet(sound(lake, file), ["descriptor"])) for file in parts]
    some = np.concatenate(vectors).astype(np.float32)
    directions = Directions.of(some, DIRECTIONS)
    largest = np.abs(directions.project(some)).max(axis=0, initial=0.0)
    reached = np.maximum(largest, SMALLEST * largest.max()) if largest.any() else np.ones_like(largest)
    steps = np.asarray(reached / LARGEST, dtype=np.float32)
    return Directions(directions.mean, directions.matrix / steps), steps
