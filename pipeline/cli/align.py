"""motionlake align: where a piece of motion occurs, pose by pose."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

import typer
from motionlake.cli._answers import (
    BelowOption,
    KOption,
    MirroredOption,
    OwnOption,
    PictureOption,
    check_picture,
    count_of,
)
from motionlake.cli._hits import tell_hits
from motionlake.cli.common import (
    ClipArgument,
    DatasetOption,
    JsonOption,
    LakeOption,
    MinQualityOption,
    RecordedOnlyOption,
    SplitOption,
    StartOption,
    StopOption,
    named_query,
    option,
)
from motionlake.errors import UserError
from motionlake.lake.catalog import reading
from motionlake.lake.layout import open_lake

if TYPE_CHECKING:
    from motionlake.retrieval.long_alignment import WindowHit


def align(
    lake: LakeOption,
    query: ClipArgument,
    start: StartOption = None,
    stop: StopOption = None,
    k: KOption = None,
    below: BelowOption = None,
    dataset: DatasetOption = None,
    split: SplitOption = None,
    recorded_only: RecordedOnlyOption = False,
    min_quality: MinQualityOption = None,
    mirrored: MirroredOption = False,
    own: OwnOption = False,
    whole: Annotated[bool, typer.Option("--whole", help="Rank whole clips: search --method alignment.")] = False,
    method: Annotated[
        str | None, option(help="How poses are matched: sta, dtw or sw (default: as config.toml says).")
    ] = None,
    stride: Annotated[
        int | None,
        option(help="sta: how many poses a match may step ahead at a time (default: of config.toml)."),
    ] = None,
    gaps: Annotated[
        bool | None,
        typer.Option(help="sta: poses may be left out at a price, of both sides (default: of config.toml)."),
    ] = None,
    boundaries: Annotated[
        str | None,
        option(
            help="Where one clip ends and the next begins: kept (default), crossed (a match may go on in the next "
            "clip), or dropped (clips are one string, and matches that cross are left out)."
        ),
    ] = None,
    ways: Annotated[
        str | None,
        option(
            help="--whole: the max (default) or mean of both ways, the query in the clip and the clip in the query, or "
            "query, the query in the clip alone."
        ),
    ] = None,
    window: Annotated[
        int | None,
        typer.Option(
            min=2, help="Look for every window of so many poses, sliding by a third of them; -k answers each."
        ),
    ] = None,
    path: Annotated[bool, typer.Option("--path", help="Say which frames match which (with --json).")] = False,
    picture: PictureOption = None,
    as_json: JsonOption = False,
) -> None:
    """Where a piece of motion occurs inside other clips, pose by pose, and which poses match.

    The answers are ranges of frames (the clip's own, from 0), those whose postures align at the lowest cost first.

    Example: motionlake align 13_29 --from 4s --to 6s -k 5 --lake mylake

    Whole clips: motionlake align walk_01 --whole --lake mylake

    The best answer, posture by posture: motionlake align 13_29 --from 480 --to 720 --picture best.png --lake mylake

    All that are near enough: motionlake align 13_29 --from 480 --to 720 --below 0.5 --lake mylake

    Of a file that is not in the lake: motionlake align shots/new_take.bvh --path --json --lake mylake

    A long take, window by window: motionlake align 13_29 --window 12 -k 3 --lake mylake

    Of a clip with pieces of other motions in it: motionlake align 13_29 --from 4s --to 6s --gaps --lake mylake

    Also what goes on from one clip into the next: motionlake align 13_29 --boundaries crossed --lake mylake
    """
    from motionlake.retrieval.alignment import AlignmentRangeSearcher, AlignmentSearcher, check_together
    from motionlake.retrieval.protocol import Scope

    target, k = open_lake(lake), count_of(k, below)
    check_together(whole=whole, window=window, boundaries=boundaries, ways=ways, mirrored=mirrored, named="--")
    if window is not None and picture is not None:
        raise UserError("--window: answers many queries; leave --picture out")
    if path and not as_json:
        raise UserError("--path: needs --json")
    check_picture(picture, 1)
    scope = Scope(dataset, split, recorded_only, mirrored, own, min_quality=min_quality, below=below)
    how: dict[str, Any] = {"method": method, "stride": stride, "gaps": gaps, "paths": path or picture is not None}
    with reading(target) as con:
        if window is not None:
            long = named_query(con, target, query, start, stop)
            aligner = AlignmentRangeSearcher(target, **how, boundaries=boundaries)
            windows = aligner.long_query(long, scope, window).windows(window, k, paths=path)
            tell_hits([_of_window(hit) for hit in windows], mirrored=False, as_json=as_json)
            return
        if whole:
            searcher: AlignmentSearcher | AlignmentRangeSearcher = AlignmentSearcher(target, **how, ways=ways)
        else:
            searcher = AlignmentRangeSearcher(target, **how, boundaries=boundaries)
        piece = named_query(con, target, query, start, stop)
        (hits,) = searcher.search([piece], k, scope)
        if picture is not None:
            from motionlake.pictures.symbol_material import read_symbols
            from motionlake.pictures.symbol_pictures import AlignmentPictures
            from motionlake.retrieval.encode import query_motion

            admits = replace(scope, recorded_only=False).admission(target)
            material = read_symbols(con, target, searcher.strings.among(admits))
            fps, asked = query_motion(target, piece).fps, searcher.symbols_of(piece)
            AlignmentPictures(material, asked, fps, searcher.config, searcher.clip_strings).save(picture, hits)
    rows = [(hit if path else replace(hit, path=None)).as_row() for hit in hits]
    tell_hits(rows, mirrored=mirrored, as_json=as_json)


def _of_window(hit: WindowHit) -> dict[str, object]:
    """A row that begins with the frames of the query."""
    return {"query_start": hit.query_start, "query_stop": hit.query_stop} | hit.as_row()
