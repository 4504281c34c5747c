"""Pieces of a shortlist: files of rows of numbers, one clip after another, of which a search reads those of some clips.

They are large, so each clip has a checksum of its own, which the table of clips keeps. They are several, so that the
rows of clips that come need not be written together with all others: rows of a few clips make a piece of their own,
into which small pieces before it go.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from mmap import ACCESS_READ, MADV_WILLNEED, PAGESIZE, mmap
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Int64Array
from motionlake.columns import numbers
from motionlake.errors import DamagedError
from motionlake.lake.integrity import OTHER_BYTES, damage, size_fault
from motionlake.lake.layout import Lake
from motionlake.lake.parts import replacing
from numpy.typing import NDArray

CHECKED: Final = 1000  # clips whose rows are compared at a time
SERVING: Final = 2 / 3  # share of the rows of all pieces that clips of today must have
AS_SMALL: Final = 2.0  # times as many clips as are written: a last piece of no more is written anew with them


@dataclass(frozen=True)
class Kind:
    """What pieces hold.

    Attributes:
        name: how the names of the files begin, as in "moves.f16", "moves-1.f16".
        suffix: how they end.
        columns: of the table of clips: the piece, the first row in it, how many rows, their CRC-32.
        row: what a row is.
    """

    name: str
    suffix: str
    columns: tuple[str, str, str, str]
    row: np.dtype[Any]

    def file(self, number: int) -> str:
        """How the name of a piece ends, from 0."""
        return f"{self.name}-{number}{self.suffix}" if number else f"{self.name}{self.suffix}"

    def among(self, files: Sequence[str]) -> list[str]:
        """Those of a shortlist's files that are such pieces, by number."""
        own = (file for file in files if file.endswith(self.suffix))
        return sorted(own, key=lambda file: (len(_name(file)), _name(file)))  # by number, whatever their keys


@dataclass(frozen=True)
class RowPlaces:
    """Where the rows of n clips lie: of which piece, from which row, how many, and their checksum."""

    piece: NDArray[np.int32]
    start: NDArray[np.int64]
    count: NDArray[np.int32]
    crc32: NDArray[np.uint32]

    @staticmethod
    def empty(clips: int) -> RowPlaces:
        piece, count = np.zeros(clips, dtype=np.int32), np.zeros(clips, dtype=np.int32)
        return RowPlaces(piece, np.zeros(clips, dtype=np.int64), count, np.zeros(clips, dtype=np.uint32))

    @staticmethod
    def of(table: pa.Table, kind: Kind) -> RowPlaces:
        """As a table of clips keeps them; earlier versions wrote one piece of moves alone."""
        piece, *rest = kind.columns
        there = piece in table.column_names
        pieces = numbers(table[piece]) if there else np.zeros(len(table), dtype=np.int32)
        return RowPlaces(pieces, *(numbers(table[name]) for name in rest))

    def columns(self, kind: Kind) -> dict[str, NDArray[Any]]:
        """Of the table of clips."""
        return dict(zip(kind.columns, (self.piece, self.start, self.count, self.crc32), strict=True))

    def take(self, rows: Int64Array, other: RowPlaces, others: Int64Array) -> None:
        """Write those of some rows of another table."""
        for name in ("piece", "start", "count", "crc32"):
            getattr(self, name)[rows] = getattr(other, name)[others]


class PieceWriter:
    """Writes a piece.

    Args:
        lake: to write to.
        file: relative to it.
        number: of the piece.
        places: told where the rows of a clip lie.
    """

    def __init__(self, lake: Lake, file: str, number: int, places: RowPlaces) -> None:
        self._path, self.file = lake.path(file), file
        self._number, self._places, self.written = number, places, 0
        self._stack = ExitStack()

    def __enter__(self) -> PieceWriter:
        temporary = self._stack.enter_context(replacing(self._path))
        self._handle: BinaryIO = self._stack.enter_context(temporary.open("wb"))
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.__exit__(*error)  # type: ignore[arg-type]

    def add(self, clip: int, rows: NDArray[Any]) -> None:
        """The rows of a clip, by its row in the table."""
        data, places = rows.tobytes(), self._places
        self._handle.write(data)
        places.piece[clip], places.start[clip], places.count[clip] = self._number, self.written, len(rows)
        places.crc32[clip] = zlib.crc32(data)
        self.written += len(rows)


