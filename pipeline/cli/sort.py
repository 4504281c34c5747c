"""motionlake classify, segment and cluster: clips, and parts of clips, sorted into classes and groups."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from motionlake.cli._output import notice, tell, write_csv
from motionlake.cli._segment_options import ReachOption, SegmentationOption, VotersOption, WindowOption
from motionlake.cli.common import (
    ClipArgument,
    ClipsArgument,
    DatasetOption,
    JsonOption,
    LabelColumn,
    LakeOption,
    MinQualityOption,
    RecordedOnlyOption,
    SplitOption,
    named_query,
    option,
)
from motionlake.errors import UserError
from motionlake.lake.catalog import reading
from motionlake.lake.layout import check_dataset, open_lake
from motionlake.lake.resolve import resolve_clip
from motionlake.names import typed

if TYPE_CHECKING:
    from motionlake.retrieval.classes import ClassifiedClip, Method
    from motionlake.retrieval.labelled_clips import SignedClip

METHODS: dict[str, Method] = {"search": "search", "knn": "knn", "one-vs-all": "one_vs_all"}


def classify(
    lake: LakeOption,
    clips: ClipsArgument = None,
    unlabelled: Annotated[bool, typer.Option("--unlabelled", help="Also every clip without a label.")] = False,
    method: Annotated[
        str,
        typer.Option(
            help="search (its first clips vote), knn (the nearest by signatures), or one-vs-all (classifiers)."
        ),
    ] = "search",
    k: Annotated[int, typer.Option("-k", min=1, help="Clips that vote.")] = 5,
    dataset: DatasetOption = None,
    split: SplitOption = None,
    min_quality: MinQualityOption = None,
    column: LabelColumn = "label",
    write_labels: Annotated[Path | None, option("--write-labels", help="Write a labels.csv of the answers.")] = None,
    as_json: JsonOption = False,
) -> None:
    """The class of clips, learned from the labelled clips of the lake.

    Example: motionlake classify walk_01 --lake mylake

    Labels for all clips that have none: motionlake classify --unlabelled --write-labels found.csv --lake mylake
    """
    from motionlake.retrieval.classes import LakeClassifier
    from motionlake.retrieval.labelled_clips import signed_clips
    from motionlake.retrieval.protocol import ClipFilter, Query

    if method not in METHODS:
        raise UserError(f"--method {method}: use one of {', '.join(METHODS)}")
    target = open_lake(lake)
    teachers = ClipFilter(dataset, split, dataset is None, min_quality=min_quality)
    with reading(target) as con:
        classifier = LakeClassifier(target, method=METHODS[method], k=k, scope=teachers, column=column)
        signed = signed_clips(con, column=column).clips
        queries = [named_query(con, target, name) for name in clips or ()]
        if unlabelled:
            named = {query.source for query in queries}
            queries += [Query(clip.clip) for clip in signed if clip.label is None and clip.clip not in named]
            notice(f"{len(queries)} clips, learned from {len(classifier.known.clips)}")
        elif not queries:
            raise UserError("classify: name a clip or a clip file, or give --unlabelled")
        found = classifier.classify(queries)
    if write_labels is not None:
        _write_labels(write_labels, found, signed, column)
    tell([asdict(each) for each in found], as_json=as_json)


def segment(
    lake: LakeOption,
    query: ClipArgument,
    teach: Annotated[
        list[str] | None,
        typer.Option("--dataset", help="Learn from this dataset (repeat it for more; default: all)."),
    ] = None,
    teach_clips: Annotated[
        list[str] | None, typer.Option("--labelled-clip", help="Learn from this clip (repeat it for more).")
    ] = None,
    column: LabelColumn = "label",
    mirrored: Annotated[bool, typer.Option(help="Learn from the mirrored clips too.")] = True,
    min_quality: MinQualityOption = None,
    method: SegmentationOption = "words",
    window: WindowOption = None,
    k: VotersOption = None,
    reach: ReachOption = None,
    unknown: Annotated[bool, typer.Option(help="Say unknown where no labelled clip is like it.")] = True,
    as_json: JsonOption = False,
) -> None:
    """Which class each part of a clip shows, learned from labelled clips.

    The answers are ranges of frames. Classes come from the segments (segments.csv) of clips; a clip without them
    counts as one range of its label, where its dataset or itself is named, or where the lake has no segments.

    Example: motionlake segment 14_20 --dataset cmu_exercises --lake mylake

    Of a file that is not in the lake: motionlake segment shots/new_take.bvh --dataset hdm05 --lake mylake
    """
    from motionlake.retrieval.segment_methods import config_of
    from motionlake.retrieval.segments import LakeSegmenter, Lessons

    target = open_lake(lake)
    for dataset in teach or ():
        check_dataset(dataset)
    config = config_of(method, window, k, reach, unknown=unknown)
    with reading(target) as con:
        names = [resolve_clip(con, name) for name in teach_clips or ()] or None
        segmenter = LakeSegmenter(target, Lessons(teach or None, names, column, mirrored, min_quality), config)
        found = segmenter.segment(named_query(con, target, query))
    tell([asdict(band) for band in found], as_json=as_json)


def cluster(
    lake: LakeOption,
    k: Annotated[str, typer.Option("--k", "-k", help="How many clusters, or auto.")] = "auto",
    dataset: DatasetOption = None,
    split: SplitOption = None,
    recorded_only: RecordedOnlyOption = False,
    min_quality: MinQualityOption = None,
    method: Annotated[
        str, typer.Option(help="fused (all that search compares), or signatures (the paper's).")
    ] = "fused",
    as_json: JsonOption = False,
) -> None:
    """Groups of similar clips; no labels are used.

    Clusters are numbered from 0, the largest first.

    Example: motionlake cluster --k 12 --dataset bandai1 --lake mylake
    """
    from motionlake.retrieval.clusters import clusters_of_lake
    from motionlake.retrieval.protocol import ClipFilter

    target = open_lake(lake)
    if k != "auto" and not k.isdecimal():
        raise UserError(f"--k {k}: give a number of clusters, or auto")
    with reading(target) as con:
        wanted = None if k == "auto" else int(k)
        scope = ClipFilter(dataset, split, recorded_only, min_quality=min_quality)
        rows, silhouette = clusters_of_lake(con, target, wanted, scope, method)
    notice(f"{len({row.cluster for row in rows})} clusters of {len(rows)} clips, silhouette {silhouette:.3f}")
    tell([asdict(row) for row in rows], as_json=as_json)


def _write_labels(file: Path, found: Sequence[ClassifiedClip], signed: Sequence[SignedClip], column: str) -> None:
    """Rows as labels.csv has them: paths as they stand below the folder that was ingested."""
    known = {clip.clip: clip for clip in signed}
    rows = []
    for each in found:
        clip = known.get(each.clip)
        path, dataset = (clip.path, clip.dataset) if clip else (typed(each.clip), "")
        rows.append([path, each.label, f"{each.confidence:.4g}", dataset])
    write_csv(file, ["file", column, "confidence", "dataset"], rows)
