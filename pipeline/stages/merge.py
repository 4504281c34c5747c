"""Merging small parts: one shard makes of several frames parts, and of all that stages derived from these, one each.

What it makes is what the stages would have made had all the files been taken in at once: the key of the merged frames
follows from the files, and the keys of the other parts from this one. So nothing is due afterwards, and a merged part
that is damaged is made again like any other.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import pyarrow as pa
from motionlake import sql
from motionlake.lake.catalog import Connection, load_rows, table_of
from motionlake.lake.config import load_config
from motionlake.lake.file_list import list_files
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.lake.merging import Order, clips_in, merge_parts
from motionlake.stages.merge_graph import follow_graph
from motionlake.stages.merge_shortlist import follow_shortlist
from motionlake.stages.reader import LakeReader
from motionlake.stages.registry import STAGES
from motionlake.stages.stage import PartStage, Shard, ShardResult, ShardStage

MERGED_ROWS: Final = pa.schema(
    [
        ("stage", pa.string()), ("part", pa.string()), ("merged", pa.string()), ("key", pa.string()),
        ("files", pa.list_(pa.string())), ("bytes", pa.int64()),
    ]
)  # fmt: skip
TABLES: Final = "merge_parts_of_"  # statements, one a table that names parts
_FOLLOW: Final = (follow_graph, follow_shortlist)  # stages whose results name parts of the whole lake


class Merge(ShardStage):
    """Shards of `motionlake compact`. Their specs hold:

    clips: by part that is merged, the path of the source file of each of its clips.
    keys: of what is made, by stage.
    files: of each file that is made its stage, and what it is made of by part.
    """

    name = "merge"
    about = "small parts to large ones"

    def due(self, at: LakeReader) -> int:
        return 0

    def plan(self, at: LakeReader) -> list[Shard]:
        return []

    def run(self, root: Path, shard: Shard, /) -> ShardResult:
        started = time.perf_counter()
        lake, spec = Lake(root), shard.spec
        order = list(_order(lake, shard))
        made: dict[str, int] = {}
        for file, (stage, parts) in sorted(spec["files"].items()):
            paths = {part: sound(lake, source) for part, source in parts.items()}
            maker = STAGES[stage]
            merge = maker.merge if isinstance(maker, PartStage) else merge_parts
            merge(paths, order, lake.path(file), shard.part, spec["keys"][stage])
            made[file] = lake.path(file).stat().st_size
        return ShardResult(shard, len(order), sum(made.values()), tuple(made), time.perf_counter() - started)

    def load(self, con: Connection, root: Path, results: Sequence[ShardResult], /) -> None:
        """Let the catalog name the merged parts instead of those that they are made of."""
        lake = Lake(root)
        config = load_config(lake.config_file)
        rows = table_of([row for result in results for row in _rows(result)], MERGED_ROWS)
        merged = dict(zip(rows["part"].to_pylist(), rows["merged"].to_pylist(), strict=True))
        following = [follow(LakeReader(con, lake, config)) for follow in _FOLLOW]
        for name in sql.statements():
            if name.startswith(TABLES):
                load_rows(con, name, rows)
        load_rows(con, "merge_shards", rows)
        after = LakeReader(con, lake, config)
        for follow in following:
            if follow is not None:
                list_files(con, follow(after, merged))


MERGE: Final = Merge()


def _order(lake: Lake, shard: Shard) -> Order:
    """Clips as the stage "frames" writes them: by the path of their file, then as the file holds them."""
    found: list[tuple[str, int, str, str]] = []
    for part, paths in shard.spec["clips"].items():
        clips = clips_in(sound(lake, lake.frames_part(shard.dataset, part)))
        found += [(paths[clip], place, clip, part) for place, clip in enumerate(clips) if clip in paths]
    return [(clip, part) for _, _, clip, part in sorted(found)]


def _rows(result: ShardResult) -> Iterator[Mapping[str, Any]]:
    """What merged parts replace, a row a stage and part."""
    shard, sizes = result.shard, {file.file: file.size for file in result.sums}
    for stage, key in shard.spec["keys"].items():
        files = [file for file, (of, _) in sorted(shard.spec["files"].items()) if of == stage]
        size = sum(sizes[file] for file in files) if files else None
        for part in shard.spec["clips"]:
            yield {"stage": stage, "part": part, "merged": shard.part, "key": key, "files": files, "bytes": size}


def parts_in(shards: Iterable[Shard]) -> int:
    """How many parts shards merge."""
    return sum(len(shard.spec["clips"]) for shard in shards)
