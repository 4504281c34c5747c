"""The clips of the shortlist of a lake, beside those of its catalog; nothing here needs a kernel."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array, Int64Array
from motionlake.columns import column_of
from motionlake.deep_motifs.signatures import CorpusClip
from motionlake.errors import UserError
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.layout import Lake
from motionlake.lake.models import check_served
from motionlake.motion.moves import KIND
from motionlake.retrieval.known_clips import KnownClips, row_of
from motionlake.retrieval.protocol import ClipFilter, Finds, not_ready
from motionlake.stages.shortlist_files import MOST, WHOLE, ShortlistFiles


class LakeShortlist:
    """The files of a shortlist, and the catalog of now.

    Args:
        lake: which holds it.
        files: of it.
        needed: arrays of it that are read at once.

    Attributes:
        lake: which holds it.
        files: that stage "shortlist" made.
        known: what the catalog says of all clips.

    Raises:
        UserError: the shortlist is of other motifs, postures or moves than the lake serves, or there is a newer model.
        DamagedError: a file of it is not as it was written.
    """

    def __init__(self, lake: Lake, files: Sequence[str], needed: Collection[str] = ()) -> None:
        with ThreadPoolExecutor(1) as pool, reading(lake) as con:
            opened = pool.submit(ShortlistFiles.open, lake, files, needed)  # and compared with what was written
            served = {row["method"]: row["model"] for row in fetch(con, "models_compared")} | {"moves": KIND}
            self.known = KnownClips.read(con)
            self.lake, self.files = lake, opened.result()
            if self._stale(served):
                raise UserError(
                    f"{lake.root}: its shortlist of clips is of other models than it serves now; make it anew with "
                    "`motionlake run shortlist`"
                )
            check_served(lake, *self.files.methods)
        self._admitted: dict[ClipFilter, Float32Array] = {}

    @property
    def large(self) -> bool:
        """Whether the lake holds more clips than have a neighbour graph."""
        return len(self.known.table) > MOST

    def names(self, rows: Sequence[int]) -> list[str]:
        """Of the clips of some rows."""
        found: list[str] = self.files.table["clip"].take(column_of(np.array(rows, dtype=np.int64))).to_pylist()
        return found

    def facts(self, row: int) -> CorpusClip:
        """What the catalog says of the clip of a row."""
        return self.known.facts(int(self.entries[row]))

    def facts_of(self, rows: Int64Array) -> list[CorpusClip]:
        """The same of the clips of some rows."""
        return self.known.facts_of(self.entries[rows])

    def parts_of(self, rows: Int64Array) -> dict[str, str]:
        """By name, the frames part of each of the clips of some rows."""
        return self.known.parts_of(self.entries[rows])

    def row(self, clip: str) -> int:
        """Raises `UserError` for a clip that it does not hold, or that was another one when it was made."""
        row = self.place(clip)
        if row is None:
            raise not_ready(self.lake, clip, "place in the shortlist")
        return row

    def place(self, clip: str) -> int | None:
        """The row of a clip; None where `row` raises."""
        row = row_of(self.files.table["clip"], clip)
        return row if row is not None and self.entries[row] >= 0 else None

    def admits(self, kept: ClipFilter) -> Float32Array:
        """[n] 0 for the clips that may be answers, minus infinity for all others."""
        if kept not in self._admitted:
            there = self.entries >= 0
            if kept != ClipFilter():
                with reading(self.lake) as con:
                    admitted = {row["clip"] for row in fetch(con, "clips_admitted", kept.as_parameters(con))}
                there &= [name in admitted for name in self.files.table["clip"].to_pylist()]
            self._admitted[kept] = np.where(there, np.float32(0), np.float32(-np.inf))
        return self._admitted[kept]

    def _stale(self, served: Mapping[str, str]) -> bool:
        return any(served.get(name) != self.files.models.get(name) for name in self.files.methods)

    @cached_property
    def entries(self) -> Int64Array:
        """[n] the row in the catalog of each clip; -1 where it left the lake, or is another one since."""
        made, known = self.files.table, self.known.table
        if made["clip"].equals(known["clip"]) and made["part"].equals(known["part"]):
            return np.arange(len(made))
        rows = {pair: row for row, pair in enumerate(zip(*_names(known), strict=True))}
        return np.array([rows.get(pair, -1) for pair in zip(*_names(made), strict=True)], dtype=np.int64)


def shortlist_of(lake: Lake, finds: Finds = "clip") -> list[str]:
    """The files of the shortlist by which a lake is searched for clips, or for ranges; none: without.

    In lakes of more than `WHOLE` clips, or of more than `MOST` where clips are chosen in which ranges are looked for.
    """
    with reading(lake) as con:
        (count,), files = fetch(con, "count_clips"), [row["file"] for row in fetch(con, "shortlist_files")]
    return files if count["clips"] > (WHOLE if finds == "clip" else MOST) else []


def _names(table: pa.Table) -> tuple[list[str], list[str]]:
    return table["clip"].to_pylist(), table["part"].to_pylist()
