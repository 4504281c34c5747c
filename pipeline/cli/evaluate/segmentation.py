"""motionlake evaluate segmentation."""

from __future__ import annotations

from typing import Annotated

import typer
from motionlake.cli.common import JsonOption, LakeOption, print_json, print_rows
from motionlake.cli.evaluate.options import DatasetOption
from motionlake.lake.catalog import reading
from motionlake.lake.layout import check_dataset, open_lake


def segmentation(
    lake: LakeOption,
    dataset: DatasetOption = None,
    window: Annotated[int, typer.Option(min=1, help="Words of a window.")] = 19,
    k: Annotated[int, typer.Option("-k", min=1, help="Nearest windows that vote.")] = 5,
    reach: Annotated[int, typer.Option(min=0, help="A window votes for words up to so many from its middle.")] = 12,
    mirrored: Annotated[bool, typer.Option(help="Learn from the mirrored clips too.")] = True,
    as_json: JsonOption = False,
) -> None:
    """How well clips are segmented by the segments of the others: each clip that has segments is left out in turn.

    accuracy: of all labelled words; "unknown" is right for classes never taught, else wrong. accuracy_known: of the
    words whose class was taught, each given a taught class. accuracy_known_or_unknown: of these, "unknown" wrong.

    Example: motionlake evaluate segmentation --dataset cmu_exercises --json --lake mylake
    """
    from motionlake.deep_motifs.segmentation import SegmentationConfig
    from motionlake.evaluation.segmentation import evaluate_segmentation

    target = open_lake(lake)
    if dataset is not None:
        check_dataset(dataset)
    config = SegmentationConfig(window, k, reach)
    with reading(target) as con:
        found = evaluate_segmentation(con, target, dataset=dataset, config=config, mirrored=mirrored).as_dict()
    if as_json:
        print_json(found)
        return
    rows = [{"clip": clip, **scores} for clip, scores in found["per_clip"].items()]
    print_rows([*rows, {"clip": "mean", **{k: v for k, v in found.items() if k != "per_clip"}}], as_json=False)
