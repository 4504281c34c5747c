"""motionlake find."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipeline.cli.common import JsonOption, LakeOption, print_rows
from pipeline.cli.hits_picture import PictureOption, check_picture, save_picture
from pipeline.formats import is_clip
from pipeline.lake.catalog import reading
from pipeline.lake.layout import check_dataset, open_lake
from pipeline.stages.resolve import resolve_clip


def add_to(app: typer.Typer) -> None:
    app.command()(find)


def find(
    lake: LakeOption,
    query: Annotated[str, typer.Argument(help="A clip of the lake, or a clip file.", show_default=False)],
    start: Annotated[int | None, typer.Option("--from", min=0, help="First frame of the query.")] = None,
    stop: Annotated[int | None, typer.Option("--to", min=1, help="Frame after its last.")] = None,
    k: Annotated[int, typer.Option("-k", min=1, help="How many answers.")] = 10,
    dataset: Annotated[
        str | None, typer.Option("--in", help="Answer from this dataset only.", show_default=False)
    ] = None,
    mirrored: Annotated[bool, typer.Option("--mirrored", help="Look for the mirrored query too.")] = False,
    picture: PictureOption = None,
    as_json: JsonOption = False,
) -> None:
    """Where a motion occurs inside the clips: ranges of frames, nearest first.

    Frames are the clip's own, from 0; the query needs at least two words (14 frames of 24 a second, 0.6 s, by default).

    Example: motionlake find 13_29 --from 480 --to 720 -k 5 --lake mylake

    Of a file that is not in the lake: motionlake find shots/new_take.bvh --from 0 --to 120 --lake mylake
    """
    from pipeline.find import Finder

    target = open_lake(lake)
    if dataset is not None:
        check_dataset(dataset)
    check_picture(picture, 1)
    with reading(target) as con:
        finder = Finder(con, target)
        if Path(query).is_file() and is_clip(Path(query)):
            hits = finder.in_file(Path(query), start, stop, k, dataset=dataset, mirrored=mirrored)
        else:
            hits = finder.in_clip(resolve_clip(con, query), start, stop, k, dataset=dataset, mirrored=mirrored)
        rows = [hit.as_row() for hit in hits]
        save_picture(con, target, picture, [(query, rows)], start, stop)
    print_rows(rows, as_json=as_json)
