"""motionlake cluster."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer
from motionlake.cli.common import (
    DatasetOption,
    JsonOption,
    LakeOption,
    RecordedOnlyOption,
    SplitOption,
    notice,
    scope_of,
    tell,
)
from motionlake.errors import UserError
from motionlake.lake.catalog import reading
from motionlake.lake.layout import open_lake


def cluster(
    lake: LakeOption,
    k: Annotated[str, typer.Option("--k", "-k", help="How many clusters, or auto.")] = "auto",
    dataset: DatasetOption = None,
    split: SplitOption = None,
    recorded_only: RecordedOnlyOption = False,
    as_json: JsonOption = False,
) -> None:
    """Groups of similar clips; no labels are used.

    Clusters are numbered from 0, the largest first.

    Example: motionlake cluster --k 12 --dataset bandai1 --lake mylake
    """
    from motionlake.retrieval.classes import clusters_of_lake

    target, scope = open_lake(lake), scope_of(dataset, split, recorded_only)
    if k != "auto" and not k.isdecimal():
        raise UserError(f"--k {k}: give a number of clusters, or auto")
    with reading(target) as con:
        rows, silhouette = clusters_of_lake(con, None if k == "auto" else int(k), scope)
    notice(f"{len({row.cluster for row in rows})} clusters of {len(rows)} clips, silhouette {silhouette:.3f}")
    tell([asdict(row) for row in rows], [row.as_row() for row in rows], as_json=as_json)
