"""The option of searches that draws their answers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import typer
from motionlake.lake.catalog import Connection
from motionlake.lake.layout import Lake

if TYPE_CHECKING:
    from motionlake.retrieval.alignment import AlignmentRangeSearcher, AlignmentSearcher
    from motionlake.retrieval.protocol import Hit, Query, Scope

Answer: TypeAlias = tuple[str, Sequence[Mapping[str, Any]]]
PictureOption = Annotated[
    Path | None,
    typer.Option("--picture", help="Also draw the answers into this .png or .html file.", show_default=False),
]


def check_picture(path: Path | None, queries: int) -> None:
    """Before the search is made: can so many answers be drawn there? Raises `UserError` if not."""
    if path is not None:
        from motionlake.pictures.html import check_hits_file

        check_hits_file(path, queries)


def save_picture(con: Connection, lake: Lake, path: Path | None, answers: Iterable[tuple[Query, Answer]]) -> None:
    """Draw the answers (name of the query, rows) of a search, if a file is named."""
    if path is None:
        return
    from motionlake.pictures.hits_page import hits_page
    from motionlake.pictures.html import picture, write_hits

    pages = [
        picture(f"hits-{i}", f"hits for {name}", "", hits_page(con, lake, query.source, rows, query.start, query.stop))
        for i, (query, (name, rows)) in enumerate(answers, start=1)
    ]
    write_hits(path, pages)


def save_alignment(
    con: Connection,
    lake: Lake,
    path: Path | None,
    searcher: AlignmentSearcher | AlignmentRangeSearcher,
    query: Query,
    hits: Sequence[Hit],
    scope: Scope,
) -> None:
    """Draw the answers of an alignment, if a file is named."""
    if path is None:
        return
    from motionlake.pictures.alignment_page import save_alignments
    from motionlake.pictures.symbol_material import read_symbols
    from motionlake.retrieval.encode import query_motion

    material = read_symbols(con, lake, searcher.strings.among(replace(scope, recorded_only=False)))
    save_alignments(material, path, searcher.symbols_of(query), query_motion(lake, query).fps, hits, searcher.config)
