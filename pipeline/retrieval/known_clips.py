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

_FACTS: Final = [each.name for each in fields(CorpusClip)]


@dataclass(frozen=True)
class KnownClips:
    """Rows of the query "clips_with_parts": by name, all different."""

    table: pa.Table

    def facts(self, entry: int) -> CorpusClip:
        """What is said of the clip of a row."""
        return CorpusClip(*(self.table[name][entry].as_py() for name in _FACTS))

    def facts_of(self, entries: Int64Array) -> list[CorpusClip]:
        """The same of the clips of some rows."""
        return [CorpusClip(**row) for row in self.table.select(_FACTS).take(column_of(entries)).to_pylist()]

    def parts_of(self, entries: Int64Array) -> dict[str, str]:
        """By name, the frames part that holds each of the clips of some rows."""
        found = self.table.select(["clip", "part"]).take(column_of(entries))
        return dict(zip(found["clip"].to_pylist(), found["part"].to_pylist(), strict=True))

    def entry(self, clip: str) -> int | None:
        """The row of a clip; None where there is no such clip."""
        names = self.table["clip"]
        at = bisect_left(range(len(names)), clip, key=lambda row: names[row].as_py())
        return at if at < len(names) and names[at].as_py() == clip else None

    def some_facts(self, clips: Iterable[str]) -> dict[str, CorpusClip]:
        """What is said of some clips, without those that there are not."""
        entries = ((clip, self.entry(clip)) for clip in clips)
        return {clip: self.facts(entry) for clip, entry in entries if entry is not None}

    def some_parts(self, clips: Iterable[str]) -> dict[str, str]:
        """The frames parts of some clips, without those that there are not."""
        entries = [entry for clip in clips if (entry := self.entry(clip)) is not None]
        return self.parts_of(np.array(entries, dtype=np.int64))
