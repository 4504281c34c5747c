"""The files of the shortlist of a large lake: arrays that are mapped into memory; a search reads of them what it needs.

All but the frames of moves are compared with what was written before they are read. The frames are many times as
large, and a search reads those of some hundred clips: each clip has a checksum of its own. They lie in several pieces,
so that those of clips that come need not be written together with all others.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, fields
from functools import cached_property
from mmap import ACCESS_READ, MADV_WILLNEED, PAGESIZE, mmap
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.columns import numbers
from motionlake.errors import DamagedError, UserError
from motionlake.lake.integrity import FileSums, damage, size_fault, sound_files
from motionlake.lake.layout import Lake
from motionlake.lake.parts import replacing
from motionlake.motion.sketches import Directions, instants
from numpy.typing import NDArray

MOST: Final = 20_000  # clips of a lake up to which a search compares all of them
FOLDER: Final = "shortlist"
CLIPS: Final = "clips.arrow"
FRAMES: Final = ".f16"  # how the names of pieces end
HALF: Final = np.dtype("<f2")
INSTANTS: Final = 12  # of the moves of a clip, for its sketch and for its outline
CODES: Final = 16  # of its postures
WIDTHS: Final[Mapping[str, int]] = {"signature": 32, "alignment": 64, "moves": 64}  # of sketches, by method
SAMPLE: Final = 2048  # clips that directions are fitted to
CHECKED: Final = 1000  # clips whose moves are compared at a time


def file_of(key: str, name: str) -> str:
    """A file of the shortlist with a key, relative to the lake."""
    return f"{FOLDER}/{key[:16]}-{name}"


def piece_of(key: str, number: int) -> str:
    """A piece of the frames of moves, from 0."""
    return file_of(key, f"moves-{number}{FRAMES}" if number else f"moves{FRAMES}")


def is_of_windows(file: str) -> bool:
    """Whether a search of pieces alone reads it (`motionlake.stages.shortlist_windows`)."""
    return _name(file).startswith("windows")


def pieces_in(files: Sequence[str]) -> list[str]:
    """Those of a shortlist's files that are pieces of the frames of moves, by number."""
    return sorted((file for file in files if file.endswith(FRAMES)), key=lambda file: (len(_name(file)), _name(file)))


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


@dataclass(frozen=True)
class Made:
    """What a method gives to the shortlist.

    Attributes:
        columns: of the table of clips.
        files: all that it consists of.
        said: what the table says of it.
        sums: of those files that were there before.
    """

    columns: Mapping[str, Any]
    files: Sequence[str]
    said: Mapping[str, str] = field(default_factory=dict)
    sums: Sequence[FileSums] = ()


def no_sketches(clips: int, directions: Directions) -> Float32Array:
    """[clips, w + 1] sketches of clips that a method does not know: none is farther."""
    kept = np.zeros((clips, directions.matrix.shape[1] + 1), dtype=np.float32)
    kept[:, -1] = -np.inf
    return kept


def write_array(lake: Lake, key: str, name: str, values: NDArray[Any]) -> str:
    """Write an array; returns the name of its file."""
    file = file_of(key, f"{name}.npy")
    with replacing(lake.path(file)) as temporary, temporary.open("wb") as handle:
        np.save(handle, np.ascontiguousarray(values), allow_pickle=False)
    return file


def write_directions(lake: Lake, key: str, name: str, directions: Directions) -> list[str]:
    """Write directions; returns the names of their files."""
    return [
        write_array(lake, key, f"{name}-mean", directions.mean),
        write_array(lake, key, f"{name}-directions", directions.matrix),
    ]


def write_clips(lake: Lake, file: str, table: pa.Table) -> str:
    """Write the table of clips; returns the name of its file."""
    whole = table.combine_chunks()
    with replacing(lake.path(file)) as temporary, pa.ipc.new_file(str(temporary), whole.schema) as writer:
        writer.write_table(whole)
    return file


