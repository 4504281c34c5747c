"""motionlake evaluate, with its subcommands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer
from motionlake.cli._segment_options import ReachOption, SegmentationOption, VotersOption, WindowOption
from motionlake.cli.common import (
    SETTINGS,
    DatasetOption,
    JsonOption,
    LabelColumn,
    LakeOption,
    MinQualityOption,
    notice,
    option,
    positive,
    stage_progress,
    tell,
)
from motionlake.errors import UserError
from motionlake.lake.catalog import reading
from motionlake.lake.layout import open_lake

if TYPE_CHECKING:
    from motionlake.evaluation.clips import LabelledOptions
    from motionlake.pictures.html import Picture

Row = Mapping[str, Any]

BASELINES: Final = {"auto": None, "dtw": True, "none": False}
# What the columns of the tables say.
METRICS: Final = {
    "nn": "share of queries whose nearest clip is of their class; higher is better",
    "top1": "share of queries whose nearest clip is of their class; higher is better",
    "top5": "share of the first 5 hits that are of the query's class; higher is better",
    "top10": "share of the first 10 hits that are of the query's class; higher is better",
    "first_tier": "of a class of R other clips, the share among the first R hits; higher is better",
    "second_tier": "the same among the first 2 R hits; higher is better",
    "map": "mean average precision: 1 where all clips of the query's class come before all others; higher is better",
    "cross_subject_nn": "nn among clips of other subjects; higher is better",
    "one_vs_all": "share of clips that a classifier for each class gives the right class; higher is better",
    "p_at_2": "p_at_2, p_at_5, …: share of the first 2, 5, … hits that are of the query's class; higher is better",
    "pr_area": "area under the precision-recall curve, 1 at most; higher is better",
    "dtw_error_mm": "millimetres from the query's joints to those of its first hit, after DTW; lower is better",
    "retrieval_ms": "milliseconds to answer a query; lower is better",
    "accuracy": 'share of labelled words given the right class, "unknown" for a class not learned; higher is better',
    "accuracy_known": "of the words whose class was learned, each given a learned class; higher is better",
    "accuracy_known_or_unknown": 'the same, where "unknown" counts as wrong; higher is better',
    "all_p_at_2": "all_p_at_2, …: the same over all queries, those that cannot be answered counted as wrong",
    "n_refused": "queries that are one posture, which `align` refuses",
    "all_map": "map with the refused queries counted as 0; higher is better",
    "mean_of_classes": "map, mean over the classes; higher is better",
    "replaced": "share of pieces of clips that are of other classes; beside it map by method, higher is better",
    "m": "symbols of a dictionary",
    "symbols": "length of all strings together; a query takes time in proportion to it",
    "milliseconds": "time of a query for its first 20 answers, on one thread; lower is better",
    "occupied": "symbols that the dictionary's own postures use; m at best",
    "seconds": "time that the search took; lower is better",
    "n": "queries measured",
    "n_known": "words whose class was learned",
}
# What the rows of the table of synthesis say.
SYNTHESIS_METRICS: Final = {
    "FID": "distance of the distributions of descriptors of two seconds, made against test clips; lower is better",
    "precision": "share of made motions that lie among test clips; higher is better",
    "recall": "share of test clips that lie among made motions; higher is better",
    "density": "how many test clips a made motion lies near, 1 where both are alike",
    "coverage": "share of test clips that a made motion lies near; higher is better",
    "diversity": "how unlike made motions are one another, by descriptors; near 1 times the recorded is better",
    "multimodality": "the same of motions of one class",
    "pose spread": "body lengths between motions of one class at the same time; near the recorded is better",
    "energy, m²/s²": "mean squared speed of joints seen from the body; near the recorded is better",
    "travel speed, m/s": "of the hips, from second to second; near the recorded is better",
    "usual seconds": "share whose energy and travel nine of ten recorded seconds have; near the recorded is better",
    "jerk, m/s³": "change of acceleration; near the recorded is better",
    "skate ratio": "share of frames with a foot near the ground in which even the slowest foot slides; lower is better",
    "penetration, m": "how deep a joint goes below the ground; lower is better",
    "airborne, s": "longest time off the ground; at most the recorded is better",
    "bone-length drift, %": "lower is better",
    "path circling": "turns a metre to one side; near the recorded is better",
    "range of wrist": "degrees that the hands turn about their mean; 0 is a stiff hand",
    "range of head": "the same of the head",
    "range of toe": "the same of the toes",
    "seconds until the class": "from a start of another class, median; lower is better",
    "class within 1.5 s": "share that moves as the class does by then; higher is better",
    "jump at the seam, mm": "off the way that the joints were going; near the recorded is better",
    "first 200 ms, mm": "from what really follows, by the world; lower than the last pose held is better",
    "nearest training clip": "body lengths, median; far below the recorded is a copy",
    "copying z": "below -3 made motions are nearer to training clips than test clips are",
}


BESIDE_RECORDED: Final = (
    ("diversity", "diversity"), ("multimodality", "multimodality"), ("pose_spread", "pose spread"),
    ("energy", "energy, m²/s²"), ("travel_speed", "travel speed, m/s"), ("usual", "usual seconds"),
    ("jerk", "jerk, m/s³"), ("skate_ratio", "skate ratio"), ("penetration", "penetration, m"),
    ("airborne", "airborne, s"), ("bone_length_drift", "bone-length drift, %"), ("path_circling", "path circling"),
)  # fmt: skip


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
    rows = _synthesis_rows(measured.found)
    _tell(measured.found, [rows], as_json)
    if not as_json:
        said = dict.fromkeys(row["measure"] for row in rows if row["measure"] in SYNTHESIS_METRICS)
        print("".join(f"\n{name}: {SYNTHESIS_METRICS[name]}" for name in said))


def _synthesis_rows(found: dict[str, Any]) -> list[Row]:
    """Measures beside those of recorded clips, or of the last pose held."""
    held, recognised, near = found["zero_velocity"], found["recognised"] or {}, found["nearest_real"]
    last, recorded, training = "last pose held", "recorded clips", "training against test clips"
    alike = {side: found["likeness"][side] or {} for side in ("made", "training")}
    rows: list[tuple[str, Any, Any, str]] = [
        *((f"error at {t} ms, mm", error, held["errors_ms"][t], last) for t, error in found["errors_ms"].items()),
        ("mean per-joint error, mm", found["mean_per_joint_error"], held["mean_per_joint_error"], last),
        ("Euclidean distance, mm", found["euclidean"], held["euclidean"], last),
        *(
            (name, alike["made"].get(name.lower()), alike["training"].get(name.lower()), training)
            for name in ("FID", "precision", "recall", "density", "coverage")
        ),
        *((title, found[name]["made"], found[name]["real"], recorded) for name, title in BESIDE_RECORDED),
        *(
            (f"range of {name.split('_')[-1]}", found["angular_range"][name]["made"],
             found["angular_range"][name]["real"], recorded)
            for name in ("left_wrist", "head", "left_toe")
        ),
        ("class recognised, starts of other classes", recognised.get("made"), recognised.get("real"), recorded),
    ]  # fmt: skip
    if changed := found["transitions"]:
        soon, jump, first = changed["soon"], changed["jump_mm"], changed["continued_mm"]
        rows += [
            ("seconds until the class", changed["seconds"], None, ""),
            ("class within 1.5 s", soon["made"], soon["real"], recorded),
            ("jump at the seam, mm", jump["made"], jump["real"], recorded),
            ("first 200 ms, mm", first["made"], first["held"], last),
        ]
    if near:
        rows += [
            ("nearest training clip", near["made"]["median"], near["test"]["median"], recorded),
            ("copying z", near["z"], None, ""),
        ]
    return [{"measure": a, "made": b, "beside": c, "beside is": d} for a, b, c, d in rows]


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
