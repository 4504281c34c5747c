"""motionlake evaluate signatures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from motionlake.cli.common import JsonOption, LabelColumn, LakeOption, notice, print_json, print_rows
from motionlake.cli.evaluate.options import BASELINES, BaselineOption, DatasetOption, OnlyOption, criterion, target_of
from motionlake.lake.catalog import reading


def signatures(
    lake: LakeOption,
    dataset: DatasetOption = None,
    column: LabelColumn = "label",
    only: OnlyOption = None,
    baseline: BaselineOption = "auto",
    as_json: JsonOption = False,
) -> None:
    """How well signatures retrieve and classify: each labelled clip queries all others.

    nn, top5, first_tier, second_tier, map, cross_subject_nn; one-vs-all classification; n queries.

    Example: motionlake evaluate signatures --dataset hdm05 --json --lake mylake

    The partners of a dance: motionlake evaluate signatures --label-column subject --only label=salsa --lake mylake
    """
    from motionlake.evaluation.signatures import evaluate_signatures

    target = target_of(lake, dataset, baseline)
    with reading(target) as con:
        found = evaluate_signatures(
            con, target, dataset=dataset, column=column, only=criterion(only), dtw=BASELINES[baseline], notice=notice
        )
    if as_json:
        print_json(found)
        return
    rows = [_row("signatures", found)]
    if found["dtw"] is not None:
        rows.append(_row("whole-clip DTW", found["dtw"]))
    print_rows(rows, as_json=False)


def _row(method: str, found: Mapping[str, Any]) -> dict[str, Any]:
    keys = ("nn", "top5", "first_tier", "second_tier", "map", "cross_subject_nn")
    classified = found["classification"]
    return {
        "method": method,
        **{key: found[key] for key in keys},
        "one_vs_all": classified and classified["accuracy"],
        "n": found["n"],
    }