@dataclass(frozen=True)
class FramesColumns:
    """Where the frames of the moves of n clips lie: of which piece, from which frame, how many, and their checksum."""

    piece: NDArray[np.int32]
    start: NDArray[np.int64]
    frames: NDArray[np.int32]
    crc32: NDArray[np.uint32]

    @staticmethod
    def empty(clips: int) -> FramesColumns:
        piece, frames = np.zeros(clips, dtype=np.int32), np.zeros(clips, dtype=np.int32)
        return FramesColumns(piece, np.zeros(clips, dtype=np.int64), frames, np.zeros(clips, dtype=np.uint32))

    def columns(self) -> dict[str, NDArray[Any]]:
        """Of the table of clips."""
        return {each.name: getattr(self, each.name) for each in fields(self)}


class FramesWriter:
    """Writes a piece of frames, those of one clip after another, in half precision.

    Args:
        lake: to write to.
        file: relative to it.
        number: of the piece.
        places: told where the frames of a clip lie.
    """

    def __init__(self, lake: Lake, file: str, number: int, places: FramesColumns) -> None:
        self._path, self.file = lake.path(file), file
        self._number, self._places, self.written = number, places, 0
        self._stack = ExitStack()

    def __enter__(self) -> FramesWriter:
        temporary = self._stack.enter_context(replacing(self._path))
        self._handle: BinaryIO = self._stack.enter_context(temporary.open("wb"))
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.__exit__(*error)  # type: ignore[arg-type]

    def add(self, row: int, frames: NDArray[np.float16]) -> None:
        """The frames [m, D] of the clip of a row."""
        data, places = frames.tobytes(), self._places
        self._handle.write(data)
        places.piece[row], places.start[row], places.frames[row] = self._number, self.written, len(frames)
        places.crc32[row] = zlib.crc32(data)
        self.written += len(frames)


