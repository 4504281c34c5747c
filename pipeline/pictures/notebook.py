"""What motions and lakes show of themselves in a notebook: HTML that needs no network and no other file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.figure import Figure
from motionlake import sql
from motionlake.errors import UserError
from motionlake.lake.rows import Rows, rows_html
from motionlake.motion.canonicalise import CanonicalMotion
from motionlake.names import html
from motionlake.pictures.html import write_file
from motionlake.pictures.player import player_page
from motionlake.pictures.player_material import MOST_SECONDS, PlayerClip
from motionlake.pictures.stick_figures import draw_strip, spread
from motionlake.pictures.style import TOP, Sheet, png, styled, written
from motionlake.stages.registry import EVERY

PLAYER: Final = 720  # pixels that a player is high
MOST_MOMENTS: Final = 40
_FIGURE: Final = 0.62  # inches that a figure of a strip is wide
_KINDS: Final = (".png", ".svg", ".pdf")


class Drawing:
    """A figure that a notebook shows and `save` writes.

    Attributes:
        figure: of matplotlib.
    """

    def __init__(self, figure: Figure, about: str) -> None:
        self.figure, self._about = figure, about

    def save(self, path: str | Path) -> Path:
        """Write it as a PNG, SVG or PDF file, as the name ends.

        Raises:
            UserError: another ending, or the file cannot be written.
        """
        file = Path(path)
        if file.suffix.lower() not in _KINDS:
            raise UserError(f"{file}: a picture ends with {', '.join(_KINDS)}")
        write_file(file, written(self.figure, file.suffix.lower().lstrip(".")))
        return file

    def _repr_png_(self) -> bytes:
        return png(self.figure)

    def __repr__(self) -> str:
        return f"<Drawing of {self._about}>"


def motion_html(motion: CanonicalMotion) -> str:
    """A player of a motion in a frame of its own: no script of it reaches the notebook, nor the other way round.

    Of a long motion the first three minutes are played, and a line says how to play others.
    """
    if not len(motion):
        return f"<p>{html(repr(motion))}</p>"
    most = int(MOST_SECONDS * motion.fps)
    shown = motion[:most]
    facts = [("length", f"{motion.seconds:.4g} s, {len(motion)} frames at {motion.fps:g} a second")]
    page = player_page([PlayerClip("Motion", shown.positions, shown.fps, len(motion), 0, facts)])
    cut = f"<p>The first {MOST_SECONDS:.0f} s of {motion.seconds:.0f} s; motion[{most}:] plays the others.</p>"
    return (
        f'<iframe title="Player of a motion" sandbox="allow-scripts" width="100%" height="{PLAYER}" '
        f'style="border:0" srcdoc="{html_attribute(page)}"></iframe>{cut if len(shown) < len(motion) else ""}'
    )


def html_attribute(page: str) -> str:
    """A whole page as the value of an attribute, which gives it back to the byte."""
    return page.replace("&", "&amp;").replace('"', "&quot;")


@styled
def motion_plot(motion: CanonicalMotion, moments: int) -> Drawing:
    """As `CanonicalMotion.plot`."""
    if not len(motion):
        raise UserError("plot(): the motion has no frames")
    if not 1 <= moments <= MOST_MOMENTS:
        raise UserError(f"plot(): {moments} moments; a picture has 1 to {MOST_MOMENTS}")
    width = max(4.0, 0.4 + moments * _FIGURE)
    sheet = Sheet(width, TOP + 1.35, "Motion", f"{motion.seconds:.4g} s, {len(motion)} frames")
    draw_strip(sheet, 0.2, TOP, width - 0.4, 1.2, spread(motion.positions.astype(np.float32), moments))
    return Drawing(sheet.figure, f"{len(motion)} frames")


def lake_html(name: object, ask: Callable[[str], Rows]) -> str:
    """What a lake of some name holds: how many clips, its datasets, and what each stage has made.

    `ask` answers a query in SQL.
    """
    places = {stage.name: place for place, stage in enumerate(EVERY)}
    datasets, stages, told = (ask(sql.read(f"status_{name}")) for name in ("datasets", "stages", "rows"))
    rows_of = {row["stage"]: row["rows"] for row in told}  # in the catalog alone
    known = [{**row, "rows": rows_of.get(row["stage"], row["rows"])} for row in stages]
    made = Rows.of(sorted(known, key=lambda row: (places.get(row["stage"], len(places)), row["stage"])))
    clips, minutes = (sum(row[name] for row in datasets) for name in ("clips", "minutes"))
    lasts = f"{minutes / 60:.1f} hours" if minutes >= 60 else f"{minutes:.1f} minutes"
    tables = "".join(rows_html(rows.arrow()) for rows in (datasets, made) if len(rows))
    return f"<div><p><b>{html(name)}</b>: {clips} clip{'s' * (clips != 1)}, {lasts}</p>{tables}</div>"
