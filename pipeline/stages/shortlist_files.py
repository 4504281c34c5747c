"""The files of the shortlist of a lake: arrays that are mapped into memory; a search reads of them what it needs.

All but pieces (`motionlake.stages.shortlist_pieces`) are compared with what was written before they are read.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from threading import Lock
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.columns import numbers
from motionlake.errors import UserError
from motionlake.lake.file_list import FileSums
from motionlake.lake.integrity import sound_files
from motionlake.lake.layout import Lake
from motionlake.lake.parts import replacing
from motionlake.motion.moves import WIDTH
from motionlake.motion.skeleton import COMMON
from motionlake.motion.sketches import Directions, Sketches, instants
from motionlake.stages.shortlist_pieces import Kind, Pieces
from numpy.typing import NDArray

WHOLE: Final = 2000  # clips of a lake up to which a search compares all of them
MOST: Final = 20_000  # clips of a lake up to which it has a neighbour graph, and pieces are looked for in all of them
FOLDER: Final = "shortlist"
CLIPS: Final = "clips.arrow"
HALF: Final = np.dtype("<f2")
MOVES: Final = Kind("moves", ".f16", ("piece", "start", "frames", "crc32"), np.dtype((HALF, (WIDTH,))))
POSTURES: Final = Kind(
    "postures", ".codes", ("postures_piece", "postures_start", "postures", "postures_crc32"), np.dtype("<i4")
)
JOINTS: Final = Kind(
    "joints", ".joints", ("joints_piece", "joints_start", "joints", "joints_crc32"),
    np.dtype(("<f4", (3 * len(COMMON),))),
)  # fmt: skip
PIECES: Final = (MOVES.suffix, POSTURES.suffix, JOINTS.suffix)
INSTANTS: Final = 12  # of the moves of a clip, for its sketch
CODES: Final = 16  # of its postures
WIDTHS: Final[Mapping[str, int]] = {"signature": 32, "alignment": 64, "moves": 64}  # of sketches, by method
LISTS: Final[Mapping[str, tuple[str, ...]]] = {  # of each clip, that a method compares
    "signature": ("motifs", "weights"), "alignment": ("symbols",), "moves": (),
}  # fmt: skip
SHORT: Final = np.iinfo(np.uint16)
SAMPLE: Final = 2048  # clips that directions are fitted to


def file_of(key: str, name: str) -> str:
    """A file of the shortlist with a key, relative to the lake."""
    return f"{FOLDER}/{key[:16]}-{name}"


def is_of_windows(file: str) -> bool:
    """Whether a search of pieces alone reads it (`motionlake.stages.shortlist_windows`)."""
    return _name(file).startswith("windows")


def is_of_moves(file: str) -> bool:
    """Whether it holds moves (`motionlake.stages.shortlist_moves`)."""
    return _name(file).startswith("moves")


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
        columns: of the table of clips, numbers.
        files: all that it consists of.
        said: what the table says of it.
        sums: of those files that were there before.
    """

    columns: Mapping[str, Any]
    files: Sequence[str]
    said: Mapping[str, str] = field(default_factory=dict)
    sums: Sequence[FileSums] = ()


def no_sketches(clips: int, directions: Directions) -> Float32Array:
    """[clips, w] sketches of clips that a method does not know."""
    return np.full((clips, directions.matrix.shape[1]), np.nan, dtype=np.float32)


def write_sketches(lake: Lake, key: str, name: str, vectors: Float32Array) -> list[str]:
    """Write sketches [n, w], of numbers where a method knows a clip; returns the names of their files."""
    known = np.asarray(np.isfinite(vectors).all(axis=1))
    made = Sketches.of(np.where(known[:, None], vectors, np.float32(0)), known)
    return [write_array(lake, key, f"{name}-{part}", values) for part, values in vars(made).items()]


def write_array(lake: Lake, key: str, name: str, values: NDArray[Any]) -> str:
    """Write an array; returns the name of its file."""
    file = file_of(key, f"{name}.npy")
    with replacing(lake.path(file)) as temporary, temporary.open("wb") as handle:
        np.save(handle, np.ascontiguousarray(values), allow_pickle=False)
    return file


def mapped_array(path: Path) -> NDArray[Any]:
    """An array of a file, mapped into memory; one thread at a time reads what kind it is.

    NumPy has Python parse that, whose parser once failed among threads (SystemError).
    """
    with _parsing:
        found: NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False)
    return found


_parsing: Final = Lock()


def lists_named(name: str) -> tuple[str, str]:
    """The arrays that lists are kept in: values one after another, and where those of each clip begin."""
    return f"{name}-values", f"{name}-starts"


def needed_by(methods: Collection[str]) -> list[str]:
    """The arrays that some methods read in every search."""
    lists = [array for method in methods for name in LISTS[method] for array in lists_named(name)]
    return [*(f"{method}-{part.name}" for method in methods for part in fields(Sketches)), *lists]


