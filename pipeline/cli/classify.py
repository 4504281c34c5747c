"""motionlake classify."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from motionlake.cli.common import (
    DatasetOption,
    JsonOption,
    LabelColumn,
    LakeOption,
    SplitOption,
    asked_for,
    notice,
    scope_of,
    tell,
)
from motionlake.errors import UserError
from motionlake.lake.catalog import reading
from motionlake.lake.layout import open_lake

if TYPE_CHECKING:
    from motionlake.deep_motifs.classification import Method
    from motionlake.retrieval.classes import ClassifiedClip
    from motionlake.retrieval.labelled_clips import SignedClip

METHODS: dict[str, Method] = {"knn": "knn", "one-vs-all": "one_vs_all"}


def classify(
    lake: LakeOption,
    clips: Annotated[
        list[str] | None, typer.Argument(help="Clips of the lake, or clip files.", show_default=False)
    ] = None,
    unlabelled: Annotated[bool, typer.Option("--unlabelled", help="Also every clip without a label.")] = False,
    method: Annotated[str, typer.Option(help="knn, or one-vs-all (a classifier for each class).")] = "knn",
    k: Annotated[int, typer.Option("-k", min=1, help="knn: nearest clips that vote.")] = 5,
    dataset: DatasetOption = None,
    split: SplitOption = None,
    column: LabelColumn = "label",
    write_labels: Annotated[
        Path | None, typer.Option("--write-labels", help="Write a labels.csv of the answers.", show_default=False)
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """The class of clips, learned from the labelled clips of the lake.

    Example: motionlake classify walk_01 --lake mylake

    Labels for all clips that have none: motionlake classify --unlabelled --write-labels found.csv --lake mylake
    """
    from motionlake.retrieval.classes import LakeClassifier
    from motionlake.retrieval.labelled_clips import signed_clips
    from motionlake.retrieval.protocol import Query

    if method not in METHODS:
        raise UserError(f"--method {method}: use one of {', '.join(METHODS)}")
    target = open_lake(lake)
    teachers = scope_of(dataset, split, recorded_only=dataset is None)
    with reading(target) as con:
        classifier = LakeClassifier(target, method=METHODS[method], k=k, scope=teachers, column=column)
        signed = signed_clips(con, column=column).clips
        queries = [asked_for(con, target, query) for query in clips or ()]
        if unlabelled:
            named = {query.source for query in queries}
            queries += [Query(clip.clip) for clip in signed if clip.label is None and clip.clip not in named]
            notice(f"{len(queries)} clips, learned from {len(classifier.known.clips)}")
        elif not queries:
            raise UserError("classify: name a clip or a clip file, or give --unlabelled")
        found = classifier.classify(queries)
    if write_labels is not None:
        _write(write_labels, found, signed, column)
    tell([each.as_row() for each in found], as_json=as_json)


def _write(file: Path, found: Sequence[ClassifiedClip], signed: Sequence[SignedClip], column: str) -> None:
    """Rows as labels.csv has them: paths as they stand below the folder that was ingested."""
    known = {clip.clip: clip for clip in signed}
    try:
        with file.open("w", newline="", encoding="utf-8") as handle:
            writer = csv.writer(handle)
            writer.writerow(["file", column, "confidence", "dataset"])
            for each in found:
                clip = known.get(each.clip)
                path, dataset = (clip.path, clip.dataset) if clip else (each.clip, "")
                writer.writerow([path, each.label, f"{each.confidence:.4g}", dataset])
    except OSError as error:
        raise UserError(f"{file}: cannot be written ({error.strerror})") from error
