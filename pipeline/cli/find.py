"""motionlake find."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer
from motionlake.cli.common import (
    DatasetOption,
    JsonOption,
    KOption,
    LakeOption,
    RecordedOnlyOption,
    StartOption,
    StopOption,
    frames_of,
    print_rows,
)
from motionlake.cli.pictures import PictureOption, check_picture, save_picture
from motionlake.errors import UserError
from motionlake.formats import is_clip
from motionlake.lake.catalog import Connection, reading
from motionlake.lake.layout import Lake, check_dataset, open_lake
from motionlake.lake.resolve import resolve_clip

if TYPE_CHECKING:
    from motionlake.retrieval.query_by_example import Finder, Found
    from motionlake.retrieval.submotion_search import FoundPiece, SubmotionFinder

METHODS: Final = ("words", "submotion")


def find(
    lake: LakeOption,
    query: Annotated[str, typer.Argument(help="A clip of the lake, or a clip file.", show_default=False)],
    start: StartOption = None,
    stop: StopOption = None,
    k: KOption = 10,
    dataset: DatasetOption = None,
    method: Annotated[str, typer.Option(help="words or submotion.")] = "words",
    mirrored: Annotated[bool, typer.Option("--mirrored", help="Look for the mirrored query too (words).")] = False,
    real: RecordedOnlyOption = False,
    own: Annotated[bool, typer.Option("--own", help="The frames asked for may be an answer themselves.")] = False,
    picture: PictureOption = None,
    as_json: JsonOption = False,
) -> None:
    """Where a piece of motion occurs inside other clips, nearest first.

    The answers are ranges of frames (the clip's own, from 0). By "words" the query needs at least two (14 frames of 24
    a second, 0.6 s, by default), and a clip may have several answers. "submotion" asks a network which clips hold the
    motion, and answers with one range of each; the query needs at least 8 frames of 30 a second.

    Example: motionlake find 13_29 --from 4s --to 6s -k 5 --lake mylake

    Of a file that is not in the lake: motionlake find shots/new_take.bvh --from 0 --to 120 --lake mylake

    By the network: motionlake find 13_29 --from 480 --to 540 --method submotion --lake mylake
    """
    target = open_lake(lake)
    if dataset is not None:
        check_dataset(dataset)
    if method not in METHODS:
        raise UserError(f"--method {method}: not one of {', '.join(METHODS)}")
    if mirrored and method != "words":
        raise UserError(f"--mirrored: looks by words, not by {method}; leave one of the two out")
    check_picture(picture, 1)
    with reading(target) as con:
        finder = _finder(con, target, method, real)
        asked = _asked(con, query)
        first, last = frames_of(con, target, asked, start, stop)
        turned = {"mirrored": True} if mirrored else {}
        hits: Sequence[Found | FoundPiece]
        if isinstance(asked, Path):
            hits = finder.in_file(asked, first, last, k, dataset=dataset, **turned)
        else:
            hits = finder.in_clip(asked, first, last, k, dataset=dataset, own=own, **turned)
        rows = [hit.as_row() for hit in hits]
        save_picture(con, target, picture, [(query, rows)], first, last)
    print_rows(rows, as_json=as_json)


def _finder(con: Connection, lake: Lake, method: str, real: bool) -> Finder | SubmotionFinder:
    if method == "words":
        from motionlake.retrieval.query_by_example import Finder

        return Finder(con, lake, real=real)
    from motionlake.retrieval.submotion_search import SubmotionFinder

    return SubmotionFinder(con, lake, real=real)


def _asked(con: Connection, query: str) -> str | Path:
    """A clip file, or the clip of the lake that a name means."""
    outside = Path(query).is_file() and is_clip(Path(query))
    return Path(query) if outside else resolve_clip(con, query)
