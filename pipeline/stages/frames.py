"""Stage "frames": source files become canonical frames, raw channels and clip rows."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from motionlake.errors import ClipError, UserError
from motionlake.formats import read_clips, reader_for
from motionlake.lake import raw
from motionlake.lake.catalog import Connection, load_rows, run_sql, table_of
from motionlake.lake.config import FramesConfig, config_hash
from motionlake.lake.layout import Lake
from motionlake.lake.parts import check_part
from motionlake.motion.canonicalise import CanonicalMotion, canonicalise
from motionlake.motion.clip import SourceClip
from motionlake.motion.kinematics import solve
from motionlake.motion.rigs import RigMap, identify, load_rigs
from motionlake.stages.frame_parts import FrameParts
from motionlake.stages.shard import Shard, ShardResult, tables_of
from motionlake.stages.sources import IngestOptions, Root, SourceFile

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


def plan(root: Root, changed: Sequence[SourceFile], config: FramesConfig, shaping_hash: str) -> list[Shard]:
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


def shard_from(row: Mapping[str, Any]) -> Shard:
    """A shard again from its row in the manifest."""
    spec = json.loads(row["spec"])
    return Shard(NAME, row["key"], row["part"], row["dataset"], spec, len(spec["files"]))


def run(lake_root: Path, shard: Shard) -> ShardResult:
    """Read, solve and canonicalise every file of a shard; write one frames part and a raw part a layout."""
    started = time.perf_counter()
    lake = Lake(lake_root)
    options = IngestOptions(**shard.spec["options"])
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


def load(con: Connection, _root: Path, results: Sequence[ShardResult]) -> None:
    """Replace the rows of every source file in the results; what was derived from them goes too."""
    sources = tables_of(results, "sources")
    load_rows(con, "forget_sources", sources)
    load_rows(con, "load_sources", sources)
    load_rows(con, "load_clips", tables_of(results, "clips"))
    load_rows(con, "load_rejects", tables_of(results, "rejects"))
    load_rows(con, "load_layouts", tables_of(results, "layouts"))
    load_rows(con, "load_skeletons", tables_of(results, "skeletons"))
    run_sql(con, "forget_orphans")


def content_key(con: Connection) -> str:
    """sha256 over every clip and its content: what a model fitted to the whole lake was fitted to."""
    return clips_key(run_sql(con, "content").fetchall())


def clips_key(rows: Sequence[tuple[str, str]]) -> str:
    """sha256 over the names of clips and the sha256 of their content, in order."""
    digest = hashlib.sha256()
    for row in rows:
        digest.update(repr(row).encode())
    return digest.hexdigest()
