"""Merge small parts, and give back the room of what serves no more."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from motionlake.jobs.session import Session
from motionlake.jobs.shards import with_inputs
from motionlake.lake.catalog import fetch, reading, writing
from motionlake.lake.config import load_config
from motionlake.lake.file_list import list_files
from motionlake.lake.layout import Lake
from motionlake.lake.space import blocks_of, forget_models, rewrite_catalog, superseded
from motionlake.lake.working import serve
from motionlake.stages.compact import CLIPS, plan
from motionlake.stages.merge import MERGE, parts_in
from motionlake.stages.reader import lake_reader
from motionlake.stages.stage import ShardResult

ENTER_EVERY: Final = 60.0  # seconds; what a killed command has merged since its catalog was served is merged again


@dataclass
class Compacted:
    """What a lake was and is.

    Attributes:
        parts: frames parts that were merged, and how many they became.
        files: Parquet parts of all stages, before and after; with the bytes of both, and those of the catalog.
        failed: merges that failed, with the reason of the last.
        models: versions that were removed.
        left: by reason, how many small parts stay as they are.
    """

    parts: tuple[int, int] = (0, 0)
    files: tuple[int, int] = (0, 0)
    bytes: tuple[int, int] = (0, 0)
    catalog_bytes: tuple[int, int] = (0, 0)
    failed: int = 0
    reason: str = ""
    models: list[str] = field(default_factory=list)
    left: Mapping[str, int] = field(default_factory=dict)


def compact(session: Session, most: int = CLIPS, *, vacuum: bool = False, keep: int = 0) -> Compacted:
    """Merge small parts into parts of at most `most` clips, and write the catalog anew where much of it is empty.

    `vacuum`: write it anew in any case, and remove the versions of models that nothing uses, but for the `keep` newest
    superseded ones of each kind. Replaced files go as the session ends, or once nobody reads the lake.
    """
    lake = session.lake
    with session.reader() as at:
        planned = plan(at, most)
        models = superseded(at.con, keep) if vacuum else []
    before, catalog = _counted(lake), lake.catalog.stat().st_size
    found = Compacted(left=planned.left, models=models)
    waiting: list[ShardResult] = []
    entered, patience = time.monotonic(), ENTER_EVERY
    done = 0
    for shard, result in session.remade(MERGE, with_inputs(lake, planned.shards)):
        if not isinstance(result, ShardResult):
            found.failed, found.reason = found.failed + 1, f"{type(result).__name__}: {result}"
            continue
        waiting.append(result)
        done += parts_in([shard])
        if time.monotonic() - entered > patience:
            started = time.monotonic()
            _enter(lake, waiting)
            waiting, entered = [], time.monotonic()
            patience = max(ENTER_EVERY, 10 * (entered - started))
    _enter(lake, waiting)
    if models:
        forget_models(lake, models)
    serve(lake)
    if vacuum or blocks_of(lake).many:
        rewrite_catalog(lake)
    after = _counted(lake)
    found.parts = done, len(planned.shards) - found.failed
    found.files, found.bytes = (before[0], after[0]), (before[1], after[1])
    found.catalog_bytes = catalog, lake.catalog.stat().st_size
    return found


def outlook(lake: Lake, most: int = CLIPS, *, vacuum: bool = False, keep: int = 0) -> Compacted:
    """What `compact` would merge and remove, with the same arguments; it changes nothing."""
    with lake_reader(lake, load_config(lake.config_file)) as at:
        planned = plan(at, most)
        models = superseded(at.con, keep) if vacuum else []
    files, size = _counted(lake)
    replaced = sum(len(parts) for shard in planned.shards for _, parts in shard.spec["files"].values())
    made = sum(len(shard.spec["files"]) for shard in planned.shards)
    catalog = lake.catalog.stat().st_size
    return Compacted(
        (parts_in(planned.shards), len(planned.shards)), (files, files - replaced + made), (size, size),
        (catalog, catalog), models=models, left=planned.left,
    )  # fmt: skip


def _enter(lake: Lake, results: list[ShardResult]) -> None:
    """Let the catalog name what was merged, in one transaction."""
    if results:
        with writing(lake) as con:
            MERGE.load(con, lake.root, sorted(results, key=lambda result: result.shard.key))
            list_files(con, [file for result in results for file in result.sums])


def _counted(lake: Lake) -> tuple[int, int]:
    with reading(lake) as con:
        (row,) = fetch(con, "count_parts")
    return row["files"], row["bytes"]
