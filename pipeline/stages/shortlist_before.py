"""What a shortlist as it was holds of clips that stay: it is taken over, and that of others is read."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import BoolArray, Int64Array
from motionlake.columns import column_of, numbers
from motionlake.lake.file_list import listed_in
from motionlake.lake.layout import Lake
from motionlake.motion.moves import KIND
from motionlake.stages.reader import LakeReader
from motionlake.stages.shortlist_files import MOVES as PIECES
from motionlake.stages.shortlist_files import Made, file_of, read_clips, said_of
from motionlake.stages.shortlist_pieces import Kind, Pieces, PieceWriter, RowPlaces, serving

GROWN: Final = 1.5  # times as many clips as directions were fitted to; of more they are fitted anew
FITTED: Final = "fitted"  # names in what a table of clips says of itself
READ: Final = "read"
FRAMES: Final = "pieces"


@dataclass(frozen=True)
class Staying:
    """Clips whose rows in pieces serve on.

    Attributes:
        old: [m] rows that the shortlist gave to these clips.
        new: [m] rows that they have today.
        pieces: that go on serving, and the rows of each.
    """

    old: Int64Array
    new: Int64Array
    pieces: Mapping[str, int]

    def others(self, clips: int) -> BoolArray:
        """[n] which of n clips of today do not stay."""
        found = np.ones(clips, dtype=np.bool_)
        found[self.new] = False
        return found


def staying(
    table: pa.Table, clips: pa.Table, kind: Kind, files: Sequence[str], written: Sequence[int],
    still: Callable[[Int64Array, Int64Array], BoolArray],
) -> Staying | None:  # fmt: skip
    """The clips that stay; None where so few do that all must be written anew.

    Args:
        table: of the clips of a shortlist as it was.
        clips: [n] clip and part of today, by row.
        kind: of its pieces.
        files: it consists of.
        written: rows of each piece.
        still: of clips in the same part as then, by their rows then and today, whether what it has is what they would
            be given.
    """
    old, new = same_rows(table, clips)
    same = still(old, new)
    old, new = old[same], new[same]
    kept = serving(written, RowPlaces.of(table, kind), old, len(clips) - len(old))
    return Staying(old, new, dict(zip(kind.among(files)[:kept], written, strict=False))) if kept else None


def same_rows(table: pa.Table, clips: pa.Table) -> tuple[Int64Array, Int64Array]:
    """[m] rows of a table of clip and part that have the same in another, and [m] the rows there, which grow."""
    from pyarrow import compute

    at = compute.index_in(clips["clip"], value_set=table["clip"].combine_chunks())
    known = numbers(compute.fill_null(at, -1)).astype(np.int64)
    new = np.flatnonzero(known >= 0)
    old = known[new]
    alike = compute.equal(table["part"].take(column_of(old)), clips["part"].take(column_of(new)))
    same = numbers(alike.cast(pa.int8())) > 0
    return old[same], new[same]


def files_by_part(files: Mapping[str, str], clips: pa.Table, others: BoolArray) -> dict[str, str]:
    """Of the files of parts those that hold some of [n] clip and part."""
    wanted = dict.fromkeys(clips["part"].take(column_of(np.flatnonzero(others))).to_pylist())
    return {part: files[part] for part in wanted if part in files}


def rows_by_file(files: Mapping[str, str], clips: pa.Table, others: BoolArray) -> dict[str, dict[str, int]]:
    """The rows of some clips, by name, of the file of each part: one may hold more, which are other parts' by now."""
    found: dict[str, dict[str, int]] = {}
    rows = np.flatnonzero(others)
    some = clips.take(column_of(rows))
    for row, clip, part in zip(rows.tolist(), some["clip"].to_pylist(), some["part"].to_pylist(), strict=True):
        if part in files:
            found.setdefault(files[part], {})[clip] = row
    return found


def as_named(what: str, files: Sequence[str], found: Staying) -> dict[str, Any]:
    """How the spec of a shard names the files of a shortlist that it takes something over from: pieces that go on
    serving are not read, so they are keys, which no worker is given."""
    return {f"{what} before": [file for file in files if file not in found.pieces], f"{what} kept": found.pieces}


