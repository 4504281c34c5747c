"""What the shortlist of a large lake holds of moves: sketches, and the frames in half precision."""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from dataclasses import replace
from itertools import compress
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array, Int64Array
from motionlake.lake.layout import Lake
from motionlake.motion.moves import WIDTH
from motionlake.motion.sketches import Directions, instants
from motionlake.stages.moves import MOVES, joints_in, tracks_in
from motionlake.stages.reader import LakeReader
from motionlake.stages.shortlist_before import (
    MovesBefore,
    NextPiece,
    as_named,
    files_by_part,
    named,
    said_of_moves,
)
from motionlake.stages.shortlist_files import (
    CLIPS,
    HALF,
    INSTANTS,
    SAMPLE,
    WIDTHS,
    Made,
    Places,
    ShortlistFiles,
    is_of_moves,
    no_sketches,
    write_array,
    write_directions,
    write_sketches,
)
from motionlake.stages.shortlist_files import (
    MOVES as PIECES,
)
from motionlake.stages.stage import Shard

EXACT: Final = "moves-sketches"  # the array of what a later shortlist takes over
LAYOUT: Final = 3  # of moves: those of another are read anew
SPREAD: Final = 16  # parts that they are from, at least


class _Moves:
    """What is kept of the moves of every clip, and filled in part by part.

    Attributes:
        sketches: [n, w].
    """

    def __init__(self, places: Places, directions: Directions) -> None:
        self._places, self._directions = places, directions
        self.sketches = no_sketches(len(places), directions)

    def add(self, lake: Lake, file: str, wanted: Container[str], piece: NextPiece) -> None:
        """Those of a file of moves of the clips that are wanted."""
        from motionlake.motion.moves_of_clips import instants_of_clips

        clips, moves, starts = _moves_in(lake, file, wanted)
        if not clips:
            return
        looked, rows = instants_of_clips(moves, starts, INSTANTS), self._places.of(clips)
        self.sketches[rows] = self._directions.project(looked.reshape(len(looked), -1))
        halves = moves.astype(HALF)
        for row, start, stop in zip(rows.tolist(), starts[:-1].tolist(), starts[1:].tolist(), strict=True):
            piece.add(row, halves[start:stop])

    def take_over(self, files: ShortlistFiles, before: MovesBefore, piece: NextPiece) -> None:
        """Those of the clips that stay."""
        kept, width = files.array(EXACT)[before.old], self.sketches.shape[1]
        if kept.shape[1] > width:  # an earlier version kept norms beside them, infinite where a clip has no moves
            kept[~np.isfinite(kept[:, width])] = np.nan
        self.sketches[before.new] = kept[:, :width]
        piece.take_over(before, files.table, files.files)

    def write(self, lake: Lake, key: str) -> list[str]:
        return [
            *write_directions(lake, key, "moves", self._directions),
            *write_sketches(lake, key, "moves", self.sketches),
            write_array(lake, key, EXACT, self.sketches),
        ]


def moves_to_read(at: LakeReader, there: Sequence[str], clips: pa.Table) -> dict[str, Any]:
    """What a shard of a lake reads of [n] clip and part: of the shortlist with some files what serves on, and parts."""
    files = moves_of_parts(at)
    own = [file for file in there if is_of_moves(file) or file.endswith(CLIPS)]
    before = MovesBefore.of(at.lake, own, LAYOUT, clips, files) if own else None
    if before is None:
        return {"moves": list(files.values())}
    others = before.others(len(clips))
    return {"moves": list(files_by_part(files, clips, others).values()), **as_named("moves", own, before)}


def moves_of_clips(at: LakeReader, shard: Shard, clips: pa.Table, places: Places) -> Made:
    """Those of all clips: of [n] clip and part. The shard says what is read, as `moves_to_read` does."""
    there = named(shard.spec, "moves")
    before = MovesBefore.of(at.lake, there, LAYOUT, clips, moves_of_parts(at)) if there else None
    if before is None:
        files, kept, fitted = None, _fitted(at.lake, shard.spec["moves"], places), len(places)
    else:
        files, fitted = ShortlistFiles.open(at.lake, there), before.fitted
        kept = _Moves(places, files.directions("moves"))
    with NextPiece(at, shard.key, PIECES, len(places), before) as piece:
        others = set(compress(places, piece.others))
        if before is not None and files is not None:
            kept.take_over(files, before, piece)
        for file in shard.spec["moves"]:
            kept.add(at.lake, file, others, piece)
    made, written = piece.made()
    said = said_of_moves(LAYOUT, fitted, list(moves_of_parts(at).values()), written)
    return replace(made, files=[*kept.write(at.lake, shard.key), *made.files], said=said)


def _fitted(lake: Lake, files: Sequence[str], places: Places) -> _Moves:
    """Of no clip yet, along directions of the moves of some."""
    some = list(_some_moves(lake, files, places))
    directions = Directions.of(np.stack([instants(moves, INSTANTS).ravel() for moves in some]), WIDTHS["moves"])
    return _Moves(places, directions)


def moves_of_parts(at: LakeReader) -> dict[str, str]:
    """The file of moves of every frames part of the lake as it stands."""
    return {part.part: MOVES.file(part.key) for part in MOVES.made(at)}


def _moves_in(lake: Lake, file: str, wanted: Container[str]) -> tuple[list[str], Float32Array, Int64Array]:
    """The clips of a part that are wanted; their moves [M, D], and where those of each begin [n + 1]."""
    from motionlake.motion.moves_of_clips import moves_of_clips

    known = [(clip, joints) for clip, joints in joints_in(lake, file) if clip in wanted]
    starts = np.cumsum([0, *(len(joints) for _, joints in known)], dtype=np.int64)
    if not known:
        return [], np.zeros((0, WIDTH), dtype=np.float32), starts
    return [clip for clip, _ in known], *moves_of_clips(np.concatenate([joints for _, joints in known]), starts)


def _some_moves(lake: Lake, files: Sequence[str], places: Places) -> Iterator[Float32Array]:
    """Moves of about `SAMPLE` clips of parts all over the lake."""
    wanted = max(SPREAD, -(-SAMPLE * len(files) // len(places)))
    chosen = files[:: max(1, len(files) // wanted)]
    each = -(-SAMPLE // len(chosen))
    for file in chosen:
        known = [track for clip, track in tracks_in(lake, file) if clip in places]
        for track in known[:: max(1, len(known) // each)]:
            yield track.moves()
