"""motionlake evaluate pesta."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from motionlake.cli.common import JsonOption, LabelColumn, LakeOption, notice, print_json, print_rows
from motionlake.cli.evaluate.options import BASELINES, BaselineOption, DatasetOption, OnlyOption, criterion, target_of
from motionlake.lake.catalog import reading


def pesta(
    lake: LakeOption,
    dataset: DatasetOption = None,
    column: LabelColumn = "label",
    only: OnlyOption = None,
    stride: Annotated[
        int | None, typer.Option(min=1, help="w of sta: 3 for whole clips, 2 for sub-queries.", show_default=False)
    ] = None,
    baseline: BaselineOption = "auto",
    pictures: Annotated[
        Path | None,
        typer.Option(help="Draw precision-recall curves and confusions into this folder.", show_default=False),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """How well strided alignment of the lake's strings retrieves: each labelled clip queries all others.

    By method (sta, dtw, sw; signatures and dtw_frames beside them): map, p_at_2, p_at_5, p_at_10, p_at_15, p_at_20, n
    queries, nn; with --json the precision-recall curve and the confusion of the first 20 hits. Where clips have
    segments, sub_queries: each is a long query in turn, asked of the others by windows of 12 symbols.

    Example: motionlake evaluate pesta --dataset hdm05 --json --lake mylake

    Drawn: motionlake evaluate pesta --dataset hdm05 --pictures figures --lake mylake
    """
    from motionlake.evaluation.pesta import evaluate_pesta

    target = target_of(lake, dataset, baseline)
    with reading(target) as con:
        found = evaluate_pesta(
            con, target, dataset=dataset, column=column, only=criterion(only), dtw=BASELINES[baseline], stride=stride,
            notice=notice,
        )  # fmt: skip
    if pictures is not None:
        from motionlake.pictures.evaluation import evaluation_pictures
        from motionlake.pictures.html import write_pictures

        for path in write_pictures(evaluation_pictures(found), pictures):
            notice(f"wrote {path}")
    if as_json:
        print_json(found)
        return
    asked = found.pop("sub_queries")
    rows = [
        {"method": method, **{key: value for key, value in row.items() if key not in ("curve", "confusion")}}
        for method, row in found.items()
        if row is not None
    ]
    if rows:
        print_rows(rows, as_json=False)
    if asked is not None:
        print_rows([{"sub_queries": name, **asked[name]} for name in ("pesta", "pesta_lq")], as_json=False)
