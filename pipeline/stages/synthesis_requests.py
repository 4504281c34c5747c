"""Making motions that are requested: the recorded clips that they start from, and the motions themselves."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model
from motionlake.lake.verdicts import good_rows
from motionlake.stages.frames import first_body
from motionlake.stages.generator_model import classed_motions, long_enough
from motionlake.stages.sources import content_hash
from motionlake.stages.synthesis import check_classes
from motionlake.stages.synthesis_control import Request
from motionlake.stages.synthesis_edits import edge_poses, edited_clip
from motionlake.stages.synthesis_keys import key_poses, style_frames
from motionlake.stages.synthesis_options import path_of
from motionlake.stages.training_clips import check_chosen, frames_of_clips

if TYPE_CHECKING:
    from motionlake.lake.frames import Frames
    from motionlake.motion.canonicalise import CanonicalMotion
    from motionlake.motion.generation import Control, GeneratedMotion, MotionGenerator, SeedClip
    from motionlake.motion.keyframes import KeyPoses


@dataclass(frozen=True)
class Start:
    """Frames [start, stop) of a recorded clip that a motion may start from, and the body [21 x 3] it then has.

    With `outside`, `clip` is the path of a file.
    """

    clip: str
    dataset: str
    part: str
    fps: float
    start: int
    stop: int
    content_hash: str
    licence: str | None
    rest_offsets: tuple[float, ...]
    outside: bool = False


@dataclass(frozen=True)
class Motion:
    """One motion of a request: its number from 1, what it starts from, and how often it was tried before."""

    number: int
    start: Start
    attempt: int = 0


def find_starts(con: Connection, lake: Lake, model: Model, request: Request) -> list[Start]:
    """What the motions of a request may start from, by clip and frame.

    Recorded motion of the first class; in a lake that knows of no clip's class, any recorded clip.

    Raises:
        UserError: the generator does not know a class, the clip to start from is synthetic, the file cannot be read, or
            no recorded clip of the first class is long enough.
    """
    check_classes(model, request.classes)
    if request.start is not None and request.outside:
        return [_outside(lake, Path(request.start))]
    if request.start is not None:
        row = fetch(con, "clip", {"clip": request.start})[0]
        if row["format"] == "synthetic" and not request.keyframes:
            raise UserError(f"{request.start}: is synthetic; start from a recorded clip")
        return [_start(row | {"start": 0, "stop": row["frames"]})]
    wanted = request.classes[0]
    rows = classed_motions(con, request.split, wanted)
    if not rows:
        check_chosen(con, lake, request.split, None)
        if classed_motions(con):
            where = f" of split {request.split}" if request.split else ""
            raise UserError(
                f"{lake.root}: has no recorded clip{where} of class {wanted} to start from; name another with --from "
                "CLIP"
            )
        rows = fetch(con, "recorded_motions", {"split": request.split})
    rows = good_rows(con, rows, request.min_quality, "clips to start from")
    long = [_start(row) for row in rows if long_enough(row)]
    if not long:
        raise UserError(
            f"{lake.root}: the {len(rows)} recorded motions{f' of class {wanted}' * ('label' in rows[0])} are too "
            "short to start from; name another clip with --from CLIP"
        )
    return long


def _start(row: Mapping[str, Any]) -> Start:
    names = ("clip", "dataset", "part", "fps", "start", "stop", "content_hash", "licence")
    return Start(**{name: row[name] for name in names}, rest_offsets=tuple(row["rest_offsets"]))


def _outside(lake: Lake, path: Path) -> Start:
    body, motion = first_body(lake, path)
    offsets = tuple(motion.rest_offsets.ravel().tolist())
    content = content_hash(path)
    return Start(str(path), "", "", body.fps, 0, len(motion.positions), content, None, offsets, outside=True)


def motions_of(request: Request, starts: Sequence[Start], numbers: Iterable[int], attempt: int = 0) -> list[Motion]:
    """The motions of these numbers; each draws what it starts from by the seed, its number and the attempt."""
    drawn = {n: np.random.default_rng(_seeds(request, n, attempt)).integers(len(starts)) for n in numbers}
    return [Motion(number, starts[int(index)], attempt) for number, index in drawn.items()]


def _seeds(request: Request, number: int, attempt: int) -> list[int]:
    return [request.seed, number, *([attempt] if attempt else [])]


def make(generator: MotionGenerator, lake: Lake, request: Request, motions: Sequence[Motion]) -> list[GeneratedMotion]:
    """The motions, in their order.

    Raises:
        UserError: a start is shorter than needed.
    """
    from motionlake.motion.generation import MotionRequest, SeedClip

    starts = sorted({motion.start for motion in motions}, key=lambda start: (start.clip, start.start, start.stop))
    clips: dict[str, Frames | CanonicalMotion] = {
        clip.clip: clip for clip in frames_of_clips(lake, [asdict(s) for s in starts if not s.outside])
    }
    seeds = {}
    for start in starts:
        whole = first_body(lake, Path(start.clip))[1] if start.outside else clips[start.clip]
        own = slice(start.start, start.stop)
        positions, rotations = whole.positions[own].astype(float), whole.rotations[own].astype(float)
        offsets = np.array(start.rest_offsets, dtype=float).reshape(-1, 3)
        seeds[start] = SeedClip(start.clip, positions, start.fps, offsets, rotations)
    control = _control(request, None if request.style is None else style_frames(lake, request.style))
    wanted = []
    for motion in motions:
        seed = int(np.random.SeedSequence(_seeds(request, motion.number, motion.attempt)).generate_state(1)[0])
        options = (seed, seeds[motion.start], request.pace, request.temperature)
        keys = _keys(request, seeds[motion.start])
        wanted.append(MotionRequest(request.classes, request.lasts, *options, request.shares, control, keys))
    try:
        made = generator.generate(wanted)
    except ValueError as error:
        raise UserError(str(error)) from error
    if request.edited is not None:
        return [edited_clip(request, one, wish.start) for one, wish in zip(made, wanted, strict=True)]
    if request.keyframes:
        first = request.keyframes[0].frame
        return [replace(one, seed_start=first, seed_stop=first + 1) for one in made]
    return made


def _keys(request: Request, seed: SeedClip) -> KeyPoses | None:
    if request.edited is not None:
        return edge_poses(request, seed)
    return key_poses(request) if request.keyframes else None


def _control(request: Request, style: SeedClip | None) -> Control | None:
    """Where a motion goes; None where the request says nothing of it."""
    from motionlake.motion.generation import Control

    facing = None if request.facing is None else math.radians(request.facing)
    path = None if request.path is None else path_of(request.path)
    control = Control(path, request.speed, facing, request.loop, request.from_end, style)
    return None if control == Control() else control


def canonical_motion(made: GeneratedMotion, filled: Sequence[str] = ()) -> CanonicalMotion:
    """The motion as clips have it; in its own rig, the canonical skeleton's BVH, it is in centimetres.

    Args:
        made: as a generator gives it.
        filled: joints that rigs of the training clips lack.
    """
    from motionlake.motion.canonicalise import METRES_PER_UNIT, CanonicalMotion, body_height
    from motionlake.motion.kinematics import continuous_signs, forward_kinematics

    positions = np.asarray(made.positions, dtype=float)
    rotations = continuous_signs(np.asarray(made.rotations, dtype=float))
    rest_offsets = np.asarray(made.rest_offsets, dtype=float)
    errors = np.linalg.norm(forward_kinematics(positions[:, 0], rotations, rest_offsets) - positions, axis=-1)
    return CanonicalMotion(
        fps=made.fps, root=positions[:, 0], rotations=rotations, positions=positions, rest_offsets=rest_offsets,
        body_height=body_height(rest_offsets), twist=bool(made.sources), filled=tuple(filled), up="y",
        metres_per_unit=METRES_PER_UNIT, fk_error=float(errors.max()), fk_error_mean=float(errors.mean()),
    )  # fmt: skip
