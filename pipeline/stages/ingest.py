"""Taking source folders in: what is to be read, and afterwards what is said of clips."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import pyarrow as pa
from motionlake.lake.catalog import Connection, fetch, load_rows, reading, run_sql, table_of, writing
from motionlake.lake.config import LakeConfig
from motionlake.lake.layout import Lake
from motionlake.stages.frames import FRAMES, SOURCE_ROWS, Cut, cut
from motionlake.stages.labels import LabelReport, apply_labels, labels_hash
from motionlake.stages.reader import lake_reader
from motionlake.stages.sources import Difference, Root, compare, known_roots, options_json
from motionlake.stages.stage import Shard

KEY_ROWS = pa.schema({"stage": pa.string(), "key": pa.string()})


@dataclass(frozen=True)
class Intake:
    """What source folders come to before they are read.

    Attributes:
        roots: the folders, with what they hold against what the lake knows of them.
        said: of each a hash of what its label files say.
        shards: what is to be read.
        notices: lines for people.
    """

    roots: list[tuple[Root, Difference]]
    said: list[str]
    shards: list[Shard]
    notices: list[str]


def prepare(
    lake: Lake,
    config: LakeConfig,
    roots: Sequence[Root] | None = None,
    *,
    checksum: bool = False,
    retry_failed: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Intake:
    """Compare source folders (default: all that the lake knows) with the lake, and record folders that are new to it.

    Raises:
        UserError: a label file is not there, or a folder holds paths that are another's.
    """
    with lake_reader(lake, config) as at:
        known = known_roots(at.con)
        roots = known if roots is None else roots
        said = [labels_hash(root) for root in roots]  # first of all: a label file that is not there is a mistake
        found: list[tuple[Root, Difference]] = []
        cuts: list[Cut] = []
        for root in roots:
            shaping = root.shaping_hash(config.frames, lake)
            difference = compare(
                at.con, lake, root, shaping, checksum=checksum, retry_failed=retry_failed, progress=progress
            )
            found.append((root, difference))
            cuts.append(cut(at, root, difference, shaping, retry_failed=retry_failed))
    _record(lake, found, [root for root in roots if root not in known], cuts)
    shards = [shard for one in cuts for shard in one.shards]
    failed = [
        f"frames: {files} files failed before ({reason}); --retry-failed tries again"
        for one in cuts
        for files, reason in one.failed
    ]
    again = [
        f"frames: {one.again} files are read again, since {root.reason(config.frames, lake, one.before)}"
        for root, one in found
        if one.again
    ]
    fresh = sum(s.items for s in shards) - sum(one.again for _, one in found)
    return Intake(found, said, shards, [*failed, *again, f"frames: {max(fresh, 0)} new or changed files"])


def _record(lake: Lake, found: Sequence[tuple[Root, Difference]], fresh: Sequence[Root], cuts: Sequence[Cut]) -> None:
    touched = [
        {"dataset": root.dataset, "path": f.path, "root": str(root.base), "size": f.size, "mtime_ns": f.mtime_ns}
        for root, difference in found
        for f in difference.touched
    ]
    dropped = [{"stage": FRAMES.name, "key": key} for one in cuts for key in one.dropped]
    if not (fresh or touched or dropped):
        return
    with writing(lake) as con:
        for root in fresh:
            _save_root(con, root, "")
        load_rows(con, "touch_sources", table_of(touched, SOURCE_ROWS))
        load_rows(con, "drop_shards", table_of(dropped, KEY_ROWS))


def finish(lake: Lake, intake: Intake) -> tuple[list[LabelReport], int]:
    """Enter labels and segments once the files are read; returns what was said, and how many files stand rejected."""
    labels: list[LabelReport] = []
    with reading(lake) as con:
        before = {(r["dataset"], r["root"]): r["labels_hash"] for r in fetch(con, "roots")}
    for (root, _), said in zip(intake.roots, intake.said, strict=True):
        if intake.shards or before.get((root.dataset, root.root)) != said:
            with writing(lake) as con:
                labels += apply_labels(con, root)
                _save_root(con, root, said)
    with reading(lake) as con:
        rejects = sum(
            r["rejects"]
            for root, _ in intake.roots
            for r in fetch(con, "count_rejects", {"dataset": root.dataset, "root": str(root.base)})
        )
    return labels, rejects


def _save_root(con: Connection, root: Root, labels_hash: str) -> None:
    parameters = {"dataset": root.dataset, "root": root.root, "options": options_json(root.options)}
    run_sql(con, "save_root", {**parameters, "labels_hash": labels_hash})
