"""motionlake search."""

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
    print_json,
    scope_of,
    tell_hits,
)
from motionlake.cli.pictures import PictureOption, check_picture, save_picture
from motionlake.errors import UserError
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.layout import open_lake


def search(
    lake: LakeOption,
    clips: Annotated[
        list[str] | None, typer.Argument(help="Clips of the lake, or clip files.", show_default=False)
    ] = None,
    start: StartOption = None,
    stop: StopOption = None,
    k: KOption = 10,
    method: Annotated[
        str,
        typer.Option(
            help="What is compared: signature (how often which short moves occur), alignment (poses in their order), "
            "descriptor (what a network sees), or fused (all of them)."
        ),
    ] = "signature",
    dataset: DatasetOption = None,
    split: SplitOption = None,
    recorded_only: RecordedOnlyOption = False,
    mirrored: MirroredOption = False,
    own: OwnOption = False,
    sample: Annotated[int, typer.Option(min=0, help="Also ask for so many clips of the lake, to try it out.")] = 0,
    picture: PictureOption = None,
    as_json: JsonOption = False,
) -> None:
    """The clips most like one, nearest first.

    Example: motionlake search walk_01 -k 5 --lake mylake

    A file that is not in the lake: motionlake search shots/new_take.bvh --lake mylake

    Like a part of a clip: motionlake search walk_01 --from 1s --to 3s --lake mylake

    By the descriptor network: motionlake search walk_01 --method descriptor --lake mylake
    """
    from motionlake.retrieval.registry import check_method, searcher

    target = open_lake(lake)
    check_method("clip", method)
    scope = scope_of(dataset, split, recorded_only, mirrored=mirrored, own=own)
    with reading(target) as con:
        names = [*(clips or []), *(row["clip"] for row in fetch(con, "sample_clips", {"count": sample}))]
        if not names:
            raise UserError("search: name a clip or a clip file, or give --sample N")
        check_picture(picture, len(names))
        found = searcher("clip", method, target)
        queries = [asked_for(con, target, name, start, stop) for name in names]
        hits = [[hit.as_row() for hit in each] for each in found.search(queries, k, scope)]
        answers = list(zip(names, hits, strict=True))
        save_picture(con, target, picture, zip(queries, answers, strict=True))
    if as_json:
        print_json([{"query": name, **row} for name, rows in answers for row in rows])
        return
    for name, rows in answers:
        if len(answers) > 1:
            print(f"\n{name}")
        tell_hits(rows, mirrored=mirrored, as_json=False)
