"""Stage "synthesize": motions that a generator makes become clips of a dataset of their own, with their lineage."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, astuple, dataclass, field, replace
from itertools import groupby
from typing import TYPE_CHECKING, Any, ClassVar, Final

import pyarrow as pa
from motionlake.errors import UserError
from motionlake.lake.catalog import fetch
from motionlake.lake.config import FramesConfig, canonical_json, config_hash
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model
from motionlake.motion.rigs import load_rigs
from motionlake.names import file_name
from motionlake.stages.clip_parts import BODY_ROWS, CLIP_ROWS, ClipParts, ClipStage
from motionlake.stages.reader import LakeReader
from motionlake.stages.sources import check_apart
from motionlake.stages.stage import Shard
from motionlake.stages.synthesis import Chosen, generator_hash, open_generator
from motionlake.stages.synthesis_control import Keyframe, Request, StyleClip, controls, marked, shaping
from motionlake.stages.synthesis_diversity import diverse
from motionlake.stages.synthesis_requests import Motion, canonical_motion, make, motions_of
from motionlake.stages.synthesis_settling import settle
from motionlake.stages.synthesis_starts import Start, find_starts

if TYPE_CHECKING:
    from motionlake.motion.generation import GeneratedMotion

TRIAL: Final = 1.0  # seconds of a first motion, by which it shows whether there is anything to start from
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


class Synthesize(ClipStage):
    """Motions made to order: shards are planned by `planned`, for a request."""

    name = "synthesize"
    version = 3
    upstream = ("synth", "frames")
    about = "motions that a generator makes, as clips of a dataset of their own"
    tables = ("synthetic", "clips", "segments", "layouts", "skeletons")
    by_name = True
    schemas: ClassVar = {
        "clips": LABELLED_CLIP_ROWS,
        "synthetic_segments": SEGMENT_ROWS,
        "synthetic": LINEAGE_ROWS,
        **BODY_ROWS,
    }
    replaces = "clips"

    def plan(self, at: LakeReader) -> list[Shard]:
        return []

    def due(self, at: LakeReader) -> int:
        return 0

    def make(self, lake: Lake, shard: Shard, parts: ClipParts) -> None:
        """Make the motions of a shard, each a clip."""
        from motionlake.motion.canonicalise import to_source_clip
        from motionlake.motion.rig_joints import rig_joints

        spec, rig = shard.spec, load_rigs()["canonical"]
        model = Model(**spec["generator"])
        request = _request(spec["request"])
        keys = {m["number"]: m["key"] for m in spec["motions"]}
        starts = [Start(**{**start, "rest_offsets": tuple(start["rest_offsets"])}) for start in spec["starts"]]
        motions = [Motion(m["number"], starts[m["start"]], m.get("attempt", 0)) for m in spec["motions"]]
        made = make(open_generator(lake, model), lake, request, motions)
        by_path = sorted((clip_path(request, motion.number), i) for i, motion in enumerate(motions))
        for path, i in by_path:
            motion, one = motions[i], made[i]
            name = f"{shard.dataset}/{path}"
            canonical = canonical_motion(one, model.metrics["filled"])
            body = to_source_clip(canonical)
            own = [motion.start.licence] if motion.start.licence else []
            licences = sorted({*model.metrics["licences"], *own})
            content = canonical.positions.astype("<f4").tobytes() + canonical.rotations.astype("<f4").tobytes()
            parts.write(
                name, body, canonical, FramesConfig(**spec["frames"]), rig_joints(body.hierarchy.joints, rig),
                path=path, format="synthetic", rig=rig.name, notes=[], licence="; ".join(licences) or None,
                content_hash=hashlib.sha256(content).hexdigest(),
                label=_label(request),
            )  # fmt: skip
            parts.rows["synthetic_segments"] += _segments(name, request, one)
            parts.rows["synthetic"].append(
                {
                    "clip": name, "model": model.model, "config": spec["config"], "classes": list(request.classes),
                    "seconds": request.seconds, "seed": request.seed, "number": motion.number, "pace": request.pace,
                    "temperature": request.temperature, "seed_clip": motion.start.clip,
                    "seed_start": motion.start.start + one.seed_start,
                    "seed_stop": motion.start.start + one.seed_stop,
                    "datasets": list(model.metrics["datasets"]), "licences": licences, "key": keys[motion.number],
                }
            )  # fmt: skip


SYNTHESIZE: Final = Synthesize()


@dataclass(frozen=True)
class Plan:
    """What a request comes to.

    Attributes:
        generator: by which recipe, and why this one.
        clips: of the request, in the order of their numbers.
        shards: that make those which are not there yet.
        there: how many are.
        alike: of motions that were asked to differ, those that are nearer to one before them than recorded clips are.
        floor: how far recorded clips are from one another, body lengths; None where it was not asked.
    """

    generator: Chosen
    clips: list[str]
    shards: list[Shard]
    there: int
    alike: list[str] = field(default_factory=list)
    floor: float | None = None


def planned(at: LakeReader, request: Request, dataset: str, count: int) -> Plan:
    """What motions 1 to `count` of a request come to, as clips of a dataset; those that are there are left as they are.

    The cut into shards depends on the request alone, so that a run which was cut short makes the same parts when it
    goes on.

    Raises:
        UserError: there is no generator, it does not know a class, a number is no good, there is nothing to start from,
            or the dataset holds recorded clips.
    """
    if fetch(at.con, "recorded_dataset", {"dataset": dataset}):
        raise UserError(f"{dataset}: holds recorded clips; give synthetic ones a dataset of their own (--dataset NAME)")
    check_apart(at.con, [dataset])
    chosen, request = settle(at.con, at.lake, at.config, request)
    model = chosen.model
    starts = find_starts(at.con, at.lake, model, request)
    motions, alike, floor = motions_of(request, starts, range(1, count + 1)), [], None
    if request.diverse:
        found = diverse(at.con, at.lake, open_generator(at.lake, model), request, starts, count)
        motions, alike, floor = found.motions, found.alike, found.floor
    names = {m.number: f"{dataset}/{clip_path(request, m.number)}" for m in motions}
    made_by = [SYNTHESIZE.name, SYNTHESIZE.version, model.model, generator_hash(at, model), at.config.frames]
    keys = {m.number: config_hash(*made_by, _identity(request, m)) for m in motions}
    there = {r["clip"]: r["key"] for r in fetch(at.con, "synthetic_keys", {"dataset": dataset})}
    lacking = [m for m in motions if there.get(names[m.number]) != keys[m.number]]
    control = controls(request)
    asked = {"control": control} if control else {}
    together = max(1, min(TOGETHER, int(SECONDS / request.lasts)))
    shards = []
    for _, group in groupby(lacking, lambda m: (m.number - 1) // together):
        block = list(group)
        own = list({m.start: None for m in block})
        spec = {
            "generator": asdict(model),
            "config": canonical_json(asdict(at.config.synthesis) | {"recipe": chosen.recipe} | asked),
            "frames": asdict(at.config.frames),
            "request": asdict(request),
            "starts": [asdict(start) for start in own],
            "motions": [_motion(m, own.index(m.start), keys[m.number]) for m in block],
        }
        key = config_hash(SYNTHESIZE.name, dataset, [keys[m.number] for m in block])
        shards.append(Shard(SYNTHESIZE.name, key, key[:16], dataset, spec, len(block)))
    if shards:
        # The beginning of the first motion: what is wrong with every motion is said before any work is handed out.
        short = replace(request, seconds=min(request.lasts, TRIAL))
        make(open_generator(at.lake, model), at.lake, short, motions[:1])
    near = [names[number] for number in alike]
    return Plan(chosen, list(names.values()), shards, len(motions) - len(lacking), near, floor)


def _motion(motion: Motion, start: int, key: str) -> dict[str, Any]:
    attempt = {"attempt": motion.attempt} if motion.attempt else {}
    return {"number": motion.number, "start": start, "key": key} | attempt


def source_rows(at: LakeReader, request: Request, dataset: str, count: int) -> list[tuple[Any, ...]]:
    """Where the frames of motions 1 to `count` of a request come from: a row for each run of recorded frames.

    The motions are made again for it: nothing is kept of them but their frames.

    Returns:
        Rows of the clip, its frames [start, stop), the recorded clip that they were made from, the first and the last
        of its frames, and whether these are mirrored; none of a generator that plays no recorded frames.

    Raises:
        UserError: as `planned`.
    """
    chosen, request = settle(at.con, at.lake, at.config, request)
    model = chosen.model
    starts, generator, rows = find_starts(at.con, at.lake, model, request), open_generator(at.lake, model), []
    motions = motions_of(request, starts, range(1, count + 1))
    if request.diverse:
        motions = diverse(at.con, at.lake, generator, request, starts, count).motions
    for motion in motions:
        (made,) = make(generator, at.lake, request, [motion])
        name = f"{dataset}/{clip_path(request, motion.number)}"
        rows += [(name, *astuple(source)) for source in made.sources]
    return rows


def clip_path(request: Request, number: int) -> str:
    """Name of a motion within its dataset: what is asked for beside classes, and what it may start from, tell motions
    of one seed apart."""
    said = "+".join(request.classes)
    classes = file_name(said.replace("#", "-"))
    if classes != said or any("+" in name for name in request.classes):  # others may be spelled so too
        classes += f"-{config_hash(request.classes)[:8]}"
    if more := marked(request):
        classes += f"-{config_hash(more)[:8]}"
    return f"{classes}-s{request.seed}-{number:04d}"


def _request(spec: Mapping[str, Any]) -> Request:
    """The request of a shard."""
    lists = {name: tuple(spec[name]) for name in ("classes", "shares", "edited") if spec.get(name) is not None}
    keys = tuple(
        Keyframe(**{**key, "hips": tuple(key["hips"]), "rotations": tuple(key["rotations"])})
        for key in spec.get("keyframes", ())
    )
    style = spec.get("style")
    if style is not None:
        style = StyleClip(**{**style, "rest_offsets": tuple(style["rest_offsets"])})
    return Request(**{**spec, **lists, "keyframes": keys, "style": style})


def _identity(request: Request, motion: Motion) -> list[Any]:
    """All that a motion follows from but the generator."""
    start = motion.start
    attempt = [motion.attempt] if motion.attempt else []
    return [shaping(request), motion.number, start.clip, start.content_hash, start.start, start.stop, *attempt]


def _label(request: Request) -> str | None:
    """The class of a whole motion; None of one of several classes, and of a clip of which a range was made."""
    return request.classes[0] if len(set(request.classes)) == 1 and request.edited is None else None


def _segments(name: str, request: Request, made: GeneratedMotion) -> list[dict[str, Any]]:
    """The range of every class, where there are several, one after the other."""
    if request.edited is not None:
        first, stop = request.edited
        return [{"clip": name, "start": first, "stop": stop, "label": request.classes[0]}]
    if len(set(request.classes)) == 1 or request.keyframes:
        return []
    stops = (*made.class_starts[1:], len(made.positions))
    return [
        {"clip": name, "start": start, "stop": stop, "label": label}
        for label, start, stop in zip(request.classes, made.class_starts, stops, strict=True)
        if start < stop
    ]
