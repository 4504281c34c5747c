"""Taking source folders in: what is to be read, and afterwards what is said of clips."""

from __future__ import annotations

from collections.abc import Sequence

import pyarrow as pa
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch, load_rows, reading, run_sql, table_of, writing
from motionlake.lake.config import LakeConfig
from motionlake.lake.layout import Lake
from motionlake.motion.rigs import load_rigs
from motionlake.stages.frames import FRAMES, SOURCE_ROWS, Intake, intake_of
from motionlake.stages.labels import LabelError, LabelReport, apply_labels, labels_hash
from motionlake.stages.reader import lake_reader
from motionlake.stages.sources import Hashing, Root, check_apart, known_roots, options_json

KEY_ROWS = pa.schema({"stage": pa.string(), "key": pa.string()})


def prepare(
    lake: Lake,
    config: LakeConfig,
    roots: Sequence[Root] | None = None,
    *,
    checksum: bool = False,
    retry_failed: bool = False,
    progress: Hashing | None = None,
) -> tuple[list[Intake], list[str]]:
    """Compare source folders (default: all that the lake knows) with the lake, and record folders that are new to it.

    Returns:
        What each comes to, and lines for people.

    Raises:
        UserError: a label file is not there, a rig map is none, or a folder holds paths that are another's.
    """
    with lake_reader(lake, config) as at:
        known = known_roots(at.con)
        roots = known if roots is None else roots
        named = [root for root in roots if root.options.rig is not None]
        if named or any(lake.rigs.glob("*.toml")):
            rigs = load_rigs(lake.rigs)  # a mistake in one is told of before anything is read
            for root in named:
                if root.options.rig not in rigs:
                    raise UserError(
                        f"{root.root}: is taken in with --rig {root.options.rig}, and there is no such map any more; "
                        f"put it back into {lake.rigs}, or undo the option with `motionlake ingest {root.root} "
                        f"--dataset {root.dataset} --rig auto --lake {lake.root}`"
                    )
        check_apart(at.con, [root.dataset for root in roots])
        for root in roots:
            labels_hash(root)  # first of all: a label file that is not there is a mistake
        found = [intake_of(at, root, checksum=checksum, retry_failed=retry_failed, progress=progress) for root in roots]
    _record(lake, [root for root in roots if root not in known], found)
    lines = [
        f"frames: {files} files failed before ({reason}); --retry-failed tries again"
        for one in found
        for files, reason in one.failed
    ]
    for one in found:
        if one.difference.again:
            reason = one.root.reason(config, lake, one.difference.before)
            lines.append(f"frames: {one.difference.again} files are read again, since {reason}")
    fresh = sum(sum(s.items for s in one.shards) - one.difference.again for one in found)
    return found, [*lines, f"frames: {max(fresh, 0)} new or changed files"]


def _record(lake: Lake, fresh: Sequence[Root], found: Sequence[Intake]) -> None:
    touched = [
        {"dataset": i.root.dataset, "path": f.path, "root": i.root.kept_base, "size": f.size, "mtime_ns": f.mtime_ns}
        for i in found
        for f in i.difference.touched
    ]
    dropped = [{"stage": FRAMES.name, "key": key} for one in found for key in one.dropped]
    if not (fresh or touched or dropped):
        return
    with writing(lake) as con:
        for root in fresh:
            _save_root(con, root, "")
        load_rows(con, "touch_sources", table_of(touched, SOURCE_ROWS))
        load_rows(con, "drop_shards", table_of(dropped, KEY_ROWS))


def finish(lake: Lake, found: Sequence[Intake]) -> tuple[list[LabelReport], int]:
    """Enter labels and segments once the files are read; returns what was said, and how many files stand rejected.

    A label file that cannot be read changes nothing, and is told of.
    """
    labels: list[LabelReport] = []
    with reading(lake) as con:
        before = {(r["dataset"], r["root"]): r["labels_hash"] for r in fetch(con, "roots")}
    changed = any(one.shards for one in found)
    for root in (one.root for one in found):
        said = labels_hash(root)
        if changed or before.get((root.dataset, root.root)) != said:
            try:
                with writing(lake) as con:
                    labels += apply_labels(con, root)
                    _save_root(con, root, said)
            except LabelError as error:
                labels.append(LabelReport("", 0, 0, fault=str(error)))
    roots = [{"dataset": one.root.dataset, "root": one.root.kept_base} for one in found]
    with reading(lake) as con:
        rejects = sum(row["rejects"] for root in roots for row in fetch(con, "count_rejects", root))
    return labels, rejects


def _save_root(con: Connection, root: Root, labels_hash: str) -> None:
    parameters = {"dataset": root.dataset, "root": root.root, "options": options_json(root.options)}
    run_sql(con, "save_root", {**parameters, "labels_hash": labels_hash})