@dataclass(frozen=True)
class ShortlistFiles:
    """What the stage has made of n clips.

    Attributes:
        lake: which holds it.
        table: [n] clip, part, and what each method keeps in lists.
        models: what signatures and strings are made over, by method.
        arrays: by name.
        pieces: files of the frames of moves.
    """

    lake: Lake
    table: pa.Table
    models: Mapping[str, str]
    arrays: Mapping[str, NDArray[Any]]
    pieces: Sequence[str]

    @staticmethod
    def open(lake: Lake, files: Sequence[str]) -> ShortlistFiles:
        """Raises `DamagedError` where a file is not as it was written."""
        whole = [file for file in files if not (file.endswith(FRAMES) or is_of_windows(file))]
        paths = dict(zip(whole, sound_files(lake, whole), strict=True))
        arrays = {_name(file): np.load(path, mmap_mode="r", allow_pickle=False)
                  for file, path in paths.items() if file.endswith(".npy")}  # fmt: skip
        (clips,) = (path for file, path in paths.items() if file.endswith(CLIPS))
        table = pa.ipc.open_file(pa.memory_map(str(clips))).read_all()
        said = said_of(table)
        models = {method: said[method] for method in WIDTHS if method in said}
        return ShortlistFiles(lake, table, models, arrays, pieces_in(files))

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
        values, offsets = self.flat(name)
        return [values[offsets[row] : offsets[row + 1]] for row in rows.tolist()]

    def joined(self, name: str, rows: Int64Array) -> tuple[NDArray[Any], Int64Array]:
        """The same one after another, and how long each is."""
        values, offsets = self.flat(name)
        lengths = offsets[rows + 1] - offsets[rows]
        first = np.repeat(offsets[rows] - np.cumsum(lengths) + lengths, lengths)
        return values[first + np.arange(len(first))], lengths

    def flat(self, name: str) -> tuple[NDArray[Any], Int64Array]:
        """The same of all clips, and [n + 1] where those of each begin."""
        if name not in self._lists:
            (chunk,) = self.table[name].chunks
            offsets = np.asarray(np.from_dlpack(chunk.offsets), dtype=np.int64)
            self._lists[name] = np.from_dlpack(chunk.values), offsets
        return self._lists[name]

    @cached_property
    def _lists(self) -> dict[str, tuple[NDArray[Any], Int64Array]]:
        return {}

    def lacks(self, row: int, what: str) -> UserError:
        """The error for a clip of which a method has nothing."""
        return UserError(f"{self.table['clip'][row].as_py()}: has no {what} yet; make it with `motionlake run all`")

    def moves(self, rows: Int64Array) -> list[NDArray[np.float16]]:
        """The moves [m, D] of the clips of some rows, which have some. Raises `DamagedError` as `moves_at` does."""
        frames, starts, counts = self.moves_at(rows)
        return [frames[start : start + count] for start, count in zip(starts.tolist(), counts.tolist(), strict=True)]

    def moves_at(self, rows: Int64Array, every: int = 1) -> tuple[NDArray[np.float16], Int64Array, Int64Array]:
        """Moves [N, D], and where in them those of some rows lie: from which frame, how many.

        Args:
            rows: of the clips.
            every: take one of so many frames of each, the first one first.

        Raises:
            DamagedError: those of these rows are not as they were written.
        """
        starts, counts = (self.numbers(name)[rows] for name in ("start", "frames"))
        pieces = self._piece[rows]
        new = np.flatnonzero(~self._sound[rows])
        wanted = self.numbers("crc32")[rows[new]]
        numbers = (pieces[new], starts[new], counts[new], wanted)
        self._expect(*numbers[:3])
        for piece, start, count, sum_ in zip(*(each.tolist() for each in numbers), strict=True):
            if zlib.crc32(self._frames(piece)[start : start + count].data) != sum_:
                raise DamagedError(damage(self.lake, self.pieces[piece], "holds other bytes than were written"))
        self._sound[rows] = True
        counts = counts.astype(np.int64)
        if every == 1 and len(set(pieces.tolist())) <= 1:
            return self._frames(int(pieces[0]) if len(pieces) else 0), starts, counts
        taken = -(-counts // every)
        begins = np.cumsum(taken) - taken
        steps = np.repeat(starts - every * begins, taken) + every * np.arange(taken.sum())
        owners = np.repeat(pieces, taken)
        found = np.empty((len(steps), self._width), dtype=HALF)
        for piece in sorted(set(pieces.tolist())):
            own = owners == piece
            found[own] = self._frames(piece)[steps[own]]
        return found, begins, taken

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

    @cached_property
    def _piece(self) -> NDArray[Any]:
        """[n] the piece that holds the moves of a clip; earlier versions wrote one alone."""
        there = "piece" in self.table.column_names
        return self.numbers("piece") if there else np.zeros(len(self.table), dtype=np.int32)

    def _frames(self, piece: int) -> NDArray[np.float16]:
        if piece not in self._mapped:
            file = self.pieces[piece]
            wrong = size_fault(self.lake, file)
            if wrong is not None:
                raise DamagedError(damage(self.lake, file, wrong))
            with self.lake.path(file).open("rb") as handle:
                self._maps[piece] = mmap(handle.fileno(), 0, access=ACCESS_READ)
            self._mapped[piece] = np.frombuffer(self._maps[piece], HALF).reshape(-1, self._width)
        return self._mapped[piece]

    def _expect(self, pieces: Int64Array, starts: Int64Array, counts: Int64Array) -> None:
        """Let the system read the frames of some clips from the disk all at once, not one after another."""
        size = HALF.itemsize * self._width
        for piece, start, count in zip(pieces.tolist(), starts.tolist(), counts.tolist(), strict=True):
            if count:
                self._frames(piece)
                first = start * size // PAGESIZE * PAGESIZE
                self._maps[piece].madvise(MADV_WILLNEED, first, (start + count) * size - first)

    @cached_property
    def _maps(self) -> dict[int, mmap]:
        return {}

    @property
    def _width(self) -> int:
        """D, numbers of a frame of moves."""
        return int(self.arrays["outlines-directions"].shape[0])

    @cached_property
    def _mapped(self) -> dict[int, NDArray[np.float16]]:
        return {}


def said_of(table: pa.Table) -> dict[str, str]:
    """What a table of clips says of itself."""
    return {name.decode(): value.decode() for name, value in (table.schema.metadata or {}).items()}


def read_clips(lake: Lake, files: Sequence[str]) -> pa.Table:
    """The table of clips alone. Raises `DamagedError` where it is not as it was written."""
    (path,) = sound_files(lake, [file for file in files if file.endswith(CLIPS)])
    return pa.ipc.open_file(pa.memory_map(str(path))).read_all()


def _name(file: str) -> str:
    return Path(file).stem.partition("-")[2]
