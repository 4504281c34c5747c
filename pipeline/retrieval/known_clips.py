"""What the catalog says of all clips of a lake: to look some up takes less time than to ask it for each query."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Int64Array
from motionlake.columns import column_of
from motionlake.deep_motifs.signatures import CorpusClip
from motionlake.lake.catalog import Connection, fetch_table

_FACTS: Final = [each.name for each in fields(CorpusClip)]


@dataclass(frozen=True)
class KnownClips:
    """Rows of the query "clips_with_parts": by name, all different."""

    table: pa.Table

    @staticmethod
    def read(con: Connection) -> KnownClips:
        """Of a lake's catalog."""
        return KnownClips(fetch_table(con, "clips_with_parts").combine_chunks())  # else rows would be joined each time

    def facts(self, entry: int) -> CorpusClip:
        """What is said of the clip of a row."""
        return CorpusClip(*(self.table[name][entry].as_py() for name in _FACTS))

    def facts_of(self, entries: Int64Array) -> list[CorpusClip]:
        """The same of the clips of some rows."""
        found = self.table.select(_FACTS).take(column_of(entries))
        return [CorpusClip(*each) for each in zip(*(column.to_pylist() for column in found.columns), strict=True)]

    def parts_of(self, entries: Int64Array) -> dict[str, str]:
        """By name, the frames part that holds each of the clips of some rows."""
        found = self.table.select(["clip", "part"]).take(column_of(entries))
        return dict(zip(found["clip"].to_pylist(), found["part"].to_pylist(), strict=True))

    def entries(self, clips: Iterable[str]) -> Int64Array:
        """The rows of some clips, without those that there are not."""
        found = (row_of(self.table["clip"], clip) for clip in clips)
        return np.array([entry for entry in found if entry is not None], dtype=np.int64)


def row_of(names: pa.ChunkedArray, clip: str) -> int | None:
    """Where a clip is among names in order, all different; None where it is not."""
    at = bisect_left(range(len(names)), clip, key=lambda row: names[row].as_py())
    return at if at < len(names) and names[at].as_py() == clip else None
