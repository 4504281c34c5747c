"""The moves in a shortlist as it was: of clips that stay they are taken over, and those of others are read.

They are much of what is read and written for a shortlist.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import compress
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Int64Array
from motionlake.lake.layout import Lake
from motionlake.motion.moves import KIND
from motionlake.stages.shortlist_files import MOVE_PIECES, read_clips, said_of
from motionlake.stages.shortlist_pieces import RowPlaces, serving

GROWN: Final = 1.5  # times as many clips as directions were fitted to; of more they are fitted anew
FITTED: Final = "fitted"  # names in what a table of clips says of itself
READ: Final = "read"
FRAMES: Final = "pieces"


@dataclass(frozen=True)
class Before:
    """What of a shortlist's moves still serves.

    Attributes:
        files: it consists of, but for the pieces that go on serving.
        pieces: that go on serving, and the frames of each.
        old: [m] rows that it gave to the clips that stay.
        new: [m] rows that these have today.
        fitted: clips that its directions were fitted to.
    """

    files: list[str]
    pieces: dict[str, int]
    old: Int64Array
    new: Int64Array
    fitted: int

    @staticmethod
    def of(lake: Lake, files: Sequence[str], version: int, clips: pa.Table, moves: Mapping[str, str]) -> Before | None:
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
        known = set(json.loads(said[READ]))
        rows = {pair: row for row, pair in enumerate(_pairs(table))}
        staying = [
            (rows[pair], row) for row, pair in enumerate(_pairs(clips)) if pair in rows and moves.get(pair[1]) in known
        ]
        old, new = np.array(staying, dtype=np.int64).reshape(-1, 2).T
        written = json.loads(said[FRAMES])
        kept = serving(written, RowPlaces.of(table, MOVE_PIECES), old, len(clips) - len(staying))
        if not kept:
            return None
        pieces = MOVE_PIECES.among(files)[:kept]
        rest = [file for file in files if file not in pieces]
        return Before(rest, dict(zip(pieces, written, strict=False)), old, new, int(said[FITTED]))

    def to_read(self, clips: pa.Table, moves: Mapping[str, str]) -> list[str]:
        """The files of moves that hold clips which do not stay."""
        others = np.ones(len(clips), dtype=np.bool_)
        others[self.new] = False
        parts = dict.fromkeys(compress(clips["part"].to_pylist(), others))
        return [moves[part] for part in parts if part in moves]


def said_of_moves(version: int, fitted: int, read: Sequence[str], pieces: Sequence[int]) -> dict[str, str]:
    """What a table of clips says of the moves in the shortlist: for how many clips they were made along these
    directions, of which files of moves, and of how many frames each piece is."""
    return {
        "version": str(version), FITTED: str(fitted), READ: json.dumps(sorted(read)), FRAMES: json.dumps(list(pieces)),
    }  # fmt: skip


def _pairs(table: pa.Table) -> list[tuple[Any, Any]]:
    return list(zip(table["clip"].to_pylist(), table["part"].to_pylist(), strict=True))
