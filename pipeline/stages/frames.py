"""Stage "frames": source files become canonical frames, raw channels and clip rows."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Final

import pyarrow as pa
from motionlake.errors import ClipError, UserError
from motionlake.formats import read_clips, reader_for
from motionlake.formats.limits_config import Limits
from motionlake.lake.catalog import Connection, fetch, run_sql
from motionlake.lake.config import FramesConfig, LakeConfig, config_hash, load_config
from motionlake.lake.layout import Lake
from motionlake.motion.clip import SourceClip
from motionlake.motion.rigs import RigMap, load_rigs
from motionlake.motion.rigs_config import RigsConfig
from motionlake.names import on_disk, typed
from motionlake.stages.clip_parts import BODY_ROWS, CLIP_ROWS, ClipParts, ClipStage
from motionlake.stages.file_watch import watching
from motionlake.stages.reader import LakeReader
from motionlake.stages.source_files import SourceFile
from motionlake.stages.sources import (
    FRAMES_VERSION,
    Difference,
    Hashing,
    IngestOptions,
    Root,
    compare,
    known_roots,
    options_from,
)
from motionlake.stages.stage import Shard

if TYPE_CHECKING:
    from motionlake.motion.auto_rig import RigMatch
    from motionlake.motion.canonicalise import CanonicalMotion

SHARD_BYTES = 24 << 20  # of source files; a worker's memory grows with it
_S, _I = pa.string(), pa.int64()
REJECT_ROWS = pa.schema({"dataset": _S, "path": _S, "line": _I, "reason": _S, "content_hash": _S})
SOURCE_ROWS = pa.schema(
    {
        "dataset": _S, "path": _S, "root": _S, "size": _I, "mtime_ns": _I, "content_hash": _S,
        "config_hash": _S, "part": _S,
    }
)  # fmt: skip


@dataclass(frozen=True)
class Body:
    """One body of a file: what the file holds, its canonical motion, its rig, and what speaks for a solved one."""

    clip: SourceClip
    motion: CanonicalMotion
    rig: RigMap
    match: RigMatch | None


class FramesStage(ClipStage):
    """Canonical frames and raw channels of source files; `motionlake ingest` names the folders, `run` looks again."""

    name = "frames"
    version = FRAMES_VERSION
    upstream = ()
    about = "source files to canonical frames in Parquet"
    tables = ("sources", "rejects", "clips", "layouts", "skeletons", "segments")
    schemas: ClassVar = {"sources": SOURCE_ROWS, "clips": CLIP_ROWS, "rejects": REJECT_ROWS, **BODY_ROWS}
    replaces = "sources"

    def plan(self, at: LakeReader) -> list[Shard]:
        return [shard for root in known_roots(at.con) for shard in intake_of(at, root).shards]

    def due(self, at: LakeReader) -> int:
        """Planned shards that have not run; folders are not searched."""
        return sum(r["state"] == "planned" for r in fetch(at.con, "shards", {"stage": self.name}))

    def make(self, lake: Lake, shard: Shard, parts: ClipParts) -> None:
        """Read, solve and canonicalise every file of a shard."""
        from motionlake.motion.rig_joints import rig_joints

        spec = shard.spec
        options, config, rigs = options_from(spec["options"]), FramesConfig(**spec["config"]), load_rigs(lake.rigs)
        allowed, solving = Limits(**spec["limits"]), RigsConfig(**spec.get("rigs", {}))
        own = {"dataset": shard.dataset, "part": shard.part}
        source = {**own, "root": spec["base"], "config_hash": spec["shaping_hash"]}
        watch = parts.stack.enter_context(watching(lake.root, shard, allowed))
        for file in spec["files"]:
            parts.rows["sources"].append({**source, **file})
            content = {"path": file["path"], "content_hash": file["content_hash"]}
            try:
                path = Path(on_disk(spec["base"])) / on_disk(file["path"])
                with watch.reading(file["path"]):
                    made = list(canonical_motions(path, rigs, options, allowed, solving))
            except UserError:
                raise
            except Exception as error:  # one clip's surprise must not cost a repository its run
                reason, line = f"could not be processed ({type(error).__name__}: {error})", None
                if isinstance(error, ClipError):
                    reason, line = error.reason, error.line
                reject = {"dataset": shard.dataset, "line": line, "reason": typed(reason), **content}
                parts.rows["rejects"].append(reject)
                continue
            reader = reader_for(path)
            for body in made:
                clip, motion = body.clip, body.motion
                name = f"{shard.dataset}/{file['path']}" + (f"#{clip.body}" if clip.body else "")
                parts.write(
                    name, clip, motion, config, rig_joints(clip.hierarchy.joints, body.rig, body.match),
                    format=reader.name if reader else "", rig=body.rig.name,
                    notes=[*clip.notes, *motion.notes], licence=options.recorded_licence, **content,
                )  # fmt: skip


FRAMES: Final = FramesStage()


@dataclass(frozen=True)
class Intake:
    """What a root holds against what the lake knows of it, and what of it is to be read.

    Attributes:
        shards: those that a run which was cut short left, then new ones.
        dropped: keys of planned shards whose files have changed since.
        failed: (files, reason) of shards that failed before and are left alone.
    """

    root: Root
    difference: Difference
    shards: list[Shard]
    dropped: list[str]
    failed: list[tuple[int, str]]


def intake_of(
    at: LakeReader, root: Root, *, checksum: bool = False, retry_failed: bool = False, progress: Hashing | None = None
) -> Intake:
    """Compare a root with the lake, as `compare`, and cut what is to be read into shards: the planned ones, then new.

    Raises:
        UserError: as `compare`.
    """
    shaping, allowed = root.shaping_hash(at.config, at.lake), at.config.of(Limits)
    difference = compare(
        at.con, at.lake, root, shaping, allowed, checksum=checksum, retry_failed=retry_failed, progress=progress
    )
    found = Intake(root, difference, [], [], [])
    rest = {(f.path, f.content_hash): f for f in difference.changed}
    for row in fetch(at.con, "unfinished_shards", {"dataset": root.dataset}):
        spec = json.loads(row["spec"])
        if spec["base"] != root.kept_base:
            continue
        wanted = [(f["path"], f["content_hash"]) for f in spec["files"]]
        if spec["shaping_hash"] != shaping or not all(w in rest for w in wanted):
            found.dropped.append(row["key"])
            continue
        for file in wanted:
            del rest[file]
        if row["state"] == "planned" or retry_failed:
            spec["limits"] = asdict(allowed)  # those of now
            found.shards.append(Shard(FRAMES.name, row["key"], row["part"], row["dataset"], spec, len(wanted)))
        else:
            found.failed.append((len(wanted), row["reason"]))
    found.shards.extend(_new_shards(root, list(rest.values()), at.config, allowed, shaping))
    return found


def _new_shards(
    root: Root, changed: Sequence[SourceFile], config: LakeConfig, allowed: Limits, shaping_hash: str
) -> list[Shard]:
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
            shards.append(shard_of(root, group, config, allowed, shaping_hash))
            group, weight = [], 0
    if group:
        shards.append(shard_of(root, group, config, allowed, shaping_hash))
    return shards


def shard_of(root: Root, files: Sequence[SourceFile], config: LakeConfig, allowed: Limits, shaping_hash: str) -> Shard:
    """The shard that reads some files of a root, by path; its name follows from them and what shapes their frames.

    Limits are no part of its key, for they shape no frame.
    """
    key = frames_key(root.dataset, shaping_hash, [(f.path, f.content_hash) for f in files])
    spec = {
        "base": root.kept_base,
        "files": [f._asdict() for f in files],
        "options": asdict(root.options),
        "config": asdict(config.frames),
        "rigs": asdict(config.of(RigsConfig)),
        "limits": asdict(allowed),
        "shaping_hash": shaping_hash,
    }
    return Shard(FRAMES.name, key, key[:16], root.dataset, spec, len(files))


def frames_key(dataset: str, shaping_hash: str, files: Sequence[tuple[str, str]]) -> str:
    """The key of the part that is read from files, (path, sha256 of the content) by path."""
    return config_hash(FRAMES.name, dataset, shaping_hash, [list(file) for file in files])


def canonical_motions(
    path: Path,
    rigs: Mapping[str, RigMap],
    options: IngestOptions,
    allowed: Limits | None = None,
    solving: RigsConfig | None = None,
) -> Iterator[Body]:
    """Every body of a file with its canonical motion.

    Args:
        path: of the file.
        rigs: known rig maps, by name.
        options: what the user said of its folder.
        allowed: what the file may ask for.
        solving: how sure a rig map must be that is solved from the joint tree.

    Raises:
        ClipError: the file cannot be read, asks for more than is `allowed`, its rig is unknown, or its motion makes
            no sense.
        UserError: `options.rig` is no rig.
    """
    from motionlake.motion.auto_rig import find_rig, notes_of
    from motionlake.motion.canonicalise import canonicalise
    from motionlake.motion.kinematics import solve

    for clip in read_clips(path, options.fps, allowed):
        solved = solve(clip)
        rig, match = find_rig(clip, solved, rigs, options.rig, solving or RigsConfig())
        motion = canonicalise(clip, solved, rig, up=options.up, metres_per_unit=options.metres_per_unit)
        if match is not None:
            motion = replace(motion, notes=(*motion.notes, *notes_of(match, solving or RigsConfig())))
        yield Body(clip, motion, rig, match)


def first_body(lake: Lake, path: Path, options: IngestOptions | None = None) -> tuple[SourceClip, CanonicalMotion]:
    """The first body of a clip file, which need not be in the lake, and its canonical motion.

    Raises:
        UserError: the file cannot be read.
    """
    try:
        config = load_config(lake.config_file)
        asked = options or IngestOptions(), config.of(Limits), config.of(RigsConfig)
        body = next(iter(canonical_motions(path, load_rigs(lake.rigs), *asked)))
    except ClipError as error:
        raise UserError(f"{path}: {error}") from error
    return body.clip, body.motion


def content_key(con: Connection) -> str:
    """sha256 over every clip and its content: what a model fitted to the whole lake was fitted to."""
    return clips_key(run_sql(con, "content").fetchall())


def clips_key(rows: Sequence[tuple[str, str]]) -> str:
    """sha256 over the names of clips and the sha256 of their content, in order."""
    digest = hashlib.sha256()
    for row in rows:
        digest.update(repr(row).encode())
    return digest.hexdigest()
