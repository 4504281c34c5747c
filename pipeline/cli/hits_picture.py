"""The option of searches that draws their answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from motionlake.lake.catalog import Connection
from motionlake.lake.layout import Lake

PictureOption = Annotated[
    Path | None,
    typer.Option("--picture", help="Also draw the answers into this .png or .html file.", show_default=False),
]


def check_picture(path: Path | None, queries: int) -> None:
    """Before the search is made: can so many answers be drawn there? Raises `UserError` if not."""
    if path is not None:
        from motionlake.pictures.output import check_hits_file

        check_hits_file(path, queries)


def save_picture(
    con: Connection,
    lake: Lake,
    path: Path | None,
    answers: Sequence[tuple[str, Sequence[Mapping[str, Any]]]],
    start: int | None = None,
    stop: int | None = None,
) -> None:
    """Draw the answers (query, rows) of a search; `start` and `stop` are frames of the query, if it is a range."""
    if path is None:
        return
    from motionlake.pictures.hits_page import hits_page
    from motionlake.pictures.html import picture
    from motionlake.pictures.output import write_hits

    pages = [
        picture(f"hits-{i}", f"hits for {query}", "", hits_page(con, lake, query, rows, start, stop))
        for i, (query, rows) in enumerate(answers, start=1)
    ]
    write_hits(path, pages)
