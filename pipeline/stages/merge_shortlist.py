"""The shortlist of a large lake whose parts are merged: the same arrays, and the parts as they are called now."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Sequence

import pyarrow as pa
from motionlake.lake.catalog import fetch, load_rows, table_of
from motionlake.lake.config import config_hash
from motionlake.lake.file_list import FileSums, listed_in, sums_of
from motionlake.lake.layout import Lake
from motionlake.lake.parts import sync_folder
from motionlake.stages.merge_graph import REPLACED_ROWS, Follow, Merged, replaced
from motionlake.stages.reader import LakeReader
from motionlake.stages.shortlist import SHORTLIST
from motionlake.stages.shortlist_before import READ
from motionlake.stages.shortlist_files import CLIPS, file_of, read_clips, said_of, write_clips
from motionlake.stages.stage import Shard


def follow_shortlist(before: LakeReader) -> Follow | None:
    """What gives the shortlist its new name once the catalog names merged parts; None where there is none."""
    old = [row for row in fetch(before.con, "shards", {"stage": SHORTLIST.name}) if row["state"] == "ok"]
    if not old:
        return None
    (row,), whole = old, SHORTLIST.whole(before)
    current = whole is not None and whole.key == row["key"]

    def follow(after: LakeReader, merged: Merged) -> list[FileSums]:
        shard = SHORTLIST.whole(after) if current else None
        if shard is None:  # due as it was, and serves until it is made
            key = config_hash(SHORTLIST.name, "merged", row["key"], sorted(merged.items()))
            shard = Shard(SHORTLIST.name, key, row["part"], row["dataset"], {}, 0)
        listed, written = listed_in(after.con), []
        for file in row["files"]:
            target = file_of(shard.key, file.partition("-")[2])
            if file.endswith(f"-{CLIPS}"):
                _write_clips(after.lake, file, target, merged, shard.spec.get("moves", []))
                written.append(sums_of(after.lake, target))
            else:
                _link(after.lake, file, target)
                written.append(listed[file]._replace(file=target))
        size, files = sum(file.size for file in written), [file.file for file in written]
        (clips,) = fetch(after.con, "count_clips")
        rows = table_of([replaced(shard, clips["clips"], size, files)], REPLACED_ROWS)
        load_rows(after.con, "replace_shards", rows, {"stage": SHORTLIST.name})
        return written

    return follow


def _write_clips(lake: Lake, file: str, target: str, merged: Merged, moves: Sequence[str]) -> None:
    """The table of clips with its parts as they are called now, and the files of moves that it was made of."""
    table = read_clips(lake, [file])
    at = table.schema.get_field_index("part")
    parts = pa.array([merged.get(part, part) for part in table["part"].to_pylist()], pa.string())
    said = {**said_of(table), READ: json.dumps(sorted(moves))}
    write_clips(lake, target, table.set_column(at, "part", parts).replace_schema_metadata(said))


def _link(lake: Lake, file: str, target: str) -> None:
    """The same bytes under another name: a second name where the file system has such, else a copy."""
    path, other = lake.path(file), lake.path(target)
    other.unlink(missing_ok=True)
    try:
        os.link(path, other)
    except OSError:
        shutil.copy2(path, other)
    sync_folder(other.parent)
