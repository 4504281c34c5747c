"""motionlake search."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipeline.cli.common import JsonOption, LakeOption, print_rows
from pipeline.formats import is_clip
from pipeline.lake.layout import check_dataset, open_lake
from pipeline.stages.resolve import resolve_clip


def add_to(app: typer.Typer) -> None:
    app.command()(search)


def search(
    clip: Annotated[str, typer.Argument(help="A clip of the lake, or a clip file.", show_default=False)],
    lake: LakeOption,
    k: Annotated[int, typer.Option("-k", min=1, help="How many answers.")] = 10,
    dataset: Annotated[
        str | None, typer.Option("--in", help="Answer from this dataset only.", show_default=False)
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """The clips most like one, nearest first.

    Example: motionlake search walk_01 -k 5 --lake mylake

    A file that is not in the lake: motionlake search shots/new_take.bvh --lake mylake
    """
    from pipeline.connection import connect
    from pipeline.search import similar_to_clip, similar_to_file

    target = open_lake(lake)
    if dataset is not None:
        check_dataset(dataset)
    con = connect(target.root)
    try:
        if Path(clip).is_file() and is_clip(Path(clip)):
            hits = similar_to_file(con, target, Path(clip), k, dataset)
        else:
            hits = similar_to_clip(con, resolve_clip(con, clip), k, dataset)
    finally:
        con.close()
    print_rows([hit.as_row() for hit in hits], as_json=as_json)
