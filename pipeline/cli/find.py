"""motionlake find."""

from __future__ import annotations

from typing import Annotated

import typer
from motionlake.cli.common import (
    DatasetOption,
    JsonOption,
    KOption,
    LakeOption,
    MirroredOption,
    OwnOption,
    RecordedOnlyOption,
    SplitOption,
    StartOption,
    StopOption,
    asked_for,
    scope_of,
    tell_hits,
)
from motionlake.cli.pictures import PictureOption, check_picture, save_picture
from motionlake.lake.catalog import reading
from motionlake.lake.layout import open_lake


def find(
    lake: LakeOption,
    query: Annotated[str, typer.Argument(help="A clip of the lake, or a clip file.", show_default=False)],
    start: StartOption = None,
    stop: StopOption = None,
    k: KOption = 10,
    method: Annotated[
        str,
        typer.Option(
            help="What is compared: words (which short moves occur), alignment (poses in their order), or "
            "submotion (what a network sees; one answer a clip)."
        ),
    ] = "words",
    dataset: DatasetOption = None,
    split: SplitOption = None,
    recorded_only: RecordedOnlyOption = False,
    mirrored: MirroredOption = False,
    own: OwnOption = False,
    picture: PictureOption = None,
    as_json: JsonOption = False,
) -> None:
    """Where a piece of motion occurs inside other clips, nearest first.

    Frames are the clip's own, from 0. The piece must last 0.6 s for "words" and 0.3 s for "submotion", by default.

    Example: motionlake find 13_29 --from 4s --to 6s -k 5 --lake mylake

    Of a file that is not in the lake: motionlake find shots/new_take.bvh --from 0 --to 120 --lake mylake

    By the network: motionlake find 13_29 --from 480 --to 540 --method submotion --lake mylake
    """
    from motionlake.retrieval.registry import check_method, searcher

    target = open_lake(lake)
    check_method("range", method)
    scope = scope_of(dataset, split, recorded_only, mirrored=mirrored, own=own)
    check_picture(picture, 1)
    with reading(target) as con:
        found = searcher("range", method, target)
        asked = asked_for(con, target, query, start, stop)
        (hits,) = found.search([asked], k, scope)
        rows = [hit.as_row() for hit in hits]
        save_picture(con, target, picture, [(asked, (query, rows))])
    tell_hits(rows, mirrored=mirrored, as_json=as_json)
