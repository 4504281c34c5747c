"""motionlake align."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any

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
from motionlake.cli.pictures import PictureOption, check_picture, save_alignment
from motionlake.errors import UserError
from motionlake.lake.catalog import reading
from motionlake.lake.layout import open_lake


def align(
    lake: LakeOption,
    query: Annotated[str, typer.Argument(help="A clip of the lake, or a clip file.", show_default=False)],
    start: StartOption = None,
    stop: StopOption = None,
    k: KOption = 10,
    dataset: DatasetOption = None,
    split: SplitOption = None,
    recorded_only: RecordedOnlyOption = False,
    mirrored: MirroredOption = False,
    own: OwnOption = False,
    whole: Annotated[bool, typer.Option("--whole", help="Rank whole clips: search --method alignment.")] = False,
    method: Annotated[
        str | None,
        typer.Option(help="How poses are matched: sta, dtw or sw (default: as config.toml says).", show_default=False),
    ] = None,
    stride: Annotated[
        int | None,
        typer.Option(
            help="sta: how many poses a match may step ahead at a time (default: of config.toml).",
            show_default=False,
        ),
    ] = None,
    crossing: Annotated[bool, typer.Option("--crossing", help="A match may go on in the next clip.")] = False,
    path: Annotated[bool, typer.Option("--path", help="Say which frames match which (with --json).")] = False,
    picture: PictureOption = None,
    as_json: JsonOption = False,
) -> None:
    """Where a piece of motion occurs inside other clips, pose by pose, and which poses match.

    The answers are ranges of frames (the clip's own, from 0), those whose postures align at the lowest cost first.

    Example: motionlake align 13_29 --from 4s --to 6s -k 5 --lake mylake

    Whole clips: motionlake align walk_01 --whole --lake mylake

    The best answer, posture by posture: motionlake align 13_29 --from 480 --to 720 --picture best.png --lake mylake

    Of a file that is not in the lake: motionlake align shots/new_take.bvh --path --json --lake mylake
    """
    from motionlake.retrieval.alignment import AlignmentRangeSearcher, AlignmentSearcher

    target = open_lake(lake)
    scope = scope_of(dataset, split, recorded_only, mirrored=mirrored, own=own)
    if whole and (crossing or path):
        raise UserError("--whole: compares whole clips; leave --crossing and --path out")
    if path and not as_json:
        raise UserError("--path: needs --json")
    check_picture(picture, 1)
    how: dict[str, Any] = {"method": method, "stride": stride}
    with reading(target) as con:
        if whole:
            searcher: AlignmentSearcher | AlignmentRangeSearcher = AlignmentSearcher(target, **how)
        else:
            searcher = AlignmentRangeSearcher(target, **how, crossing=crossing, paths=path or picture is not None)
        asked = asked_for(con, target, query, start, stop)
        (hits,) = searcher.search([asked], k, scope)
        save_alignment(con, target, picture, searcher, asked, hits, scope)
    rows = [(hit if path else replace(hit, path=None)).as_row() for hit in hits]
    tell_hits(rows, mirrored=mirrored, as_json=as_json)
