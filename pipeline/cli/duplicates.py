"""motionlake duplicates."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer
from motionlake.cli.common import DatasetOption, JsonOption, LakeOption, RecordedOnlyOption, tell
from motionlake.lake.catalog import reading
from motionlake.lake.layout import check_dataset, open_lake


def duplicates(
    lake: LakeOption,
    within: DatasetOption = None,
    across: Annotated[bool, typer.Option("--across", help="Only pairs of clips of two datasets.")] = False,
    mirrored: Annotated[bool, typer.Option("--mirrored", help="Mirror images too.")] = False,
    real: RecordedOnlyOption = False,
    max_distance: Annotated[
        float | None,
        typer.Option(
            "--max-distance",
            help="How much clips may differ: 0.1 by a tenth of their movement (default).",
            show_default=False,
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Clips that are one recording: exported again, resampled, cut, or mirrored.

    Example: motionlake duplicates --across --mirrored --lake mylake
    """
    from motionlake.deep_motifs.duplicates import MAX_DISTANCE
    from motionlake.retrieval.duplicates import near_duplicates

    target = open_lake(lake)
    if within is not None:
        check_dataset(within)
    with reading(target) as con:
        found = near_duplicates(
            con,
            target,
            max_distance=MAX_DISTANCE if max_distance is None else max_distance,
            within=within,
            across=across,
            mirrored=mirrored,
            real=real,
        )
    tell([asdict(pair) for pair in found], as_json=as_json)
