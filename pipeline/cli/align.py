"""motionlake align."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Annotated

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
from motionlake.cli.pictures import PictureOption, check_picture, save_alignment
from motionlake.errors import UserError
from motionlake.formats import is_clip
from motionlake.lake.catalog import reading
from motionlake.lake.layout import check_dataset, open_lake
from motionlake.lake.resolve import resolve_clip


def align(
    lake: LakeOption,
    query: Annotated[str, typer.Argument(help="A clip of the lake, or a clip file.", show_default=False)],
    start: StartOption = None,
    stop: StopOption = None,
    k: KOption = 10,
    dataset: DatasetOption = None,
    real: RecordedOnlyOption = False,
    whole: Annotated[bool, typer.Option("--whole", help="Rank clips by the whole of both.")] = False,
    method: Annotated[
        str | None,
        typer.Option(help="sta, dtw or sw (default: of config.toml).", show_default=False),
    ] = None,
    stride: Annotated[
        int | None,
        typer.Option(
            help="For sta: longest step; 3 may skip 2 postures (default: of config.toml).",
            show_default=False,
        ),
    ] = None,
    crossing: Annotated[bool, typer.Option("--crossing", help="Matches may cross from clip to clip.")] = False,
    path: Annotated[bool, typer.Option("--path", help="Print what is aligned to what (with --json).")] = False,
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
    from motionlake.retrieval.aligner import Aligner, Wanted

    target = open_lake(lake)
    if dataset is not None:
        check_dataset(dataset)
    if whole and (start is not None or stop is not None or crossing or path):
        raise UserError("--whole: compares whole clips; leave --from, --to, --crossing and --path out")
    if path and not as_json:
        raise UserError("--path: needs --json")
    check_picture(picture, 1)
    with reading(target) as con:
        aligner = Aligner(con, target, threads=os.cpu_count() or 1, real=real)
        outside = Path(query).is_file() and is_clip(Path(query))
        asked = Path(query) if outside else resolve_clip(con, query)
        if whole:
            ranked = aligner.whole(asked, k, dataset=dataset, method=method, stride=stride)
            save_alignment(con, target, picture, aligner, asked, ranked, dataset=dataset, method=method, stride=stride)
            print_rows([hit.as_row() for hit in ranked], as_json=as_json)
            return
        first, last = frames_of(con, target, asked, start, stop)
        wanted: Wanted = {
            "dataset": dataset, "method": method, "stride": stride, "crossing": crossing,
            "paths": path or picture is not None,
        }  # fmt: skip
        if isinstance(asked, Path):
            hits = aligner.in_file(asked, first, last, k, **wanted)
        else:
            hits = aligner.in_clip(asked, first, last, k, **wanted)
        save_alignment(
            con, target, picture, aligner, asked, hits, first, last, dataset=dataset, method=method, stride=stride
        )
    rows = [(hit if path else replace(hit, path=None)).as_row() for hit in hits]
    print_rows(rows, as_json=as_json)
