"""motionlake evaluate descriptor."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from motionlake.cli.common import JsonOption, LabelColumn, LakeOption, notice, print_json, print_rows
from motionlake.cli.evaluate.options import BASELINES, BaselineOption, DatasetOption, target_of
from motionlake.lake.catalog import reading

COLUMNS = ("top1", "top10", "map", "pr_area", "dtw_error_mm", "retrieval_ms", "n")


def descriptor(
    lake: LakeOption,
    dataset: DatasetOption = None,
    queries: Annotated[
        str | None, typer.Option(help="Split whose clips are queries (default: test).", show_default=False)
    ] = None,
    repository: Annotated[
        str | None, typer.Option(help="Split whose clips are found (default: train).", show_default=False)
    ] = None,
    column: LabelColumn = "label",
    baseline: BaselineOption = "auto",
    pictures: Annotated[
        Path | None,
        typer.Option(help="Draw precision-recall curves, a map and the loss into this folder.", show_default=False),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """How well descriptors retrieve: clips of one split query those of another; without splits, each all others.

    top1, top10 (share of the first ten hits with the query's class), map, n queries; pr_area; dtw_error_mm, how far
    joints of the first hit are after DTW; retrieval_ms. Signatures, alignment and whole-clip DTW answer the same
    queries; --json has the curves, and what the network was trained on.

    Example: motionlake evaluate descriptor --dataset utd_mhad --json --lake mylake

    Drawn: motionlake evaluate descriptor --dataset utd_mhad --pictures figures --lake mylake
    """
    from motionlake.evaluation.descriptor import evaluate_descriptor

    target = target_of(lake, dataset, baseline)
    with reading(target) as con:
        measured = evaluate_descriptor(
            con, target, dataset=dataset, queries=queries, repository=repository, column=column,
            dtw=BASELINES[baseline], notice=notice,
        )  # fmt: skip
    if pictures is not None:
        from motionlake.pictures.evaluation import descriptor_pictures
        from motionlake.pictures.html import write_pictures

        for path in write_pictures(descriptor_pictures(measured), pictures):
            notice(f"wrote {path}")
    found = measured.found
    if as_json:
        print_json(found)
        return
    rows: dict[str, Any] = {"descriptor": found} | {name: row for name, row in found["methods"].items() if row}
    print_rows([{"method": name, **{key: row[key] for key in COLUMNS}} for name, row in rows.items()], as_json=False)