def named(spec: Mapping[str, Any], what: str) -> list[str]:
    """The same files; none where nothing is taken over."""
    return [*spec.get(f"{what} before", ()), *spec.get(f"{what} kept", ())]


class NextPiece:
    """The piece that a shortlist writes beside those that go on serving, and where the rows of its n clips lie.

    Args:
        at: the lake.
        key: of the shard.
        kind: of the piece.
        clips: n.
        before: what serves on; None: all is written.

    Attributes:
        add: takes the rows of a clip.
        others: [n] the clips that do not stay.
    """

    def __init__(self, at: LakeReader, key: str, kind: Kind, clips: int, before: Staying | None) -> None:
        self._at, self._kind, self._serve = at, kind, {} if before is None else before.pieces
        self._places, number = RowPlaces.empty(clips), len(self._serve)
        self.others = np.ones(clips, dtype=np.bool_) if before is None else before.others(clips)
        self._writer = PieceWriter(at.lake, file_of(key, kind.file(number)), number, self._places)
        self.add = self._writer.add

    def __enter__(self) -> NextPiece:
        self._writer.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self._writer.__exit__(*error)

    def take_over(self, found: Staying, table: pa.Table, files: Sequence[str]) -> None:
        """Say where the rows of the clips that stay lie, given the table and the files of the shortlist that has them;
        what lies in pieces that do not go on serving is written."""
        places = self._places
        places.take(found.new, RowPlaces.of(table, self._kind), found.old)
        moved = (places.count[found.new] > 0) & (places.piece[found.new] >= len(found.pieces))
        olds, clips = found.old[moved], found.new[moved]
        rows = Pieces(self._at.lake, files, table, self._kind).of(olds) if len(olds) else ()
        for clip, held in zip(clips.tolist(), rows, strict=True):
            self.add(clip, held)

    def made(self) -> tuple[Made, list[int]]:
        """Once it is written: all pieces and the places of rows in them; how many rows each has."""
        pieces = {**self._serve, self._writer.file: self._writer.written}
        if not self._writer.written:
            self._at.lake.path(self._writer.file).unlink()
            del pieces[self._writer.file]
        listed = listed_in(self._at.con) if self._serve else {}
        made = Made(self._places.columns(self._kind), list(pieces), {}, [listed[file] for file in self._serve])
        return made, list(pieces.values())


@dataclass(frozen=True)
class MovesBefore(Staying):
    """What of a shortlist's moves still serves.

    Attributes:
        fitted: clips that its directions were fitted to.
    """

    fitted: int

    @staticmethod
    def of(
        lake: Lake, files: Sequence[str], version: int, clips: pa.Table, moves: Mapping[str, str]
    ) -> MovesBefore | None:
        """What serves of a shortlist; None where all must be made anew.

        Args:
            lake: the lake.
            files: of the shortlist.
            version: of the stage that must have made it.
            clips: [n] clip and part of today, by row.
            moves: the file of moves of each frames part of today.

        Raises:
            DamagedError: its table is not as it was written.
        """
        table = read_clips(lake, files)
        said = said_of(table)
        if said.get("version") != str(version) or said.get("moves") != KIND or FITTED not in said:
            return None
        if len(clips) > GROWN * int(said[FITTED]):
            return None
        known, parts = set(json.loads(said[READ])), clips["part"].combine_chunks().dictionary_encode()
        read = np.array([moves.get(part) in known for part in parts.dictionary.to_pylist()], dtype=np.bool_)

        def still(_: Int64Array, new: Int64Array) -> BoolArray:
            found: BoolArray = read[numbers(parts.indices)[new]]
            return found

        found = staying(table, clips, PIECES, files, json.loads(said[FRAMES]), still)
        return None if found is None else MovesBefore(found.old, found.new, found.pieces, int(said[FITTED]))


def said_of_moves(version: int, fitted: int, read: Sequence[str], pieces: Sequence[int]) -> dict[str, str]:
    """What a table of clips says of the moves in the shortlist: for how many clips they were made along these
    directions, of which files of moves, and of how many frames each piece is."""
    return {
        "version": str(version), FITTED: str(fitted), READ: json.dumps(sorted(read)), FRAMES: json.dumps(list(pieces)),
    }  # fmt: skip