def write_lists(lake: Lake, key: str, counts: Int64Array, lists: Mapping[str, NDArray[Any]]) -> list[str]:
    """Write lists of n clips, by name: values one after another, so many of each clip; returns the names of files.

    Whole numbers that 16 bits hold are written in these.
    """
    starts, files = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)]), []
    for name, values in lists.items():
        short = values.dtype.kind in "iu" and (not values.size or (values.min() >= 0 and values.max() <= SHORT.max))
        arrays = values.astype(SHORT.dtype) if short else values, starts
        files += [write_array(lake, key, *named) for named in zip(lists_named(name), arrays, strict=True)]
    return files


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
class ShortlistFiles:
    """What the stage has made of n clips; of its files those that are asked for are read.

    Attributes:
        lake: which holds it.
        table: [n] clip, part, and where in pieces each clip lies.
        models: what signatures and strings are made over, by method.
        files: that it consists of.
    """

    lake: Lake
    table: pa.Table
    models: Mapping[str, str]
    files: Sequence[str]

    @staticmethod
    def open(lake: Lake, files: Sequence[str], needed: Collection[str] = ()) -> ShortlistFiles:
        """The files, and those arrays that are `needed` at once.

        Raises:
            DamagedError: a file is not as it was written.
        """
        own = [file for file in files if not (file.endswith(PIECES) or is_of_windows(file))]
        sound_files(lake, [file for file in own if _name(file) in needed])  # together with the table
        table = read_clips(lake, files)
        said = said_of(table)
        models = {method: said[method] for method in WIDTHS if method in said}
        return ShortlistFiles(lake, table, models, files)

    def array(self, name: str) -> NDArray[Any]:
        """An array by its name, mapped into memory.

        Raises:
            DamagedError: its file is not as it was written.
            KeyError: there is none such.
        """
        if name not in self._arrays:
            (path,) = sound_files(self.lake, [self._named[name]])
            self._arrays[name] = mapped_array(path)
        return self._arrays[name]

    @cached_property
    def _arrays(self) -> dict[str, NDArray[Any]]:
        return {}

    @cached_property
    def _named(self) -> dict[str, str]:
        """The file of each array."""
        return {_name(file): file for file in self.files if file.endswith(".npy") and not is_of_windows(file)}

    @property
    def methods(self) -> tuple[str, ...]:
        return tuple(name for name in WIDTHS if f"{name}-directions" in self._named)

    def sketches(self, name: str) -> Sketches:
        """Those of a method. Raises `DamagedError` as `array`."""
        parts = [f"{name}-{part.name}" for part in fields(Sketches)]
        if parts[0] in self._named:
            return Sketches(*map(self.array, parts))
        vectors = self.array(f"{name}-sketches")  # an earlier version kept them as they are, and norms beside them
        return Sketches.of(vectors[:, :-1], np.isfinite(vectors[:, -1]))

    def directions(self, name: str) -> Directions:
        return Directions(self.array(f"{name}-mean"), self.array(f"{name}-directions"))

    def has(self, name: str) -> bool:
        """Whether it keeps such lists; earlier versions lack some."""
        return lists_named(name)[0] in self._named or name in self.table.column_names

    def numbers(self, name: str) -> NDArray[Any]:
        """[n] a column of numbers."""
        return numbers(self.table[name])

    def lists(self, name: str, rows: Int64Array) -> list[NDArray[Any]]:
        """A list of each clip, those of some rows."""
        values, starts = self.flat(name)
        return [values[starts[row] : starts[row + 1]] for row in rows.tolist()]

    def joined(self, name: str, rows: Int64Array) -> tuple[NDArray[Any], Int64Array]:
        """The same one after another, and how long each is."""
        values, starts = self.flat(name)
        lengths = starts[rows + 1] - starts[rows]
        first = np.repeat(starts[rows] - np.cumsum(lengths) + lengths, lengths)
        return values[first + np.arange(len(first))], lengths

    def flat(self, name: str) -> tuple[NDArray[Any], Int64Array]:
        """The same of all clips, and [n + 1] where those of each begin."""
        values, starts = lists_named(name)
        if values in self._named:
            return self.array(values), self.array(starts)
        (chunk,) = self.table[name].chunks  # an earlier version kept them in the table
        return np.from_dlpack(chunk.values), np.asarray(np.from_dlpack(chunk.offsets), dtype=np.int64)

    def lacks(self, row: int, what: str) -> UserError:
        """The error for a clip of which a method has nothing."""
        return UserError(f"{self.table['clip'][row].as_py()}: has no {what} yet; make it with `motionlake run all`")

    @cached_property
    def moves(self) -> Pieces:
        """The moves of clips."""
        return Pieces(self.lake, self.files, self.table, MOVES)

    @cached_property
    def postures(self) -> Pieces | None:
        """The codes of the frames of clips; None where an earlier version made the shortlist."""
        return self._pieces(POSTURES)

    @cached_property
    def joints(self) -> Pieces | None:
        """The joints that moves are of; as `postures`."""
        return self._pieces(JOINTS)

    def _pieces(self, kind: Kind) -> Pieces | None:
        there = kind.columns[0] in self.table.column_names
        return Pieces(self.lake, self.files, self.table, kind) if there else None


def said_of(table: pa.Table) -> dict[str, str]:
    """What a table of clips says of itself."""
    return {name.decode(): value.decode() for name, value in (table.schema.metadata or {}).items()}


def read_clips(lake: Lake, files: Sequence[str]) -> pa.Table:
    """The table of clips alone. Raises `DamagedError` where it is not as it was written."""
    (path,) = sound_files(lake, [file for file in files if file.endswith(CLIPS)])
    return pa.ipc.open_file(pa.memory_map(str(path))).read_all()


def _name(file: str) -> str:
    return Path(file).stem.partition("-")[2]
