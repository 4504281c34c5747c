"""The windows of a large lake in its shortlist: by some numbers of each, clips that may hold a piece are chosen.

They are what is left of the vectors of windows along directions of the lake, all in one file, so that a search opens
neither the vectors nor the codes of every part. Those of clips that stay as they were are taken over.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import BoolArray, Float32Array, Int64Array
from motionlake.columns import numbers
from motionlake.lake.catalog import Connection
from motionlake.lake.integrity import sound, sound_files
from motionlake.lake.layout import Lake
from motionlake.motion.sketches import Directions
from motionlake.stages.reader import LakeReader
from motionlake.stages.shortlist_before import GROWN
from motionlake.stages.shortlist_files import (
    CLIPS,
    Made,
    Places,
    is_of_windows,
    read_clips,
    said_of,
    write_array,
    write_directions,
)
from motionlake.stages.stage import Shard
from motionlake.stages.submotions import SUBMOTIONS
from motionlake.stages.windows import WINDOWS, WindowFile
from numpy.typing import NDArray

DIRECTIONS: Final = 128
LARGEST: Final = 127
SMALLEST: Final = 1e-3  # of the longest step, how long each is at least: few windows differ along few directions
SPREAD: Final = 16  # parts whose windows directions are fitted to
KIND: Final = "windows"  # names in what a table of clips says of itself
FITTED: Final = "windows fitted"
LAYOUT: Final = 3


def kind_of(con: Connection) -> str | None:
    """What the windows of the lake are told by: those of another kind do not compare. None where there are none."""
    served = SUBMOTIONS.served(con)
    return None if served is None else json.dumps([LAYOUT, served.model, SUBMOTIONS.version, WINDOWS.version])


@dataclass(frozen=True)
class WindowNumbers:
    """Of the windows of n clips, one clip after another, their places along the directions.

    Attributes:
        places: [N, DIRECTIONS].
        starts: [n + 1] where those of each clip begin.
        directions: along which places are whole numbers of steps, from -127 to 127.
        steps: [DIRECTIONS] how long a step is; short where windows differ little, else rounding would hide near ones.
        clips: the table of the shortlist's clips.
    """

    places: NDArray[np.int8]
    starts: Int64Array
    directions: Directions
    steps: Float32Array
    clips: pa.Table

    @staticmethod
    def open(lake: Lake, files: Sequence[str], kind: str | None) -> WindowNumbers | None:
        """Those of a shortlist's files; None where it has none, or such of another kind.

        Raises:
            DamagedError: a file is not as it was written.
        """
        own = [file for file in files if is_of_windows(file)]
        if not own:
            return None
        clips = read_clips(lake, files)
        if said_of(clips).get(KIND) != kind:
            return None
        mean, matrix, steps, places = map(_array, sound_files(lake, sorted(own, key=_order)))
        starts = np.concatenate([[0], np.cumsum(numbers(clips[KIND]), dtype=np.int64)])
        return WindowNumbers(places, starts, Directions(mean, matrix), steps, clips)


def _order(file: str) -> int:
    return next(i for i, end in enumerate(("-mean.npy", "-directions.npy", "-steps.npy", ".npy")) if file.endswith(end))


def _array(path: Path) -> NDArray[Any]:
    found: NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False)
    return found


def windows_to_read(at: LakeReader, there: Sequence[str], clips: pa.Table) -> dict[str, Any]:
    """What a shard of a lake reads of [n] clip and part: of the shortlist with some files what serves on, and codes.

    Directions are fitted anew where the lake has grown much since they were.
    """
    files, kind = codes_of_parts(at), kind_of(at.con)
    own = [file for file in there if is_of_windows(file) or file.endswith(CLIPS)]
    before = WindowNumbers.open(at.lake, own, kind)
    if before is None or len(clips) > GROWN * int(said_of(before.clips)[FITTED]):
        return {"windows": files}
    known = _pairs(before)
    parts = dict.fromkeys(part for pair in zip(*_names(clips), strict=True) if pair not in known for part in pair[1:])
    return {"windows": {part: files[part] for part in parts if part in files}, "windows before": own}


def codes_of_parts(at: LakeReader) -> dict[str, str]:
    """The codes of every frames part of the lake as it stands."""
    return {part.part: WINDOWS.file(part.key) for part in WINDOWS.made(at)}


def windows_of_clips(at: LakeReader, shard: Shard, places: Places, clips: pa.Table) -> Made:
    """Those of all clips: of [n] clip and part. The shard says what is read, as `windows_to_read` does."""
    kind, read = kind_of(at.con), shard.spec["windows"]
    before = WindowNumbers.open(at.lake, shard.spec.get("windows before", ()), kind)
    every, others = np.zeros(len(places), dtype=np.int32), np.ones(len(places), dtype=np.bool_)
    staying: list[tuple[int, slice]] = []
    if before is None:
        (directions, steps), fitted = _fitted(at.lake, list(read.values())), len(clips)
    else:
        directions, steps, fitted = before.directions, before.steps, int(said_of(before.clips)[FITTED])
        staying = _staying(before, clips)
    for row, run in staying:
        every[row], others[row] = run.stop - run.start, False
    wanted = _wanted(read, clips, others)
    for file, rows in wanted.items():
        for row, run in _runs(WindowFile.open(sound(at.lake, file)), rows):
            every[row] = run.stop - run.start
    starts = np.concatenate([[0], np.cumsum(every, dtype=np.int64)])
    kept = np.empty((starts[-1], DIRECTIONS), dtype=np.int8)  # filled in place: of a large lake it has 400 MB
    for row, run in staying:
        assert before is not None
        kept[starts[row] : starts[row + 1]] = before.places[run]
    for file, rows in wanted.items():
        _read(WindowFile.open(sound(at.lake, file)), rows, directions, starts, kept)
    written = [
        *write_directions(at.lake, shard.key, KIND, directions),
        write_array(at.lake, shard.key, f"{KIND}-steps", steps),
        write_array(at.lake, shard.key, KIND, kept),
    ]
    return Made({KIND: pa.array(every)}, written, {KIND: str(kind), FITTED: str(fitted)})


def _pairs(before: WindowNumbers) -> dict[tuple[str, str], int]:
    """The rows of clips with windows, by clip and part."""
    counts = np.diff(before.starts)
    return {pair: row for row, pair in enumerate(zip(*_names(before.clips), strict=True)) if counts[row]}


def _staying(before: WindowNumbers, clips: pa.Table) -> list[tuple[int, slice]]:
    """(row, its windows there) of the clips that an earlier shortlist holds as they are."""
    known = _pairs(before)
    pairs = ((row, known.get(pair)) for row, pair in enumerate(zip(*_names(clips), strict=True)))
    return [(row, slice(*before.starts[old : old + 2].tolist())) for row, old in pairs if old is not None]


def _wanted(files: Mapping[str, str], clips: pa.Table, others: BoolArray) -> dict[str, dict[str, int]]:
    """The rows of some clips, by name, of the file of each part: one may hold more, which are other parts' by now."""
    found: dict[str, dict[str, int]] = {}
    for row, (clip, part) in enumerate(zip(*_names(clips), strict=True)):
        if others[row] and part in files:
            found.setdefault(files[part], {})[clip] = row
    return found


