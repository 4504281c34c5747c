"""Stage "synthesize": motions that a generator makes become clips of a dataset of their own, with their lineage."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import pyarrow as pa
from motionlake.errors import UserError
from motionlake.lake import raw
from motionlake.lake.catalog import Connection, fetch, load_rows, table_of
from motionlake.lake.config import FramesConfig, LakeConfig, canonical_json, config_hash
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model, file_hash
from motionlake.lake.parts import check_part
from motionlake.stages.frame_parts import FrameParts
from motionlake.stages.frames import CLIP_ROWS, LAYOUT_ROWS, SKELETON_ROWS
from motionlake.stages.orphans import forget_orphans
from motionlake.stages.reader import LakeReader
from motionlake.stages.shard import Shard, ShardResult, tables_of
from motionlake.stages.synthesis import check_classes, open_generator, served_generator
from motionlake.stages.synthesis_wishes import (
    Made,
    Motion,
    Request,
    Start,
    check_request,
    find_starts,
    make,
    motions_of,
)

if TYPE_CHECKING:
    from motionlake.motion.canonicalise import CanonicalMotion

NAME: Final = "synthesize"
TRIAL: Final = 1.0  # seconds of a first motion, by which it shows whether there is anything to start from
VERSION: Final = 2
FORMAT: Final = "synthetic"
TOGETHER: Final = 32  # motions a shard
SECONDS: Final = 1800.0  # of motion a shard; memory grows with them
_S, _I, _F = pa.string(), pa.int64(), pa.float64()
LABELLED_CLIP_ROWS = CLIP_ROWS.append(pa.field("label", _S))
SEGMENT_ROWS = pa.schema({"clip": _S, "start": _I, "stop": _I, "label": _S})
LINEAGE_ROWS = pa.schema(
    {
        "clip": _S, "model": _S, "config": _S, "classes": pa.list_(_S), "seconds": _F, "seed": _I, "number": _I,
        "pace": _F, "temperature": _F, "seed_clip": _S, "seed_start": _I, "seed_stop": _I,
        "datasets": pa.list_(_S), "licences": pa.list_(_S), "key": _S,
    }
)  # fmt: skip
PATH_ROWS = pa.schema({"dataset": _S, "path": _S})


class Synthesize:
    """Motions made to order: shards are planned by `planned`, for a request."""

    name = NAME
    version = VERSION
    upstream = ("synth", "frames")
    about = "motions that a generator makes, as clips of a dataset of their own"
    model = None
    tables = ("synthetic", "clips", "segments", "layouts", "skeletons")
    folders = ("frames", "raw")
    by_name = True

    def plan(self, at: LakeReader) -> list[Shard]:
        return []

    def due(self, at: LakeReader) -> int:
        return 0

    def lacking(self, at: LakeReader) -> str | None:
        return None

    def at_once(self, at: LakeReader) -> bool:
        return False

    def run(self, root: Path, shard: Shard, /) -> ShardResult:
        """Make the motions of a shard; write one frames part and one part of BVH channels."""
        return _run(root, shard)

    def load(self, con: Connection, root: Path, results: Sequence[ShardResult], /) -> None:
        """Replace clips of these names, with their segments and lineage; what was derived from them goes too."""
        clips = tables_of(results, "clips")
        load_rows(con, "forget_sources", clips.select(PATH_ROWS.names))
        load_rows(con, "load_clips", clips)
        load_rows(con, "load_synthetic_segments", tables_of(results, "segments"), {"clips": clips["clip"].to_pylist()})
        for table in ("synthetic", "layouts", "skeletons"):
            load_rows(con, f"load_{table}", tables_of(results, table))
        forget_orphans(con)


SYNTHESIZE: Final = Synthesize()


@dataclass(frozen=True)
class Plan:
    """What a request comes to.

    Attributes:
        model: the generator.
        clips: of the request, in the order of their numbers.
        shards: that make those which are not there yet.
        there: how many are.
    """

    model: Model
    clips: list[str]
    shards: list[Shard]
    there: int


def planned(at: LakeReader, request: Request, dataset: str, count: int) -> Plan:
    """What motions 1 to `count` of a request come to, as clips of a dataset; those that are there are left as they are.

    Raises:
        UserError: there is no generator, it does not know a class, a number is no good, there is nothing to start from,
            or the dataset holds recorded clips.
    """
    check_request(request)
    model = served_generator(at.con, at.lake, at.config)
    check_classes(model, request.classes)
    check_own_dataset(at.con, dataset)
    starts = find_starts(at.con, at.lake, request)
    found = plan(at.con, at.lake, at.config, model, request, starts, dataset, count)
    if found.shards:
        # The beginning of the first motion: what is wrong with every motion is said before any work is handed out.
        short = replace(request, seconds=min(request.seconds, TRIAL))
        make(open_generator(at.lake, model), at.lake, short, starts, motions_of(request, starts, [1]))
    return found


def motion_path(request: Request, number: int) -> str:
    """Name of a motion within its dataset."""
    classes = "+".join(name.replace("/", "_").replace("#", "_") for name in request.classes)
    return f"{classes}-s{request.seed}-{number:04d}"


def check_own_dataset(con: Connection, dataset: str) -> None:
    """Raises `UserError` where a dataset holds recorded clips, or files were taken in to it."""
    if fetch(con, "recorded_dataset", {"dataset": dataset}):
        raise UserError(f"{dataset}: holds recorded clips; give synthetic ones a dataset of their own (--dataset NAME)")


def plan(
    con: Connection,
    lake: Lake,
    config: LakeConfig,
    model: Model,
    request: Request,
    starts: Sequence[Start],
    dataset: str,
    count: int,
) -> Plan:
    """Cut motions 1 to `count` into shards by their numbers; what is there as it would be made is left out.

    The cut depends on the request alone, so that a run which was cut short makes the same parts when it goes on.
    """
    made_by = [NAME, VERSION, model.model, file_hash(lake.path(model.file)), config.frames]
    motions = motions_of(request, starts, range(1, count + 1))
    names = {m.number: f"{dataset}/{motion_path(request, m.number)}" for m in motions}
    keys = {m.number: config_hash(*made_by, _identity(request, starts, m)) for m in motions}
    there = _there(con, dataset)
    lacking = [m for m in motions if there.get(names[m.number]) != keys[m.number]]
    together = max(1, min(TOGETHER, int(SECONDS / request.seconds)))
    shards = []
    for _, group in groupby(lacking, lambda m: (m.number - 1) // together):
        block = list(group)
        spec = _spec(config, model, request, starts, block, keys)
        key = config_hash(NAME, dataset, [keys[m.number] for m in block])
        shards.append(Shard(NAME, key, key[:16], dataset, spec, len(block)))
    return Plan(model, list(names.values()), shards, len(motions) - len(lacking))


def _identity(request: Request, starts: Sequence[Start], motion: Motion) -> list[Any]:
    """All that a motion follows from but the generator."""
    start = starts[motion.start]
    wished = {name: value for name, value in asdict(request).items() if name not in ("start", "outside", "split")}
    return [wished, motion.number, start.clip, start.content_hash, start.start, start.stop]


def _there(con: Connection, dataset: str) -> dict[str, str]:
    """Key of every synthetic clip of a dataset."""
    return {r["clip"]: r["key"] for r in fetch(con, "synthetic_keys", {"dataset": dataset})}


def _spec(
    config: LakeConfig,
    model: Model,
    request: Request,
    starts: Sequence[Start],
    motions: Sequence[Motion],
    keys: Mapping[int, str],
) -> dict[str, Any]:
    """What a shard needs; of the starts only those of its motions."""
    chosen = sorted({m.start for m in motions})
    return {
        "generator": asdict(model),
        "config": canonical_json(asdict(config.synthesis)),
        "frames": asdict(config.frames),
        "request": asdict(request),
        "starts": [asdict(starts[index]) for index in chosen],
        "motions": [{"number": m.number, "start": chosen.index(m.start), "key": keys[m.number]} for m in motions],
    }


def _run(lake_root: Path, shard: Shard) -> ShardResult:
    from motionlake.motion.canonicalise import to_source_clip
    from motionlake.stages.synthetic_motion import canonical_motion

    started = time.perf_counter()
    lake, spec = Lake(lake_root), shard.spec
    model, request = Model(**spec["generator"]), _request(spec["request"])
    motions = [Motion(m["number"], m["start"]) for m in spec["motions"]]
    starts = [Start(**s) for s in spec["starts"]]
    made = make(open_generator(lake, model), lake, request, starts, motions)
    keys = {m["number"]: m["key"] for m in spec["motions"]}
    rows: dict[str, list[dict[str, Any]]] = {"clips": [], "segments": [], "synthetic": []}
    layouts, skeletons = {}, {}
    by_name = sorted(zip(motions, made, strict=True), key=lambda pair: motion_path(request, pair[0].number))
    with ExitStack() as stack:
        parts = FrameParts(lake, shard, stack)
        for motion, one in by_name:
            canonical = canonical_motion(one.motion, model.metrics["filled"])
            clip = to_source_clip(canonical)
            layout, skeleton = raw.layout_row(clip.hierarchy), raw.skeleton_row(clip.hierarchy)
            layouts[layout["layout"]], skeletons[skeleton["skeleton"]] = layout, skeleton
            path = motion_path(request, motion.number)
            name = f"{shard.dataset}/{path}"
            parts.write(name, clip, canonical, layout["layout"], FramesConfig(**spec["frames"]))
            own = _clip_row(name, path, shard, canonical, request, _licences(model, one))
            rows["clips"].append(own | {"layout": layout["layout"], "skeleton": skeleton["skeleton"]})
            rows["segments"] += _segments(name, request, one)
            rows["synthetic"].append(_lineage(name, model, spec["config"], request, motion, one, keys[motion.number]))
    files = parts.written
    return ShardResult(
        shard,
        rows=sum(row["frames"] for row in rows["clips"]),
        size=sum(check_part(lake.path(file), count) for file, count in files.items()),
        files=tuple(files),
        seconds=time.perf_counter() - started,
        tables={
            "clips": table_of(rows["clips"], LABELLED_CLIP_ROWS),
            "segments": table_of(rows["segments"], SEGMENT_ROWS),
            "synthetic": table_of(rows["synthetic"], LINEAGE_ROWS),
            "layouts": table_of([layouts[k] for k in sorted(layouts)], LAYOUT_ROWS),
            "skeletons": table_of([skeletons[k] for k in sorted(skeletons)], SKELETON_ROWS),
        },
    )


def _request(fields: Mapping[str, Any]) -> Request:
    return Request(**{**fields, "classes": tuple(fields["classes"])})


def _licences(model: Model, made: Made) -> list[str]:
    """Of the training clips and of the clip that a motion starts from."""
    own = [made.start.licence] if made.start.licence else []
    return sorted({*model.metrics["licences"], *own})


def _clip_row(
    name: str, path: str, shard: Shard, motion: CanonicalMotion, request: Request, licences: Sequence[str]
) -> dict[str, Any]:
    content = hashlib.sha256(motion.positions.astype("<f4").tobytes() + motion.rotations.astype("<f4").tobytes())
    return {
        "clip": name,
        "dataset": shard.dataset,
        "path": path,
        "body": "",
        "format": FORMAT,
        "rig": "canonical",
        "frames": len(motion.positions),
        "fps": motion.fps,
        "up": motion.up,
        "metres_per_unit": motion.metres_per_unit,
        "body_height": motion.body_height,
        "twist": motion.twist,
        "filled": list(motion.filled),
        "repaired": 0,
        "fk_error": motion.fk_error,
        "rest_offsets": motion.rest_offsets.ravel().tolist(),
        "notes": list(motion.notes),
        "licence": "; ".join(licences) or None,
        "content_hash": content.hexdigest(),
        "part": shard.part,
        "label": request.classes[0] if len(set(request.classes)) == 1 else None,
    }


def _segments(name: str, request: Request, made: Made) -> list[dict[str, Any]]:
    """The range of every class, where there are several."""
    if len(set(request.classes)) == 1:
        return []
    starts = made.motion.class_starts
    stops = (*starts[1:], len(made.motion.positions))
    return [
        {"clip": name, "start": start, "stop": stop, "label": label}
        for label, start, stop in zip(request.classes, starts, stops, strict=True)
        if start < stop
    ]


def _lineage(
    name: str, model: Model, config: str, request: Request, motion: Motion, made: Made, key: str
) -> dict[str, Any]:
    return {
        "clip": name,
        "model": model.model,
        "config": config,
        "classes": list(request.classes),
        "seconds": request.seconds,
        "seed": request.seed,
        "number": motion.number,
        "pace": request.pace,
        "temperature": request.temperature,
        "seed_clip": made.start.clip,
        "seed_start": made.start.start + made.motion.seed_start,
        "seed_stop": made.start.start + made.motion.seed_stop,
        "datasets": list(model.metrics["datasets"]),
        "licences": _licences(model, made),
        "key": key,
    }
