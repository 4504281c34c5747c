"""motionlake classify."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from motionlake.cli.common import DatasetOption, JsonOption, LabelColumn, LakeOption, notice, tell
from motionlake.errors import UserError
from motionlake.formats import is_clip
from motionlake.lake.catalog import reading
from motionlake.lake.layout import check_dataset, open_lake
from motionlake.lake.resolve import resolve_clip

if TYPE_CHECKING:
    from motionlake.deep_motifs.classification import Method
    from motionlake.retrieval.labelling.classes import ClassifiedClip
    from motionlake.retrieval.labelling.signed import SignedClip

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
    from motionlake.retrieval.labelling.classes import LakeClassifier
    from motionlake.retrieval.labelling.signed import signed_clips

    if method not in METHODS:
        raise UserError(f"--method {method}: use one of {', '.join(METHODS)}")
    target = open_lake(lake)
    if dataset is not None:
        check_dataset(dataset)
    with reading(target) as con:
        classifier = LakeClassifier(con, target, method=METHODS[method], k=k, dataset=dataset, column=column)
        signed = signed_clips(con, column=column).clips
        files = [query for query in clips or () if Path(query).is_file() and is_clip(Path(query))]
        names = [resolve_clip(con, query) for query in clips or () if query not in files]
        if unlabelled:
            names += [clip.clip for clip in signed if clip.label is None and clip.clip not in names]
            notice(f"{len(names)} clips, learned from {len(classifier.known.clips)}")
        elif not (names or files):
            raise UserError("classify: name a clip or a clip file, or give --unlabelled")
        found = [*classifier.clips(names), *(classifier.file(Path(file)) for file in files)]
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
