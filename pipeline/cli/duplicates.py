"""motionlake duplicates: clips that are one recording."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer
from motionlake.cli._answers import MirroredOption
from motionlake.cli._output import tell
from motionlake.cli.common import (
    DatasetOption,
    JsonOption,
    LakeOption,
    MinQualityOption,
    RecordedOnlyOption,
    SplitOption,
    option,
)
from motionlake.lake.catalog import reading
from motionlake.lake.layout import open_lake


def duplicates(
    lake: LakeOption,
    dataset: DatasetOption = None,
    split: SplitOption = None,
    recorded_only: RecordedOnlyOption = False,
    min_quality: MinQualityOption = None,
    mirrored: MirroredOption = False,
    across: Annotated[bool, typer.Option("--across", help="Only pairs of clips of two datasets.")] = False,
    max_distance: Annotated[
        float | None,
        option("--max-distance", help="How much clips may differ: 0.1 by a tenth of their movement (default)."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Clips that are one recording: exported again, resampled, cut, or mirrored.

    Example: motionlake duplicates --across --mirrored --lake mylake
    """
    from motionlake.deep_motifs.duplicates import MAX_DISTANCE
    from motionlake.retrieval.duplicates import near_duplicates
    from motionlake.retrieval.protocol import Scope

    target, scope = open_lake(lake), Scope(dataset, split, recorded_only, mirrored, min_quality=min_quality)
    most = MAX_DISTANCE if max_distance is None else max_distance
    with reading(target) as con:
        found = near_duplicates(con, target, scope, max_distance=most, across=across)
    tell([asdict(pair) for pair in found], as_json=as_json)
