"""Stage "frames": source files become canonical frames, raw channels and clip rows."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pyarrow as pa
from motionlake.errors import ClipError, UserError
from motionlake.formats import read_clips, reader_for
from motionlake.lake import raw
from motionlake.lake.catalog import Connection, fetch, load_rows, run_sql, table_of
from motionlake.lake.config import FramesConfig, config_hash
from motionlake.lake.layout import Lake
from motionlake.lake.parts import check_part
from motionlake.motion.clip import SourceClip
from motionlake.motion.rigs import RigMap, identify, load_rigs
from motionlake.stages.frame_parts import FrameParts
from motionlake.stages.orphans import forget_orphans
from motionlake.stages.reader import LakeReader
from motionlake.stages.shard import Shard, ShardResult, tables_of
from motionlake.stages.sources import (
    FRAMES_VERSION,
    Difference,
    IngestOptions,
    Root,
    SourceFile,
    compare,
    known_roots,
    options_from,
)

if TYPE_CHECKING:
    from motionlake.motion.canonicalise import CanonicalMotion

NAME = "frames"
SHARD_BYTES = 8 << 20  # of source files; a worker's memory grows with it
_S, _F, _I = pa.string(), pa.float64(), pa.int64()
CLIP_ROWS = pa.schema(
    {
        "clip": _S, "dataset": _S, "path": _S, "body": _S, "format": _S, "rig": _S, "frames": _I, "fps": _F,
        "up": _S, "metres_per_unit": _F, "body_height": _F, "twist": pa.bool_(), "filled": pa.list_(_S),
        "repaired": _I, "fk_error": _F, "rest_offsets": pa.list_(pa.float32()), "layout": _S,
        "skeleton": _S, "notes": pa.list_(_S), "licence": _S, "content_hash": _S, "part": _S,
    }
)  # fmt: skip
REJECT_ROWS = pa.schema({"dataset": _S, "path": _S, "line": _I, "reason": _S, "content_hash": _S})
SOURCE_ROWS = pa.schema(
    {
        "dataset": _S, "path": _S, "root": _S, "size": _I, "mtime_ns": _I, "content_hash": _S,
        "config_hash": _S, "part": _S,
    }
)  # fmt: skip
KEY_ROWS = pa.schema({"stage": _S, "key": _S})
SKELETON_ROWS = pa.schema({"skeleton": _S, "offsets": pa.list_(_F), "axes": pa.list_(_F), "ends": pa.list_(_F)})
LAYOUT_ROWS = pa.schema(
    {
        "layout": _S, "kind": _S, "fixed_axes": pa.bool_(), "joints": pa.list_(_S),
        "parents": pa.list_(pa.int32()), "channels": pa.list_(pa.list_(_S)),
    }
)  # fmt: skip


class FramesStage:
    """Canonical frames and raw channels of source files; `motionlake ingest` names the folders, `run` looks again."""

    name = NAME
    version = FRAMES_VERSION
    upstream = ()
    about = "source files to canonical frames in Parquet"
    model = None
    tables = ("sources", "rejects", "clips", "layouts", "skeletons", "segments")
    folders = ("frames", "raw")
    by_name = False

    def plan(self, at: LakeReader) -> list[Shard]:
        cuts = []
        for root in known_roots(at.con):
            shaping = root.shaping_hash(at.config.frames, at.lake)
            cuts.append(cut(at, root, compare(at.con, at.lake, root, shaping), shaping))
        return [shard for found in cuts for shard in found.shards]

    def due(self, at: LakeReader) -> int:
        """Planned shards that have not run; folders are not searched."""
        return sum(r["state"] == "planned" for r in fetch(at.con, "shards", {"stage": NAME}))

    def lacking(self, at: LakeReader) -> str | None:
        return None

    def at_once(self, at: LakeReader) -> bool:
        return False

    def run(self, root: Path, shard: Shard, /) -> ShardResult:
        """Read, solve and canonicalise every file of a shard; write one frames part and a raw part a layout."""
        return _run(root, shard)

    def load(self, con: Connection, root: Path, results: Sequence[ShardResult], /) -> None:
        """Replace the rows of every source file in the results; what was derived from them goes too."""
        sources = tables_of(results, "sources")
        load_rows(con, "forget_sources", sources)
        for table in ("sources", "clips", "rejects", "layouts", "skeletons"):
            load_rows(con, f"load_{table}", tables_of(results, table))
        forget_orphans(con)


FRAMES: Final = FramesStage()


@dataclass(frozen=True)
class Cut:
    """The shards of a root: those that a run which was cut short left, then new ones.

    Attributes:
        dropped: keys of planned shards whose files have changed since.
        failed: (files, reason) of shards that failed before and are left alone.
    """

    shards: list[Shard]
    dropped: list[str]
    failed: list[tuple[int, str]]


def cut(at: LakeReader, root: Root, difference: Difference, shaping: str, *, retry_failed: bool = False) -> Cut:
    """What of a root is to be read, in the shards in which it was planned before, where it was."""
    rest = {(f.path, f.content_hash): f for f in difference.changed}
    found = Cut([], [], [])
    for row in fetch(at.con, "unfinished_shards", {"dataset": root.dataset}):
        shard = _shard_from(row)
        if shard.spec["base"] != str(root.base):
            continue
        wanted = [(f["path"], f["content_hash"]) for f in shard.spec["files"]]
        if shard.spec["shaping_hash"] != shaping or not all(w in rest for w in wanted):
            found.dropped.append(shard.key)
            continue
        for file in wanted:
            del rest[file]
        if row["state"] == "planned" or retry_failed:
            found.shards.append(shard)
        else:
            found.failed.append((shard.items, row["reason"]))
    found.shards.extend(_new_shards(root, list(rest.values()), at.config.frames, shaping))
    return found


def _new_shards(root: Root, changed: Sequence[SourceFile], config: FramesConfig, shaping_hash: str) -> list[Shard]:
    """Cut new and changed files, by path, into shards of some MB of source each.

    The cut depends on the files alone, so any number of workers makes the same parts.
    """
    total = sum(f.size for f in changed)
    limit = min(max(total // 16, 2 << 20), SHARD_BYTES)
    shards, group, weight = [], [], 0
    for file in sorted(changed, key=lambda f: f.path):
        group.append(file)
        weight += file.size
        if weight >= limit or len(group) == 512:
            shards.append(_shard(root, group, config, shaping_hash))
            group, weight = [], 0
    if group:
        shards.append(_shard(root, group, config, shaping_hash))
    return shards


def _shard(root: Root, files: Sequence[SourceFile], config: FramesConfig, shaping_hash: str) -> Shard:
    key = config_hash(NAME, root.dataset, shaping_hash, [[f.path, f.content_hash] for f in files])
    spec = {
        "base": str(root.base),
        "files": [asdict(f) for f in files],
        "options": asdict(root.options),
        "config": asdict(config),
        "shaping_hash": shaping_hash,
    }
    return Shard(NAME, key, key[:16], root.dataset, spec, len(files))


def _shard_from(row: Mapping[str, Any]) -> Shard:
    """A shard again from its row in the manifest."""
    spec = json.loads(row["spec"])
    return Shard(NAME, row["key"], row["part"], row["dataset"], spec, len(spec["files"]))


def _run(lake_root: Path, shard: Shard) -> ShardResult:
    started = time.perf_counter()
    lake = Lake(lake_root)
    options = options_from(shard.spec["options"])
    config = FramesConfig(**shard.spec["config"])
    rigs = load_rigs(lake.rigs)
    clips: list[dict[str, Any]] = []
    rejects: list[dict[str, Any]] = []
    layouts: dict[str, dict[str, Any]] = {}
    skeletons: dict[str, dict[str, Any]] = {}
    with ExitStack() as stack:
        parts = FrameParts(lake, shard, stack)
        for file in shard.spec["files"]:
            try:
                made = list(_read(Path(shard.spec["base"]) / file["path"], rigs, options))
            except ClipError as error:
                rejects.append(_reject_row(shard, file, error))
                continue
            for clip, motion, rig in made:
                name = clip_name(shard.dataset, file["path"], clip.body)
                layout, skeleton = raw.layout_row(clip.hierarchy), raw.skeleton_row(clip.hierarchy)
                layouts[layout["layout"]] = layout
                skeletons[skeleton["skeleton"]] = skeleton
                parts.write(name, clip, motion, layout["layout"], config)
                row = _clip_row(name, shard, file, clip, motion, rig, options)
                clips.append(row | {"layout": layout["layout"], "skeleton": skeleton["skeleton"]})
    files = parts.written
    sources = [_source_row(shard, file) for file in shard.spec["files"]]
    return ShardResult(
        shard,
        rows=sum(c["frames"] for c in clips),
        size=sum(check_part(lake.path(name), rows) for name, rows in files.items()),
        files=tuple(files),
        seconds=time.perf_counter() - started,
        rejected=len(rejects),
        tables={
            "clips": table_of(clips, CLIP_ROWS),
            "rejects": table_of(rejects, REJECT_ROWS),
            "sources": table_of(sources, SOURCE_ROWS),
            "layouts": table_of([layouts[k] for k in sorted(layouts)], LAYOUT_ROWS),
            "skeletons": table_of([skeletons[k] for k in sorted(skeletons)], SKELETON_ROWS),
        },
    )


def clip_name(dataset: str, path: str, body: str) -> str:
    """A clip's identity: its dataset, its relative path, and the body where a file holds several."""
    return f"{dataset}/{path}" + (f"#{body}" if body else "")


