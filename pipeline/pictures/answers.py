"""The answers of a search as programs have them: rows, and in a notebook a table with a stick figure of each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array
from motionlake.errors import UserError
from motionlake.lake.rows import SHOWN, Rows, rows_html
from motionlake.names import html, kept

if TYPE_CHECKING:
    from motionlake.motion.canonicalise import CanonicalMotion
    from motionlake.pictures.hits_page import HitStrip
    from motionlake.pictures.notebook import Drawing

Source: TypeAlias = str | Path
Asked: TypeAlias = tuple[Source | None, int | None, int | None]  # frames [start, stop) of a clip; None: by words alone
FIGURES: Final = 20  # answers that a notebook draws
MOST: Final = 30  # answers of a picture


class Hits(Rows):
    """Rows of a search, nearest first.

    Examples:
        >>> hits = lake.search("humanoid3d_walk", k=3)
        >>> hits
        <3 rows: rank, clip, distance, mirrored, label, dataset, seconds>
        >>> hits.plot()
        <Drawing of 3 hits>
    """

    def __init__(self, table: pa.Table, motion: Callable[[Source], CanonicalMotion], asked: Asked) -> None:
        """`motion` reads that of a clip, and is asked only for what is drawn."""
        super().__init__(table)
        self._motion, self._asked = motion, asked

    def plot(self, most: int = 10) -> Drawing:
        """A picture of the query, where it is a motion, and of the nearest answers as stick figures.

        Args:
            most: how many answers are drawn, 1 to 30.

        Returns:
            A `motionlake.pictures.notebook.Drawing`, as of `CanonicalMotion.plot`.

        Raises:
            UserError: there are no answers, another number of them, or a clip is not in the lake any more.
        """
        from motionlake.pictures.hits_page import HitStrip, draw_hits
        from motionlake.pictures.notebook import Drawing

        if not len(self):
            raise UserError("plot(): there are no answers to draw")
        if not 1 <= most <= MOST:
            raise UserError(f"plot(): {most} answers; a picture has 1 to {MOST}")
        shown = [HitStrip(str(row["rank"]), _lines(row), _moments(self._part(row))) for row in self[:most]]
        count = f"{len(self)} hit{'s' * (len(self) != 1)}"
        note = f"{count}, the first {most} are shown" if len(self) > most else f"{count}, nearest first"
        query, name = self._query_strip(), self._name()
        title = f"What is most like {name}" if name else "What was found"
        return Drawing(draw_hits(query, shown, title, note), f"{len(shown)} hits")

    def _query_strip(self) -> HitStrip | None:
        from motionlake.pictures.hits_page import HitStrip

        motion = self._query()
        if motion is None:
            return None
        return HitStrip("query", [self._name(), f"{motion.seconds:.1f} s"], _moments(motion))

    def _repr_html_(self) -> str:
        """A table with a stick figure of each of the first answers, for notebooks."""
        plain = [field.name for field in self._table.schema if not pa.types.is_nested(field.type)]
        count = min(len(self), SHOWN)
        figures = [self._figure(row) for row in self[: min(count, FIGURES)]]
        query, caption = self._query(), ""
        if query is not None and len(query):
            caption = f"like {html(self._name())}: {_drawn(query)}"
        cells = figures + [""] * (count - len(figures))
        return rows_html(self._table.select(plain), [("motion", cells)], caption)

    def _figure(self, row: Mapping[str, Any]) -> str:
        try:
            return _drawn(self._part(row))
        except UserError:
            return ""  # the clip has left the lake since

    def _part(self, row: Mapping[str, Any]) -> CanonicalMotion:
        """The motion of an answer; of one that goes on in another clip, what lies in its first."""
        start, stop = row.get("start"), row.get("stop")
        if row.get("stop_clip") not in (None, row["clip"]):
            stop = None
        part = self._motion(row["clip"])[start:stop]
        if not len(part):
            raise UserError(f"{row['clip']}: has no such frames any more")
        return part

    def _query(self) -> CanonicalMotion | None:
        """The motion that was asked for, where that can be read."""
        source, start, stop = self._asked
        if source is None:
            return None
        try:
            part = self._motion(source)[start:stop]
        except UserError:
            return None
        return part if len(part) else None

    def _name(self) -> str:
        source = self._asked[0]
        return "" if source is None else kept(source.name) if isinstance(source, Path) else source

    def __reduce__(self) -> tuple[type[Rows], tuple[pa.Table]]:
        """Other processes get the rows alone: the lake behind them stays open here."""
        return Rows, (self._table,)


def _lines(row: Mapping[str, Any]) -> list[str]:
    distance = f"distance {row['distance']:.3f}" + (", mirrored" if row.get("mirrored") else "")
    return [line for line in (row.get("label"), row["clip"], f"{distance}, {row['seconds']:.1f} s") if line]


def _moments(motion: CanonicalMotion) -> Float32Array:
    from motionlake.pictures.hits_page import MOMENTS
    from motionlake.pictures.stick_figures import spread

    return spread(motion.positions.astype(np.float32), MOMENTS)


def _drawn(motion: CanonicalMotion) -> str:
    from motionlake.pictures.inline_figures import stick_figures

    return stick_figures(motion.positions)
