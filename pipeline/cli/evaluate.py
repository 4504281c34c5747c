"""motionlake evaluate, with its subcommands."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer
from motionlake.cli._measures import METRICS, SYNTHESIS_METRICS, Row, synthesis_rows
from motionlake.cli._output import notice, tell
from motionlake.cli._progress import stage_progress
from motionlake.cli._segment_options import ReachOption, SegmentationOption, VotersOption, WindowOption
from motionlake.cli.common import (
    SETTINGS,
    DatasetOption,
    JsonOption,
    LabelColumn,
    LakeOption,
    MinQualityOption,
    option,
    positive,
)
from motionlake.errors import UserError
from motionlake.lake.catalog import reading
from motionlake.lake.layout import open_lake

if TYPE_CHECKING:
    from motionlake.evaluation.clips import LabelledOptions
    from motionlake.pictures.html import Picture

BASELINES: Final = {"auto": None, "dtw": True, "none": False}


def _known_baseline(value: str) -> str:
    if value not in BASELINES:
        raise UserError(f"--baseline {value}: use one of {', '.join(BASELINES)}")
    return value


OnlyOption = Annotated[str | None, option("--only", help="COLUMN=VALUE: clips with this value alone.")]
BaselineOption = Annotated[
    str,
    typer.Option(
        help="Whole-clip DTW beside it: auto (where it takes minutes at most), dtw, none.", callback=_known_baseline
    ),
]
PicturesOption = Annotated[Path | None, option(help="Also draw curves, maps and tables into this folder.")]
SplitOption = Annotated[
    str | None, option("--split", help="Clips of labels.csv's split to measure by (default: test).")
]
TrainSplitOption = Annotated[
    str | None, option("--train-split", help="Clips to find or to learn from (default: train).")
]

evaluate = typer.Typer(
    help="How well search, classes and made motion do on the labelled clips of a lake.\n\n"
    "Example: motionlake evaluate signatures --dataset hdm05 --json --lake mylake",
    no_args_is_help=True,
    **SETTINGS,
)


@evaluate.command()
def search(
    lake: LakeOption,
    dataset: DatasetOption = None,
    column: LabelColumn = "label",
    only: OnlyOption = None,
    min_quality: MinQualityOption = None,
    split: Annotated[str | None, option("--split", help="Clips of this split ask (default: every clip).")] = None,
    train_split: Annotated[
        str | None, option("--train-split", help="Clips of this split answer (with --split: train).")
    ] = None,
    baseline: BaselineOption = "auto",
    as_json: JsonOption = False,
) -> None:
    """How well `motionlake search` finds clips: each labelled clip is searched for among all others.

    Beside it stand every method alone, and dynamic time warping of the same joints.

    Example: motionlake evaluate search --dataset hdm05 --json --lake mylake

    By the splits of labels.csv: motionlake evaluate search --split test --train-split train --lake mylake
    """
    from motionlake.evaluation.search import evaluate_search

    target = open_lake(lake)
    with reading(target) as con:
        options = _labelled(dataset, column, only, baseline, min_quality)
        found = evaluate_search(con, target, options, queries=split, repository=train_split)
    rows = [{"method": method, **row} for method, row in found["methods"].items() if row is not None]
    _tell(found, [rows], as_json)


@evaluate.command()
def signatures(
    lake: LakeOption,
    dataset: DatasetOption = None,
    column: LabelColumn = "label",
    only: OnlyOption = None,
    min_quality: MinQualityOption = None,
    baseline: BaselineOption = "auto",
    as_json: JsonOption = False,
) -> None:
    """How well signatures find and classify clips: each labelled clip is searched for among all others.

    Example: motionlake evaluate signatures --dataset hdm05 --json --lake mylake

    The partners of a dance: motionlake evaluate signatures --label-column subject --only label=salsa --lake mylake
    """
    from motionlake.evaluation.signatures import evaluate_signatures

    target = open_lake(lake)
    with reading(target) as con:
        found = evaluate_signatures(con, target, _labelled(dataset, column, only, baseline, min_quality))
    keys = ("nn", "top5", "first_tier", "second_tier", "map", "cross_subject_nn")
    measured = {"signatures": found, "whole-clip DTW": found["dtw"]}
    rows = [
        {
            "method": method, **{key: row[key] for key in keys},
            "one_vs_all": row["classification"] and row["classification"]["accuracy"], "n": row["n"],
        }
        for method, row in measured.items() if row is not None
    ]  # fmt: skip
    _tell(found, [rows], as_json)


@evaluate.command()
def segmentation(
    lake: LakeOption,
    dataset: DatasetOption = None,
    method: SegmentationOption = "words",
    window: WindowOption = None,
    k: VotersOption = None,
    reach: ReachOption = None,
    mirrored: Annotated[bool, typer.Option(help="Learn from the mirrored clips too.")] = True,
    min_quality: MinQualityOption = None,
    as_json: JsonOption = False,
) -> None:
    """How well clips are cut into labelled parts: each clip with segments is left out in turn, and learned from others.

    Example: motionlake evaluate segmentation --dataset cmu_exercises --json --lake mylake
    """
    from motionlake.evaluation.segmentation import evaluate_segmentation
    from motionlake.retrieval.segment_methods import config_of

    target = open_lake(lake)
    config = config_of(method, window, k, reach)
    with reading(target) as con:
        found = evaluate_segmentation(
            con, target, dataset=dataset, config=config, mirrored=mirrored, min_quality=min_quality
        )
    rows = [{"clip": clip, **scores} for clip, scores in found["per_clip"].items()]
    _tell(found, [[*rows, {"clip": "mean", **{k: v for k, v in found.items() if k != "per_clip"}}]], as_json)


@evaluate.command()
def pesta(
    lake: LakeOption,
    dataset: DatasetOption = None,
    column: LabelColumn = "label",
    only: OnlyOption = None,
    min_quality: MinQualityOption = None,
    stride: Annotated[
        int | None,
        option(min=1, help="Longest step of an alignment (default: 3; 2 for parts of clips)."),
    ] = None,
    gaps: Annotated[
        bool | None, typer.Option(help="sta: symbols may be left out at a price (default: of config.toml).")
    ] = None,
    protocols: Annotated[
        list[str] | None,
        option(
            "--protocol",
            help="What to measure (repeat it for more): whole, sub-queries, holistic, several-labels, robustness, "
            "sizes (default: the first two).",
        ),
    ] = None,
    baseline: BaselineOption = "auto",
    pictures: PicturesOption = None,
    as_json: JsonOption = False,
) -> None:
    """How well alignment of posture strings (`motionlake align`) finds clips: each labelled clip is searched for.

    Methods are those of `align` (sta, dtw, sw), both ways and one way, with signatures and DTW of frames beside them.
    Where clips have segments, parts of them are searched for too: windows of long queries ("sub-queries"), segments in
    the other clips ("holistic"), and clips that show what a segment shows ("several-labels"). "robustness" replaces
    pieces of clips by pieces of others. "sizes" fits dictionaries of 50 to 800 symbols to the lake's postures, without
    labels. --json has precision-recall curves and confusions.

    Example: motionlake evaluate pesta --dataset hdm05 --json --lake mylake

    Drawn: motionlake evaluate pesta --protocol holistic --pictures figures --lake mylake

    How many symbols a dictionary should have: motionlake evaluate pesta --protocol sizes --lake mylake
    """
    from motionlake.evaluation.pesta.protocols import USUAL, evaluate_pesta
    from motionlake.evaluation.pesta.tables import tables

    target = open_lake(lake)
    with reading(target) as con, stage_progress() as progress:
        options = _labelled(dataset, column, only, baseline, min_quality)
        found = evaluate_pesta(
            con, target, options, stride=stride, gaps=gaps, protocols=protocols or USUAL, progress=progress
        )
    if pictures is not None:
        from motionlake.pictures.evaluation import evaluation_pictures

        _draw(evaluation_pictures(found), pictures)
    _tell(found, tables(found), as_json)


@evaluate.command()
def descriptor(
    lake: LakeOption,
    dataset: DatasetOption = None,
    split: SplitOption = None,
    train_split: TrainSplitOption = None,
    min_quality: MinQualityOption = None,
    column: LabelColumn = "label",
    baseline: BaselineOption = "auto",
    pictures: PicturesOption = None,
    as_json: JsonOption = False,
) -> None:
    """How well descriptors find clips: clips of one split are searched for among those of another.

    Without splits, each clip is searched for among all others. Signatures, alignment and whole-clip DTW answer the same
    queries. --json has the precision-recall curves, and what the network was trained on.

    Example: motionlake evaluate descriptor --dataset utd_mhad --json --lake mylake

    Drawn: motionlake evaluate descriptor --dataset utd_mhad --pictures figures --lake mylake
    """
    from motionlake.evaluation.descriptor import evaluate_descriptor

    target = open_lake(lake)
    with reading(target) as con:
        measured = evaluate_descriptor(
            con, target, dataset=dataset, queries=split, repository=train_split, column=column,
            dtw=BASELINES[baseline], notice=notice, min_quality=min_quality,
        )  # fmt: skip
    if pictures is not None:
        from motionlake.pictures.evaluation import descriptor_pictures

        _draw(descriptor_pictures(measured), pictures)
    columns = ("top1", "top10", "map", "pr_area", "dtw_error_mm", "retrieval_ms", "n")
    methods: dict[str, Any] = {"descriptor": measured.found, **measured.found["methods"]}
    rows = [{"method": name, **{key: row[key] for key in columns}} for name, row in methods.items() if row]
    _tell(measured.found, [rows], as_json)


@evaluate.command()
def synthesis(
    lake: LakeOption,
    dataset: DatasetOption = None,
    split: SplitOption = None,
    train_split: TrainSplitOption = None,
    column: LabelColumn = "label",
    count: Annotated[
        int, typer.Option(min=0, help="Motions of each class that start from clips of other classes.")
    ] = 10,
    seconds: Annotated[
        float | None,
        option(help="Length of motions (default: as long as the recorded ones go on).", callback=positive),
    ] = None,
    piece: Annotated[
        float, typer.Option(help="Seconds; longer clips are cut into pieces as long.", callback=positive)
    ] = 10.0,
    seed: Annotated[int, typer.Option(help="Another seed makes other motions.")] = 0,
    pictures: PicturesOption = None,
    as_json: JsonOption = False,
) -> None:
    """How good the motion is that the lake's generator makes from test clips.

    Every measure stands beside that of recorded clips, or of a body that stops where the clip was cut. Calibration
    poses at the ends of recordings are left out. A line below the table says what each measure means; --json has more
    of them, all by class too, and the units.

    Example: motionlake evaluate synthesis --dataset utd_mhad --json --lake mylake

    Drawn: motionlake evaluate synthesis --dataset utd_mhad --pictures figures --lake mylake
    """
    from motionlake.evaluation.synthesis import SynthesisPlan, evaluate_synthesis

    target = open_lake(lake)
    with reading(target) as con, stage_progress() as progress:
        measured = evaluate_synthesis(
            con, target, SynthesisPlan(count, seed, seconds, piece), dataset=dataset, split=split,
            repository=train_split, column=column, notice=notice, progress=progress,
        )  # fmt: skip
    if pictures is not None:
        from motionlake.pictures.synthesis import synthesis_pictures

        _draw(synthesis_pictures(measured), pictures)
    rows = synthesis_rows(measured.found)
    _tell(measured.found, [rows], as_json)
    if not as_json:
        said = dict.fromkeys(row["measure"] for row in rows if row["measure"] in SYNTHESIS_METRICS)
        print("".join(f"\n{name}: {SYNTHESIS_METRICS[name]}" for name in said))


def _labelled(
    dataset: str | None, column: str, only: str | None, baseline: str, min_quality: str | None
) -> LabelledOptions:
    from motionlake.evaluation.clips import LabelledOptions

    name, equals, value = (only or "").partition("=")
    if only is not None and not (name and equals):
        raise UserError(f"--only {only}: give COLUMN=VALUE")
    criterion = None if only is None else (name, value)
    return LabelledOptions(dataset, column, criterion, BASELINES[baseline], notice, min_quality)


def _draw(pictures: Sequence[Picture], folder: Path) -> None:
    from motionlake.pictures.html import write_pictures

    for path in write_pictures(pictures, folder):
        notice(f"wrote {path}")


def _tell(found: Any, tables: Sequence[Sequence[Row]], as_json: bool) -> None:
    """What was found as JSON, or as tables with a line on each of their columns that needs one."""
    if as_json:
        tell(found, as_json=True)
        return
    shown = [rows for rows in tables if rows]
    for rows in shown:
        tell(rows, as_json=False)
    columns = dict.fromkeys(name for rows in shown for name in rows[0])
    print("".join(f"\n{name}: {METRICS[name]}" for name in columns if name in METRICS))
