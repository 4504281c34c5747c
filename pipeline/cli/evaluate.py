"""motionlake evaluate."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from pipeline.cli.common import JsonOption, LakeOption, notice, print_json, print_rows
from pipeline.cli.segment import LabelColumn
from pipeline.errors import UserError
from pipeline.lake.catalog import reading
from pipeline.lake.layout import Lake, check_dataset, open_lake

ABOUT = """Measures on labelled clips of a lake.

Example: motionlake evaluate signatures --dataset hdm05 --json --lake mylake"""
BASELINES = {"auto": None, "dtw": True, "none": False}

DatasetOption = Annotated[str | None, typer.Option("--dataset", help="Clips of this dataset only.", show_default=False)]
OnlyOption = Annotated[
    str | None, typer.Option("--only", help="COLUMN=VALUE: clips with this value alone.", show_default=False)
]
BaselineOption = Annotated[
    str, typer.Option(help="Whole-clip DTW beside it: auto (where it takes minutes at most), dtw, none.")
]


def add_to(app: typer.Typer) -> None:
    evaluate = typer.Typer(name="evaluate", help=ABOUT, no_args_is_help=True)
    evaluate.command()(signatures)
    evaluate.command()(segmentation)
    evaluate.command()(pesta)
    app.add_typer(evaluate)


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
    from pipeline.evaluating import evaluate_signatures

    target = _target(lake, dataset, baseline)
    with reading(target) as con:
        found = evaluate_signatures(
            con, target, dataset=dataset, column=column, only=_only(only), dtw=BASELINES[baseline], notice=notice
        )
    if as_json:
        print_json(found)
        return
    rows = [_row("signatures", found)]
    if found["dtw"] is not None:
        rows.append(_row("whole-clip DTW", found["dtw"]))
    print_rows(rows, as_json=False)


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
    from pipeline.applications.segmentation import SegmentationConfig
    from pipeline.evaluating import evaluate_segmentation

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
    from pipeline.evaluating_pesta import evaluate_pesta

    target = _target(lake, dataset, baseline)
    with reading(target) as con:
        found = evaluate_pesta(
            con, target, dataset=dataset, column=column, only=_only(only), dtw=BASELINES[baseline], stride=stride,
            notice=notice,
        )  # fmt: skip
    if pictures is not None:
        from pipeline.pictures.output import write_pictures
        from pipeline.pictures.pesta_evaluation import evaluation_pictures

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


def _target(lake: Path, dataset: str | None, baseline: str) -> Lake:
    if baseline not in BASELINES:
        raise UserError(f"--baseline {baseline}: use one of {', '.join(BASELINES)}")
    if dataset is not None:
        check_dataset(dataset)
    return open_lake(lake)


def _only(text: str | None) -> tuple[str, str] | None:
    if text is None:
        return None
    column, equals, value = text.partition("=")
    if not (column and equals):
        raise UserError(f"--only {text}: give COLUMN=VALUE")
    return column, value


def _row(method: str, found: Mapping[str, Any]) -> dict[str, Any]:
    keys = ("nn", "top5", "first_tier", "second_tier", "map", "cross_subject_nn")
    classified = found["classification"]
    return {
        "method": method,
        **{key: found[key] for key in keys},
        "one_vs_all": classified and classified["accuracy"],
        "n": found["n"],
    }
