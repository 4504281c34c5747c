"""The files of the shortlist of a large lake: arrays that are mapped into memory; a search reads of them what it needs.

All but the frames of moves are compared with what was written before they are read. The frames are many times as
large, and a search reads those of some hundred clips: each clip has a checksum of its own.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.columns import numbers
from motionlake.errors import DamagedError
from motionlake.lake.integrity import damage, size_fault, sound_files
from motionlake.lake.layout import Lake
from motionlake.lake.parts import replacing
from motionlake.motion.sketches import Directions, instants
from numpy.typing import NDArray

MOST: Final = 20_000  # clips of a lake up to which a search compares all of them
FOLDER: Final = "shortlist"
CLIPS: Final = "clips.arrow"
FRAMES: Final = "moves.f16"
HALF: Final = np.dtype("<f2")
INSTANTS: Final = 12  # of the moves of a clip, for its sketch and for its outline
CODES: Final = 16  # of its postures
CHECKED: Final = 1000  # clips whose moves are compared at a time


def file_of(key: str, name: str) -> str:
    """A file of the shortlist with a key, relative to the lake."""
    return f"{FOLDER}/{key[:16]}-{name}"


def string_sketch(symbols: Sequence[int] | NDArray[np.int32], codes: Float64Array) -> Float32Array:
    """[CODES * d] the codes [m, d] of a string of symbols at some instants."""
    return instants(codes[np.asarray(symbols)], CODES).ravel()


class Places(Mapping[str, int]):
    """The row of every clip."""

    def __init__(self, clips: Sequence[str]) -> None:
        self._rows = {clip: row for row, clip in enumerate(clips)}

    def __getitem__(self, clip: str) -> int:
        return self._rows[clip]

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    def of(self, clips: Sequence[str]) -> Int64Array:
        """[b] rows of some."""
        return np.array([self._rows[clip] for clip in clips], dtype=np.int64)


def write_array(lake: Lake, file: str, values: NDArray[Any]) -> str:
    """Write an array; returns the name of its file."""
    with replacing(lake.path(file)) as temporary, temporary.open("wb") as handle:
        np.save(handle, np.ascontiguousarray(values), allow_pickle=False)
    return file


def write_clips(lake: Lake, file: str, table: pa.Table) -> str:
    """Write the table of clips; returns the name of its file."""
    whole = table.combine_chunks()
    with replacing(lake.path(file)) as temporary, pa.ipc.new_file(str(temporary), whole.schema) as writer:
        writer.write_table(whole)
    return file


class FramesWriter:
    """Writes the frames of clips one after another, in half precision.

    Args:
        lake: to write to.
        file: relative to it.
        clips: rows of the table that tells where the frames of a clip lie.
    """

    def __init__(self, lake: Lake, file: str, clips: int) -> None:
        self._path, self.file = lake.path(file), file
        self._starts, self._counts = np.zeros(clips, dtype=np.int64), np.zeros(clips, dtype=np.int32)
        self._sums, self._written = np.zeros(clips, dtype=np.uint32), 0
        self._stack = ExitStack()

    def __enter__(self) -> FramesWriter:
        temporary = self._stack.enter_context(replacing(self._path))
        self._handle: BinaryIO = self._stack.enter_context(temporary.open("wb"))
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.__exit__(*error)  # type: ignore[arg-type]

    def add(self, row: int, frames: NDArray[np.float16]) -> None:
        """The frames [m, D] of the clip of a row."""
        data = frames.tobytes()
        self._handle.write(data)
        self._starts[row], self._counts[row], self._sums[row] = self._written, len(frames), zlib.crc32(data)
        self._written += len(frames)

    def columns(self) -> dict[str, NDArray[Any]]:
        """Of the table of clips."""
        return {"start": self._starts, "frames": self._counts, "crc32": self._sums}


@dataclass(frozen=True)
class ShortlistFiles:
    """What the stage has made of n clips.

    Attributes:
        lake: which holds it.
        key: of the shard.
        table: [n] clip, part, and what each method keeps in lists.
        models: what signatures and strings are made over, by method.
        arrays: by name.
    """

    lake: Lake
    key: str
    table: pa.Table
    models: Mapping[str, str]
    arrays: Mapping[str, NDArray[Any]]

    @staticmethod
    def open(lake: Lake, files: Sequence[str]) -> ShortlistFiles:
        """Raises `DamagedError` where a file is not as it was written."""
        whole = [file for file in files if not file.endswith(FRAMES)]
        paths = dict(zip(whole, sound_files(lake, whole), strict=True))
        arrays = {_name(file): np.load(path, mmap_mode="r", allow_pickle=False)
                  for file, path in paths.items() if file.endswith(".npy")}  # fmt: skip
        (clips,) = (path for file, path in paths.items() if file.endswith(CLIPS))
        table = pa.ipc.open_file(pa.memory_map(str(clips))).read_all()
        said = {name.decode(): value.decode() for name, value in (table.schema.metadata or {}).items()}
        return ShortlistFiles(lake, said.pop("key"), table, said, arrays)

    @property
    def methods(self) -> tuple[str, ...]:
        return tuple(name.removesuffix("-sketches") for name in self.arrays if name.endswith("-sketches"))

    def directions(self, name: str) -> Directions:
        return Directions(self.arrays[f"{name}-mean"], self.arrays[f"{name}-directions"])

    def numbers(self, name: str) -> NDArray[Any]:
        """[n] a column of numbers."""
        return numbers(self.table[name])

    def lists(self, name: str, rows: Int64Array) -> list[NDArray[Any]]:
        """A column of lists, those of some rows."""
        values, offsets = self._flat(name)
        return [values[offsets[row] : offsets[row + 1]] for row in rows.tolist()]

    def joined(self, name: str, rows: Int64Array) -> tuple[NDArray[Any], Int64Array]:
        """The same one after another, and how long each is."""
        values, offsets = self._flat(name)
        lengths = np.asarray(offsets[rows + 1] - offsets[rows], dtype=np.int64)
        first = np.repeat(offsets[rows] - np.cumsum(lengths) + lengths, lengths)
        return values[first + np.arange(len(first))], lengths

    def _flat(self, name: str) -> tuple[NDArray[Any], NDArray[Any]]:
        (chunk,) = self.table[name].chunks
        return np.from_dlpack(chunk.values), np.from_dlpack(chunk.offsets)

    def moves(self, rows: Int64Array) -> list[NDArray[np.float16]]:
        """The moves [m, D] of the clips of some rows, which have some. Raises `DamagedError` as `moves_at` does."""
        frames, starts, counts = self.moves_at(rows)
        return [frames[start : start + count] for start, count in zip(starts.tolist(), counts.tolist(), strict=True)]

    def moves_at(self, rows: Int64Array) -> tuple[NDArray[np.float16], Int64Array, Int64Array]:
        """The moves [N, D] of all clips, and where in them those of some rows lie: from which frame, how many.

        Raises:
            DamagedError: those of these rows are not as they were written.
        """
        starts, counts = (self.numbers(name)[rows] for name in ("start", "frames"))
        new = np.flatnonzero(~self._sound[rows])
        wanted = self.numbers("crc32")[rows[new]]
        for start, count, sum_ in zip(starts[new].tolist(), counts[new].tolist(), wanted.tolist(), strict=True):
            if zlib.crc32(self._frames[start : start + count].data) != sum_:
                raise DamagedError(damage(self.lake, self._file, "holds other bytes than were written"))
        self._sound[rows] = True
        return self._frames, starts, counts.astype(np.int64)

    def check_moves(self) -> None:
        """Compare the moves of all clips with what was written, which maps them into memory: searches find that done.

        Raises:
            DamagedError: as `moves_at`.
        """
        for first in range(0, len(self.table), CHECKED):
            self.moves_at(np.arange(first, min(first + CHECKED, len(self.table))))

    @cached_property
    def _sound(self) -> NDArray[np.bool_]:
        """[n] clips whose moves were compared with what was written."""
        return np.zeros(len(self.table), dtype=np.bool_)

    @property
    def _file(self) -> str:
        return file_of(self.key, FRAMES)

    @cached_property
    def _frames(self) -> NDArray[np.float16]:
        wrong = size_fault(self.lake, self._file)
        if wrong is not None:
            raise DamagedError(damage(self.lake, self._file, wrong))
        width = self.arrays["outlines-directions"].shape[0]
        return np.asarray(np.memmap(self.lake.path(self._file), dtype=HALF, mode="r")).reshape(-1, width)


def _name(file: str) -> str:
    return Path(file).stem.partition("-")[2]
