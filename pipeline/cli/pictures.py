"""The option of searches that draws their answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from motionlake.lake.catalog import Connection
from motionlake.lake.layout import Lake

if TYPE_CHECKING:
    from motionlake.retrieval.aligned import AlignedHit, WholeHit
    from motionlake.retrieval.aligner import Aligner

PictureOption = Annotated[
    Path | None,
    typer.Option("--picture", help="Also draw the answers into this .png or .html file.", show_default=False),
]


def check_picture(path: Path | None, queries: int) -> None:
    """Before the search is made: can so many answers be drawn there? Raises `UserError` if not."""
    if path is not None:
        from motionlake.pictures.html import check_hits_file

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
    from motionlake.pictures.html import picture, write_hits

    pages = [
        picture(f"hits-{i}", f"hits for {query}", "", hits_page(con, lake, query, rows, start, stop))
        for i, (query, rows) in enumerate(answers, start=1)
    ]
    write_hits(path, pages)


def save_alignment(
    con: Connection,
    lake: Lake,
    path: Path | None,
    aligner: Aligner,
    asked: str | Path,
    hits: Sequence[AlignedHit] | Sequence[WholeHit],
    start: int | None = None,
    stop: int | None = None,
    *,
    dataset: str | None = None,
    method: str | None = None,
    stride: int | None = None,
) -> None:
    """Draw the answers to frames [start, stop) of a clip or file, if a file is named; the rest as they were asked."""
    if path is None:
        return
    from motionlake.lake.config import load_config
    from motionlake.pictures.alignment_page import save_alignments
    from motionlake.pictures.symbol_material import read_symbols
    from motionlake.retrieval.encode import first_body

    strings = aligner.strings
    fps = first_body(lake, asked)[0].fps if isinstance(asked, Path) else strings.clips[strings.positions[asked]].fps
    given: dict[str, Any] = {"method": method, "stride": stride}
    config = replace(
        load_config(lake.config_file).alignment, **{name: value for name, value in given.items() if value is not None}
    )
    material = read_symbols(con, lake, strings.among(dataset))
    save_alignments(material, path, aligner.asked(asked, start, stop), fps, hits, config)