class Pieces:
    """Pieces to read; a file is mapped when a clip of it is asked for.

    Args:
        lake: the lake.
        files: of a shortlist.
        table: of its clips.
        kind: of the pieces.
    """

    def __init__(self, lake: Lake, files: Sequence[str], table: pa.Table, kind: Kind) -> None:
        self._lake, self._files, self._row = lake, kind.among(files), kind.row
        self._places = RowPlaces.of(table, kind)
        self._maps: dict[int, mmap] = {}
        self._mapped: dict[int, NDArray[Any]] = {}

    def of(self, clips: Int64Array) -> list[NDArray[Any]]:
        """The rows of some clips. Raises `DamagedError` as `where` does."""
        pieces, piece, starts, counts = self.where(clips)
        places = zip(piece.tolist(), starts.tolist(), counts.tolist(), strict=True)
        return [pieces[at][start : start + count] for at, start, count in places]

    def where(self, clips: Int64Array) -> tuple[list[NDArray[Any]], Int64Array, Int64Array, Int64Array]:
        """Pieces, and of each of some clips in which of them it lies, from which row on, and how many rows.

        Args:
            clips: by their rows in the table.

        Raises:
            DamagedError: those of these clips are not as they were written.
        """
        self._check(clips)
        places = self._places
        used, piece = np.unique(places.piece[clips], return_inverse=True)
        pieces = [self._rows(own) for own in used.tolist()]
        return pieces, piece, places.start[clips], places.count[clips].astype(np.int64)

    def check_all(self) -> None:
        """Compare the rows of all clips with what was written, which maps them into memory: searches find that done.

        Raises:
            DamagedError: as `where`.
        """
        count = len(self._places.count)
        for first in range(0, count, CHECKED):
            self._check(np.arange(first, min(first + CHECKED, count)))

    def _check(self, clips: Int64Array) -> None:
        new = clips[~self._sound[clips]]
        places = self._places
        numbers = [each[new].tolist() for each in (places.piece, places.start, places.count, places.crc32)]
        self._expect(*numbers[:3])
        for piece, start, count, wanted in zip(*numbers, strict=True):
            if zlib.crc32(self._rows(piece)[start : start + count].view(np.uint8).data) != wanted:
                raise DamagedError(damage(self._lake, self._files[piece], OTHER_BYTES))
        self._sound[new] = True

    @cached_property
    def _sound(self) -> NDArray[np.bool_]:
        """[n] clips whose rows were compared with what was written."""
        return np.zeros(len(self._places.count), dtype=np.bool_)

    def _rows(self, piece: int) -> NDArray[Any]:
        if piece not in self._mapped:
            file = self._files[piece]
            wrong = size_fault(self._lake, file)
            if wrong is not None:
                raise DamagedError(damage(self._lake, file, wrong))
            with self._lake.path(file).open("rb") as handle:
                self._maps[piece] = mmap(handle.fileno(), 0, access=ACCESS_READ)
            self._mapped[piece] = np.frombuffer(self._maps[piece], self._row)
        return self._mapped[piece]

    def _expect(self, pieces: Sequence[int], starts: Sequence[int], counts: Sequence[int]) -> None:
        """Let the system read the rows of some clips from the disk all at once, not one after another."""
        size = self._row.itemsize
        for piece, start, count in zip(pieces, starts, counts, strict=True):
            if count:
                self._rows(piece)
                first = start * size // PAGESIZE * PAGESIZE
                self._maps[piece].madvise(MADV_WILLNEED, first, (start + count) * size - first)


def serving(written: Sequence[int], places: RowPlaces, staying: Int64Array, coming: int) -> int:
    """How many of the pieces that there are go on serving, the first ones; 0 where all must be written anew.

    Args:
        written: rows of each piece.
        places: where the rows of clips lie.
        staying: clips that stay as they were, by row.
        coming: clips that are to be written.
    """
    counts = places.count[staying]
    if not written or counts.sum() < SERVING * sum(written):
        return 0
    own = np.bincount(places.piece[staying][counts > 0], minlength=len(written))
    kept = len(written)
    while kept > 1 and own[kept - 1] <= AS_SMALL * coming:
        kept -= 1
        coming += int(own[kept])
    return kept


def _name(file: str) -> str:
    return Path(file).stem.partition("-")[2]
