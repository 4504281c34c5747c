"""Stages whose shards make clips: the Parquet parts and rows of those, and what goes with clips that they replace."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections import defaultdict
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np
import pyarrow as pa
from motionlake import sql
from motionlake.lake import frames, raw
from motionlake.lake.catalog import Connection, fetch, load_rows, run_sql, table_of
from motionlake.lake.config import FramesConfig
from motionlake.lake.layout import Lake
from motionlake.lake.parts import PartWriter, check_part, replacing
from motionlake.motion.clip import SourceClip
from motionlake.stages.stage import Shard, ShardResult, ShardStage

if TYPE_CHECKING:
    from motionlake.motion.canonicalise import CanonicalMotion
    from motionlake.motion.rig_joints import RigJoint

_S, _F, _I = pa.string(), pa.float64(), pa.int64()
CLIP_ROWS: Final = pa.schema(
    {
        "clip": _S, "dataset": _S, "path": _S, "body": _S, "format": _S, "rig": _S, "frames": _I, "fps": _F,
        "up": _S, "metres_per_unit": _F, "body_height": _F, "twist": pa.bool_(), "filled": pa.list_(_S),
        "repaired": _I, "fk_error": _F, "rest_offsets": pa.list_(pa.float32()), "layout": _S,
        "skeleton": _S, "notes": pa.list_(_S), "licence": _S, "content_hash": _S, "part": _S,
    }
)  # fmt: skip
BODY_ROWS: Final = {
    "layouts": pa.schema(
        {
            "layout": _S, "kind": _S, "fixed_axes": pa.bool_(), "joints": pa.list_(_S),
            "parents": pa.list_(pa.int32()), "channels": pa.list_(pa.list_(_S)),
        }
    ),
    "skeletons": pa.schema({"skeleton": _S, "offsets": pa.list_(_F), "axes": pa.list_(_F), "ends": pa.list_(_F)}),
}  # fmt: skip
ORPHANS: Final = "forget_orphans_of_"  # statements, one a table


def forget_orphans(con: Connection) -> None:
    """Forget what was derived from clips that are gone or have moved to another part, and the shards of parts that are
    gone: each table has a statement that forgets its own."""
    for name in sql.statements():
        if name.startswith(ORPHANS):
            run_sql(con, name)


class ClipParts:
    """The parts of one shard that makes clips, canonical frames and raw channels, opened when a clip needs them.

    Attributes:
        rows: for the catalog, by table.
        stack: of what ends with them.
    """

    def __init__(self, lake: Lake, shard: Shard, stack: ExitStack) -> None:
        self.rows: dict[str, list[dict[str, Any]]] = defaultdict(list)
        self._lake, self._shard, self.stack = lake, shard, stack
        self._frames = lake.frames_part(shard.dataset, shard.part)
        self._writers: dict[str, PartWriter] = {}
        self._footer: dict[str, dict[str, Any]] = {}
        self._rigs = frames.RigsFooter()

    @property
    def written(self) -> dict[str, int]:
        """Rows in each file, by its name relative to the lake."""
        return {name: writer.rows for name, writer in sorted(self._writers.items())}

    def write(
        self, name: str, clip: SourceClip, motion: CanonicalMotion, config: FramesConfig, joints: Sequence[RigJoint],
        **said: Any,
    ) -> None:  # fmt: skip
        """Append one clip; clips must come by name. `said`: the columns of `clips` that its motion does not tell."""
        part = self._shard.part
        layout, skeleton = raw.layout_row(clip.hierarchy), raw.skeleton_row(clip.hierarchy)
        canonical = frames.Frames(name, clip.fps, motion.rotations, motion.positions)
        self._footer[name] = frames.footer_clip(clip.fps, motion.rest_offsets)
        self._rigs.add(name, said["rig"], joints)
        self._append(self._frames, frames.to_table(canonical, part, config.position_step, config.rotation_step))
        height = motion.body_height / motion.metres_per_unit
        self._append(self._lake.raw_part(layout["layout"], part), raw.to_table(name, part, clip, height))
        for table, row in (("layouts", layout), ("skeletons", skeleton)):
            if row not in self.rows[table]:
                self.rows[table].append(row)
        row = {
            "clip": name, "dataset": self._shard.dataset, "body": clip.body, "frames": len(motion.positions),
            "fps": clip.fps, "up": motion.up, "metres_per_unit": motion.metres_per_unit,
            "body_height": motion.body_height, "twist": motion.twist, "filled": list(motion.filled),
            "repaired": clip.repaired, "fk_error": motion.fk_error,
            "rest_offsets": motion.rest_offsets.astype(np.float32).ravel(), "layout": layout["layout"],
            "skeleton": skeleton["skeleton"], "part": part, **said,
        }  # fmt: skip
        self.rows["clips"].append(row)

    def _append(self, name: str, table: pa.Table) -> None:
        if name not in self._writers:
            temporary = self.stack.enter_context(replacing(self._lake.path(name)))
            writer = PartWriter(temporary, table.schema, {"key": self._shard.key})
            self.stack.callback(self._close, name, writer)
            self._writers[name] = writer
        self._writers[name].append(table)

    def _close(self, name: str, writer: PartWriter) -> None:
        said = {**frames.motion_footer(self._footer), **self._rigs.metadata()}
        writer.close(said if name == self._frames else {})


class ClipStage(ShardStage):
    """A stage whose shards make clips.

    Attributes:
        schemas: of its rows for the catalog, by table, in the order in which `load_TABLE` enters them.
        replaces: the table of those whose rows say which source files (dataset, path) are made anew.
    """

    schemas: ClassVar[Mapping[str, pa.Schema]]
    replaces: ClassVar[str]
    folders = ("frames", "raw")
    cut_is_kept = True

    @abstractmethod
    def make(self, lake: Lake, shard: Shard, parts: ClipParts) -> None:
        """Write the clips of a shard to its parts, and add what else the catalog needs to their rows."""

    def run(self, root: Path, shard: Shard, /) -> ShardResult:
        """Write one frames part, and a raw part a layout."""
        started = time.perf_counter()
        lake = Lake(root)
        with ExitStack() as stack:
            parts = ClipParts(lake, shard, stack)
            self.make(lake, shard, parts)
        return ShardResult(
            shard,
            rows=sum(row["frames"] for row in parts.rows["clips"]),
            size=sum(check_part(lake.path(name), rows) for name, rows in parts.written.items()),
            files=tuple(parts.written),
            seconds=time.perf_counter() - started,
            rejected=len(parts.rows["rejects"]),
            tables={table: table_of(parts.rows[table], schema) for table, schema in self.schemas.items()},
        )

    def load(self, con: Connection, root: Path, results: Sequence[ShardResult], /) -> None:
        """Replace the rows of every source file in the results; what was derived from them goes too."""
        rows = {table: pa.concat_tables([r.tables[table] for r in results]) for table in self.schemas}
        before = held(con)
        load_rows(con, "forget_sources", rows[self.replaces])
        replaced = held(con) != before
        for table, entered in rows.items():
            load_rows(con, f"load_{table}", entered, {"clips": rows["clips"]["clip"].to_pylist()})
        if replaced:  # to look through all tables takes long where there are many clips
            forget_orphans(con)


def held(con: Connection) -> tuple[int, int]:
    """Clips and source files of the lake."""
    return fetch(con, "count_clips")[0]["clips"], fetch(con, "count_sources")[0]["sources"]
