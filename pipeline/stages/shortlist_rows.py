"""Rows of parts that the shortlist of a large lake holds as they are: postures, and joints of moves.

A search reads those of some clips, each of which would be in another part. Those of clips that stay as they were are
taken over.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import pyarrow as pa
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.stages import shortlist_files
from motionlake.stages.moves import MOVES, read_joints
from motionlake.stages.postures import POSTURES, read_codes
from motionlake.stages.reader import LakeReader
from motionlake.stages.shortlist_before import (
    NextPiece,
    Staying,
    as_named,
    files_by_part,
    named,
    rows_by_file,
    staying,
)
from motionlake.stages.shortlist_files import CLIPS, Made, Places, read_clips, said_of
from motionlake.stages.shortlist_pieces import Kind, RowPlaces
from motionlake.stages.stage import PartStage, Shard
from numpy.typing import NDArray

LAYOUT: Final = 1


@dataclass(frozen=True)
class Rows:
    """What is copied of the parts of a stage.

    Attributes:
        kind: of the pieces that they go to.
        stage: whose parts hold them.
        read: gives (clip, rows) of every clip of a part.
        models: what they are made over, beside the stage's version.
    """

    kind: Kind
    stage: PartStage
    read: Callable[[Path], Iterator[tuple[str, NDArray[Any]]]]
    models: Callable[[Connection], Sequence[str]]

    @property
    def name(self) -> str:
        """What it is called in the specs of shards."""
        return self.kind.name

    def of_parts(self, at: LakeReader) -> dict[str, str]:
        """What the stage made of every frames part of the lake as it stands."""
        return {part.part: self.stage.file(part.key) for part in self.stage.made(at)}

    def to_read(self, at: LakeReader, there: Sequence[str], clips: pa.Table) -> dict[str, Any]:
        """What a shard reads of [n] clip and part: of the shortlist with some files what serves on, and parts."""
        files = self.of_parts(at)
        own = [file for file in there if file.endswith((CLIPS, self.kind.suffix))]
        before = self._before(at.lake, own, self._told(at.con), clips)
        if before is None:
            return {self.name: files}
        return {self.name: files_by_part(files, clips, before.others(len(clips))), **as_named(self.name, own, before)}

    def of_clips(self, at: LakeReader, shard: Shard, clips: pa.Table, places: Places) -> Made:
        """Those of all clips: of [n] clip and part. The shard says what is read, as `to_read` does."""
        told, there = self._told(at.con), named(shard.spec, self.name)
        before = self._before(at.lake, there, told, clips)
        with NextPiece(at, shard.key, self.kind, len(places), before) as piece:
            if before is not None:
                piece.take_over(before, read_clips(at.lake, there), there)
            for file, wanted in rows_by_file(shard.spec[self.name], clips, piece.others).items():
                for clip, own in self.read(sound(at.lake, file)):
                    if clip in wanted:
                        piece.add(wanted[clip], own.astype(self.kind.row.base, copy=False))
        made, written = piece.made()
        return replace(made, said={self.name: told, self._written: json.dumps(written)})

    @property
    def _written(self) -> str:
        return f"{self.name} written"

    def _told(self, con: Connection) -> str:
        """What the rows of the lake are told by: those of another kind are read anew."""
        return json.dumps([LAYOUT, self.stage.version, *self.models(con)])

    def _before(self, lake: Lake, files: Sequence[str], told: str, clips: pa.Table) -> Staying | None:
        if not files:
            return None
        table = read_clips(lake, files)
        said = said_of(table)
        if said.get(self.name) != told:
            return None
        held = RowPlaces.of(table, self.kind).count
        written = json.loads(said[self._written])
        return staying(table, clips, self.kind, files, written, lambda old, _: held[old] > 0)


def _dictionary(con: Connection) -> list[str]:
    return [row["model"] for row in fetch(con, "models_compared") if row["method"] == "alignment"]


ROWS: Final = (
    Rows(shortlist_files.POSTURES, POSTURES, read_codes, _dictionary),
    Rows(shortlist_files.JOINTS, MOVES, read_joints, lambda _: ()),
)
