"""The neighbour graph of a lake whose parts are merged: the same lists, under the names that the parts have now."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
from motionlake.columns import read_parquet
from motionlake.lake.catalog import fetch, load_rows, table_of
from motionlake.lake.config import config_hash
from motionlake.lake.file_list import FileSums, sums_of
from motionlake.lake.integrity import sound
from motionlake.lake.parts import write_part
from motionlake.stages.graph import GRAPH, made_of
from motionlake.stages.graph_before import FOOTER, footer_of
from motionlake.stages.reader import LakeReader
from motionlake.stages.stage import Shard, live_parts

Merged = Mapping[str, str]  # the part that each part went into
Follow = Callable[[LakeReader, Merged], list[FileSums]]
REPLACED_ROWS = pa.schema(
    [
        ("stage", pa.string()), ("key", pa.string()), ("part", pa.string()), ("dataset", pa.string()),
        ("rows", pa.int64()), ("bytes", pa.int64()), ("files", pa.list_(pa.string())),
    ]
)  # fmt: skip


def follow_graph(before: LakeReader) -> Follow | None:
    """What writes the graph anew once the catalog names merged parts; None where there is no graph."""
    old = [row for row in fetch(before.con, "shards", {"stage": GRAPH.name}) if row["state"] == "ok"]
    if not old:
        return None
    current = bool(GRAPH.every(before)) and not GRAPH.plan(before)
    made_then = made_of(before, live_parts(before))

    def follow(after: LakeReader, merged: Merged) -> list[FileSums]:
        tables = [_read(after, row["files"][0]) for row in old]
        if current:
            shards = GRAPH.every(after)
            tables = _regrouped(after, shards, tables)
        else:  # due as it was: what it tells of clips that stay is of use still
            shards = [_renamed(row, merged) for row in old]
        made = made_of(after, live_parts(after))
        rows, written = [], []
        for shard, table in zip(shards, tables, strict=True):
            said = json.loads((table.schema.metadata or {}).get(FOOTER.encode(), b'{"settings": "", "made": {}}'))
            footer = footer_of(said["settings"], _told(said["made"], made_then, made, merged))
            file = f"{GRAPH.folders[0]}/{shard.key[:16]}.parquet"
            column = pa.repeat(pa.scalar(shard.key), table.num_rows)
            table = table.set_column(table.schema.get_field_index("key"), table.schema.field("key"), column)
            size = write_part(after.lake.path(file), table.replace_schema_metadata(None), {"key": shard.key, **footer})
            rows.append(replaced(shard, table.num_rows, size, [file]))
            written.append(sums_of(after.lake, file))
        load_rows(after.con, "replace_shards", table_of(rows, REPLACED_ROWS), {"stage": GRAPH.name})
        return written

    return follow


def replaced(shard: Shard, rows: int, size: int, files: Sequence[str]) -> dict[str, Any]:
    """A row of the manifest for a shard whose results were written anew."""
    return {
        "stage": shard.stage, "key": shard.key, "part": shard.part, "dataset": shard.dataset, "rows": rows,
        "bytes": size, "files": list(files),
    }  # fmt: skip


def _read(at: LakeReader, file: str) -> pa.Table:
    return read_parquet(sound(at.lake, file))


def _regrouped(at: LakeReader, shards: Sequence[Shard], tables: Sequence[pa.Table]) -> list[pa.Table]:
    """The rows of tables by the shards that hold their clips now, as the stage would write them: by method, by clip."""
    whole = pa.concat_tables(tables)
    places = {part: place for place, shard in enumerate(shards) for part in shard.spec["parts"]}
    clips: list[list[str]] = [[] for _ in shards]
    for row in fetch(at.con, "clips_with_parts"):
        clips[places[row["part"]]].append(row["clip"])
    methods = list(dict.fromkeys(whole["method"].to_pylist()))
    found = []
    for own in clips:
        rows = whole.filter(pc.field("clip").isin(own))
        pieces = [rows.filter(pc.field("method") == method).sort_by("node") for method in methods]
        found.append(pa.concat_tables(pieces).replace_schema_metadata(whole.schema.metadata))
    return found


def _renamed(row: Mapping[str, Any], merged: Merged) -> Shard:
    parts = sorted({merged.get(part, part) for part in row["part"].split("+")})
    key = config_hash(GRAPH.name, "merged", row["key"], parts)
    return Shard(GRAPH.name, key, "+".join(parts), row["dataset"], {}, 0)


def _told(said: Mapping[str, str], then: Mapping[str, str], now: Mapping[str, str], merged: Merged) -> dict[str, str]:
    """What a footer says that parts were made of, for merged parts: as now, where all that it knows is as it was."""
    told = {part: made for part, made in said.items() if part not in merged}
    stale = {merged[part] for part, made in said.items() if part in merged and then.get(part) != made}
    known = {merged[part] for part in said if part in merged} - stale
    return told | {part: now[part] for part in known}
