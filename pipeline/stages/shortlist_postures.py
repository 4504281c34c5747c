"""The postures of a large lake's clips in its shortlist, by which answers of alignment are told in frames.

A search reads those of ten clips; each would be in another part of stage "postures". Those of clips that stay as they
were are taken over.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.integrity import listed_in, sound
from motionlake.lake.layout import Lake
from motionlake.stages.postures import POSTURES, read_codes
from motionlake.stages.reader import LakeReader
from motionlake.stages.shortlist_before import (
    Staying,
    as_named,
    files_by_part,
    named,
    rows_by_file,
    staying,
    take_over,
)
from motionlake.stages.shortlist_files import (
    CLIPS,
    CODE,
    POSTURE_PIECES,
    Made,
    Places,
    file_of,
    read_clips,
    said_of,
)
from motionlake.stages.shortlist_pieces import Pieces, PieceWriter, RowPlaces, pieces_left
from motionlake.stages.stage import Shard

SAID: Final = "postures"  # names in what a table of clips says of itself
WRITTEN: Final = "postures written"
LAYOUT: Final = 1


def postures_to_read(at: LakeReader, there: Sequence[str], clips: pa.Table) -> dict[str, Any]:
    """What a shard of a lake reads of [n] clip and part: of the shortlist with some files what serves on, and parts."""
    files = postures_of_parts(at)
    own = [file for file in there if file.endswith((CLIPS, POSTURE_PIECES.suffix))]
    before = _before(at.lake, own, _kind_of(at.con), clips)
    if before is None:
        return {"postures": files}
    return {"postures": files_by_part(files, clips, before.others(len(clips))), **as_named("postures", own, before)}


def postures_of_parts(at: LakeReader) -> dict[str, str]:
    """The coded frames of every frames part of the lake as it stands."""
    return {part.part: POSTURES.file(part.key) for part in POSTURES.made(at)}


def postures_of_clips(at: LakeReader, shard: Shard, clips: pa.Table, places: Places) -> Made:
    """Those of all clips: of [n] clip and part. The shard says what is read, as `postures_to_read` does."""
    kind, there = _kind_of(at.con), named(shard.spec, "postures")
    before, held = _before(at.lake, there, kind, clips), RowPlaces.empty(len(places))
    serve = {} if before is None else before.pieces
    others = np.ones(len(clips), dtype=np.bool_) if before is None else before.others(len(clips))
    number = len(serve)
    with PieceWriter(at.lake, file_of(shard.key, POSTURE_PIECES.file(number)), number, held) as writer:
        if before is not None:
            old = RowPlaces.of(read_clips(at.lake, there), POSTURE_PIECES)
            rows = Pieces(at.lake, POSTURE_PIECES.among(there), old, CODE)
            take_over(before, old, rows, held, writer)
        for file, wanted in rows_by_file(shard.spec["postures"], clips, others).items():
            for clip, codes in read_codes(sound(at.lake, file)):
                if clip in wanted:
                    writer.add(wanted[clip], codes.astype(CODE))
    pieces, listed = pieces_left(at.lake, serve, writer), listed_in(at.con) if serve else {}
    said = {SAID: kind, WRITTEN: json.dumps(list(pieces.values()))}
    return Made(held.columns(POSTURE_PIECES), list(pieces), said, [listed[file] for file in serve])


def _kind_of(con: Connection) -> str:
    """What the postures of the lake are told by: those of another dictionary do not compare."""
    models = [row["model"] for row in fetch(con, "models_compared") if row["method"] == "alignment"]
    return json.dumps([LAYOUT, POSTURES.version, *models])


def _before(lake: Lake, files: Sequence[str], kind: str, clips: pa.Table) -> Staying | None:
    if not files:
        return None
    table = read_clips(lake, files)
    said = said_of(table)
    if said.get(SAID) != kind:
        return None
    held = RowPlaces.of(table, POSTURE_PIECES).count
    return staying(table, clips, POSTURE_PIECES, files, json.loads(said[WRITTEN]), lambda row, _: bool(held[row]))
