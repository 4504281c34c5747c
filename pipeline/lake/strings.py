"""The symbol strings of a lake as arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import compress
from typing import Any

import numpy as np
import pyarrow.compute as pc
from motionlake.arrays import Int64Array
from motionlake.columns import numbers
from motionlake.deep_motifs.emd import ground_distances
from motionlake.deep_motifs.signatures import CorpusClip
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch, fetch_table
from motionlake.pesta.strings import Repository, SymbolDistances
from motionlake.pesta.symbols import SymbolString
from numpy.typing import NDArray


@dataclass(frozen=True)
class LakeStrings:
    """n clips by name, their strings of Y symbols one after another.

    Attributes:
        clips: n.
        repository: the strings.
        starts: [Y] first frame of each symbol, at the clip's own rate.
        stops: [Y] frame after its last.
        distances: of the m symbols.
        model: name of their dictionary: strings over two dictionaries do not compare.
    """

    clips: list[CorpusClip]
    repository: Repository
    starts: Int64Array
    stops: Int64Array
    distances: SymbolDistances
    model: str

    @cached_property
    def positions(self) -> dict[str, int]:
        """Index of each clip by its name."""
        return {c.clip: i for i, c in enumerate(self.clips)}

    def symbols_of(self, clip: int) -> slice:
        """Where the symbols of a clip stand."""
        return slice(int(self.repository.offsets[clip]), int(self.repository.offsets[clip + 1]))

    def string_of(self, clip: int) -> SymbolString:
        """The string of a clip."""
        own = self.symbols_of(clip)
        return SymbolString(self.repository.symbols[own], self.starts[own], self.stops[own])

    def among(self, admits: Callable[[CorpusClip], bool]) -> LakeStrings:
        """The strings of the clips that are admitted; they are taken out once."""
        wanted = tuple(map(admits, self.clips))
        if all(wanted):
            return self
        if wanted not in self._taken:
            chosen = np.array(wanted, dtype=np.bool_)
            kept = np.repeat(chosen, self.repository.lengths)
            offsets = np.concatenate([[0], np.cumsum(self.repository.lengths[chosen])]).astype(np.int64)
            self._taken[wanted] = replace(
                self,
                clips=list(compress(self.clips, wanted)),
                repository=Repository(self.repository.symbols[kept], offsets),
                starts=self.starts[kept],
                stops=self.stops[kept],
            )
        return self._taken[wanted]

    @cached_property
    def _taken(self) -> dict[tuple[bool, ...], LakeStrings]:
        return {}


def read_strings(con: Connection, clips: Sequence[str] | None = None) -> LakeStrings:
    """The strings of a lake, or of some of its clips.

    Raises:
        UserError: there are none yet.
    """
    distances, model = read_distances(con)
    rows = fetch_table(con, "symbol_strings", {"clips": None if clips is None else list(clips)})
    known = [CorpusClip(**row) for row in rows.drop_columns(["symbols", "starts"]).to_pylist()]
    symbols, starts = (numbers(pc.list_flatten(rows.column(name))) for name in ("symbols", "starts"))
    return strings_of(known, symbols, starts, numbers(pc.list_value_length(rows.column("symbols"))), distances, model)


def read_distances(con: Connection) -> tuple[SymbolDistances, str]:
    """Those of the symbols of the dictionary that the strings of a lake are over, and its name.

    Raises:
        UserError: there are no strings yet.
    """
    codes = fetch(con, "posture_codes")
    if not codes:
        raise UserError("the lake has no symbol strings yet; make them with `motionlake run all`")
    points = np.array([row["code"] for row in codes], dtype=np.float32)
    return SymbolDistances(ground_distances(points).astype(np.float32)), codes[0]["model"]


def strings_of(
    clips: list[CorpusClip], symbols: NDArray[Any], starts: NDArray[Any], lengths: NDArray[Any],
    distances: SymbolDistances, model: str,
) -> LakeStrings:  # fmt: skip
    """The strings of n clips, whose symbols [Y] and their first frames [Y] stand one after another."""
    offsets = np.concatenate([[0], np.cumsum(lengths, dtype=np.int64)])
    first = starts.astype(np.int64)
    stops = np.append(first[1:], 0)
    stops[offsets[1:] - 1] = [clip.frames for clip in clips]
    return LakeStrings(clips, Repository(symbols.astype(np.int32), offsets), first, stops, distances, model)