def canonical_motions(
    path: Path, rigs: Mapping[str, RigMap], options: IngestOptions
) -> Iterator[tuple[SourceClip, CanonicalMotion, RigMap]]:
    """Every body of a file with its canonical motion.

    Raises:
        ClipError: the file cannot be read, its rig is unknown, or its motion makes no sense.
        UserError: `options.rig` is no rig.
    """
    from motionlake.motion.canonicalise import canonicalise
    from motionlake.motion.kinematics import solve

    for clip in read_clips(path, options.fps):
        rig = identify(clip.hierarchy.joints, rigs, options.rig)
        motion = canonicalise(clip, solve(clip), rig, up=options.up, metres_per_unit=options.metres_per_unit)
        yield clip, motion, rig


def _read(
    path: Path, rigs: Mapping[str, RigMap], options: IngestOptions
) -> Iterator[tuple[SourceClip, CanonicalMotion, RigMap]]:
    try:
        yield from canonical_motions(path, rigs, options)
    except (ClipError, UserError):
        raise
    except Exception as error:
        # One clip's surprise must not cost a repository its run; the reason says what it was.
        raise ClipError(f"could not be processed ({type(error).__name__}: {error})") from error


def _clip_row(
    name: str,
    shard: Shard,
    file: Mapping[str, Any],
    clip: SourceClip,
    motion: CanonicalMotion,
    rig: RigMap,
    options: IngestOptions,
) -> dict[str, Any]:
    path = Path(file["path"])
    reader = reader_for(path)
    return {
        "clip": name,
        "dataset": shard.dataset,
        "path": file["path"],
        "body": clip.body,
        "format": reader.name if reader else "",
        "rig": rig.name,
        "frames": len(motion.positions),
        "fps": clip.fps,
        "up": motion.up,
        "metres_per_unit": motion.metres_per_unit,
        "body_height": motion.body_height,
        "twist": motion.twist,
        "filled": list(motion.filled),
        "repaired": clip.repaired,
        "fk_error": motion.fk_error,
        "rest_offsets": motion.rest_offsets.astype(np.float32).ravel(),
        "notes": [*clip.notes, *motion.notes],
        "licence": options.licence,
        "content_hash": file["content_hash"],
        "part": shard.part,
    }


def _reject_row(shard: Shard, file: Mapping[str, Any], error: ClipError) -> dict[str, Any]:
    return {
        "dataset": shard.dataset,
        "path": file["path"],
        "line": error.line,
        "reason": error.reason,
        "content_hash": file["content_hash"],
    }


def _source_row(shard: Shard, file: Mapping[str, Any]) -> dict[str, Any]:
    spec = shard.spec
    return {
        "dataset": shard.dataset,
        "root": spec["base"],
        "config_hash": spec["shaping_hash"],
        "part": shard.part,
        **file,
    }


def content_key(con: Connection) -> str:
    """sha256 over every clip and its content: what a model fitted to the whole lake was fitted to."""
    return clips_key(run_sql(con, "content").fetchall())


def clips_key(rows: Sequence[tuple[str, str]]) -> str:
    """sha256 over the names of clips and the sha256 of their content, in order."""
    digest = hashlib.sha256()
    for row in rows:
        digest.update(repr(row).encode())
    return digest.hexdigest()
