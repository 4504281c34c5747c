"""motionlake segment."""

from __future__ import annotations

from typing import Annotated

import typer
from motionlake.cli.common import JsonOption, LabelColumn, LakeOption, asked_for, tell
from motionlake.lake.catalog import reading
from motionlake.lake.layout import check_dataset, open_lake
from motionlake.lake.resolve import resolve_clip


def segment(
    lake: LakeOption,
    query: Annotated[str, typer.Argument(help="A clip of the lake, or a clip file.", show_default=False)],
    teach: Annotated[
        list[str] | None,
        typer.Option("--dataset", help="Learn from this dataset (repeat it for more; default: all)."),
    ] = None,
    teach_clips: Annotated[
        list[str] | None, typer.Option("--labelled-clip", help="Learn from this clip (repeat it for more).")
    ] = None,
    column: LabelColumn = "label",
    mirrored: Annotated[bool, typer.Option(help="Learn from the mirrored clips too.")] = True,
    window: Annotated[int, typer.Option(min=1, help="Words of a window.")] = 19,
    k: Annotated[int, typer.Option("-k", min=1, help="Nearest windows that vote.")] = 5,
    reach: Annotated[int, typer.Option(min=0, help="How many words from its middle a window votes for.")] = 12,
    unknown: Annotated[bool, typer.Option(help="Say unknown where no labelled clip is like it.")] = True,
    as_json: JsonOption = False,
) -> None:
    """Which class each part of a clip shows, learned from labelled clips.

    The answers are ranges of frames. Classes come from the segments (segments.csv) of clips; a clip without them
    counts as one range of its label, where its dataset or itself is named, or where the lake has no segments.

    Example: motionlake segment 14_20 --dataset cmu_exercises --lake mylake

    Of a file that is not in the lake: motionlake segment shots/new_take.bvh --dataset hdm05 --lake mylake
    """
    from motionlake.deep_motifs.segmentation import SegmentationConfig
    from motionlake.retrieval.segments import LakeSegmenter, Lessons

    target = open_lake(lake)
    for dataset in teach or ():
        check_dataset(dataset)
    config = SegmentationConfig(window, k, reach, unknown=1.0 if unknown else None)
    with reading(target) as con:
        names = [resolve_clip(con, name) for name in teach_clips or ()] or None
        segmenter = LakeSegmenter(target, Lessons(teach or None, names, column, mirrored), config)
        found = segmenter.segment(asked_for(con, target, query))
    tell([band.as_row() for band in found], as_json=as_json)