def _names(table: pa.Table) -> tuple[list[str], list[str]]:
    return table["clip"].to_pylist(), table["part"].to_pylist()


def _runs(held: WindowFile, rows: Mapping[str, int]) -> Iterator[tuple[int, slice]]:
    """(row, its windows there) of some clips of a part."""
    yield from ((rows[clip], run) for clip, run in held.runs.items() if clip in rows)


def _read(
    held: WindowFile, rows: Mapping[str, int], directions: Directions, starts: Int64Array, kept: NDArray[np.int8]
) -> None:
    """Write the numbers of the windows of some clips of a part where those of each begin."""
    for row, run in _runs(held, rows):
        along = directions.project(held.codes[run] * held.scales[run, None])
        kept[starts[row] : starts[row + 1]] = np.clip(np.rint(along), -LARGEST, LARGEST)


def _fitted(lake: Lake, files: Sequence[str]) -> tuple[Directions, Float32Array]:
    """Directions of the windows of some parts, and steps by which 127 reach the farthest of these."""
    some = np.concatenate(list(_some(lake, files)))
    directions = Directions.of(some, DIRECTIONS)
    largest = np.abs(directions.project(some)).max(axis=0, initial=0.0)
    reached = np.maximum(largest, SMALLEST * largest.max()) if largest.any() else np.ones_like(largest)
    steps = np.asarray(reached / LARGEST, dtype=np.float32)
    return Directions(directions.mean, directions.matrix / steps), steps


def _some(lake: Lake, files: Sequence[str]) -> Iterator[Float32Array]:
    for file in files[:: max(1, len(files) // SPREAD)]:
        held = WindowFile.open(sound(lake, file))
        yield np.asarray(held.codes * held.scales[:, None], dtype=np.float32)
