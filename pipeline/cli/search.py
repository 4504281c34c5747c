"""motionlake search."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from motionlake.cli.common import (
    DatasetOption,
    JsonOption,
    KOption,
    LakeOption,
    RecordedOnlyOption,
    print_json,
    print_rows,
)
from motionlake.cli.pictures import PictureOption, check_picture, save_picture
from motionlake.errors import UserError
from motionlake.formats import is_clip
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import check_dataset, open_lake
from motionlake.lake.resolve import resolve_clip


def search(
    lake: LakeOption,
    clips: Annotated[
        list[str] | None, typer.Argument(help="Clips of the lake, or clip files.", show_default=False)
    ] = None,
    k: KOption = 10,
    dataset: DatasetOption = None,
    method: Annotated[str, typer.Option(help="signature, alignment, descriptor or fused.")] = "signature",
    mirrored: Annotated[bool, typer.Option("--mirrored", help="Search for the mirrored motion too.")] = False,
    real: RecordedOnlyOption = False,
    sample: Annotated[int, typer.Option(min=0, help="Also ask for so many clips of the lake, to try it out.")] = 0,
    picture: PictureOption = None,
    as_json: JsonOption = False,
) -> None:
    """The clips most like one, nearest first.

    Example: motionlake search walk_01 -k 5 --lake mylake

    A file that is not in the lake: motionlake search shots/new_take.bvh --lake mylake

    By the descriptor network: motionlake search walk_01 --method descriptor --lake mylake
    """
    from motionlake.retrieval.connection import connect
    from motionlake.retrieval.methods import check_method, retriever

    target = open_lake(lake)
    if dataset is not None:
        check_dataset(dataset)
    check_method(method, mirrored=mirrored)
    con = connect(target.root)
    try:
        queries = [*(clips or []), *(row["clip"] for row in fetch(con, "sample_clips", {"count": sample}))]
        if not queries:
            raise UserError("search: name a clip or a clip file, or give --sample N")
        check_picture(picture, len(queries))
        asked = [_query(con, query) for query in queries]
        found = retriever(method, con, target, mirrored=mirrored, real=real).search(asked, k, dataset)
        answers = [(query, [hit.as_row() for hit in hits]) for query, hits in zip(queries, found, strict=True)]
        save_picture(con, target, picture, answers)
    finally:
        con.close()
    if as_json:
        print_json([{"query": query, **row} for query, rows in answers for row in rows])
        return
    for query, rows in answers:
        if len(answers) > 1:
            print(f"\n{query}")
        print_rows(rows, as_json=False)


def _query(con: Connection, query: str) -> str | Path:
    """A clip file, or the clip of the lake that a name means."""
    outside = Path(query).is_file() and is_clip(Path(query))
    return Path(query) if outside else resolve_clip(con, query)
