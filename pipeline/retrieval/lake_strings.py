"""The symbol strings of a lake as arrays: what alignment on a lake reads."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from motionlake.arrays import Int64Array
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch, fetch_table
from motionlake.pesta.alignment.strings import Repository, SymbolDistances
from motionlake.pesta.symbols import SymbolString
from numpy.typing import NDArray
from scipy.spatial.distance import cdist


@dataclass(frozen=True)
class StringClip:
    """What is known of one clip; `frames` at its own rate `fps`."""

    clip: str
    dataset: str
    label: str | None
    fps: float
    frames: int
    synthetic: bool = False


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

    clips: list[StringClip]
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

    def among(self, dataset: str | None, *, real: bool = False) -> LakeStrings:
        """The strings of one dataset, or of all; with `real`, of recorded clips. They are taken out once."""
        if dataset is None and not (real and any(c.synthetic for c in self.clips)):
            return self
        if (dataset, real) not in self._taken:
            self._taken[dataset, real] = self._of([self._wanted(c, dataset, real) for c in self.clips])
        return self._taken[dataset, real]

    @cached_property
    def _taken(self) -> dict[tuple[str | None, bool], LakeStrings]:
        return {}

    @staticmethod
    def _wanted(clip: StringClip, dataset: str | None, real: bool) -> bool:
        return dataset in (None, clip.dataset) and not (real and clip.synthetic)

    def _of(self, wanted: list[bool]) -> LakeStrings:
        chosen = np.array(wanted, dtype=np.bool_)
        kept = np.repeat(chosen, self.repository.lengths)
        offsets = np.concatenate([[0], np.cumsum(self.repository.lengths[chosen])]).astype(np.int64)
        return replace(
            self,
            clips=[c for c, kept_too in zip(self.clips, wanted, strict=True) if kept_too],
            repository=Repository(self.repository.symbols[kept], offsets),
            starts=self.starts[kept],
            stops=self.stops[kept],
        )


def read_strings(con: Connection) -> LakeStrings:
    """The strings of a lake.

    Raises:
        UserError: the lake has none yet.
    """
    codes = fetch(con, "posture_codes")
    if not codes:
        raise UserError("the lake has no symbol strings yet; make them with `motionlake run all`")
    rows = fetch_table(con, "symbol_strings")
    known = rows.select(["clip", "dataset", "label", "fps", "frames", "synthetic"]).to_pylist()
    lengths = pc.list_value_length(rows.column("symbols")).to_numpy().astype(np.int64)
    offsets = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
    starts = _flat(rows.column("starts")).astype(np.int64)
    stops = np.append(starts[1:], 0)
    stops[offsets[1:] - 1] = rows.column("frames").to_numpy()
    points = np.array([row["code"] for row in codes], dtype=np.float64)
    return LakeStrings(
        [StringClip(**row) for row in known],
        Repository(_flat(rows.column("symbols")).astype(np.int32), offsets),
        starts,
        stops,
        SymbolDistances(cdist(points, points).astype(np.float32)),
        codes[0]["model"],
    )


def _flat(lists: pa.ChunkedArray) -> NDArray[np.int64]:
    return np.concatenate([np.zeros(0, dtype=np.int64), *(chunk.flatten().to_numpy() for chunk in lists.chunks)])
