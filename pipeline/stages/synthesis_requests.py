"""Requests of new motion: what they may say, the recorded clips that their motions start from, and making these."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

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
from motionlake.stages.training_clips import check_chosen, frames_of_clips

if TYPE_CHECKING:
    from motionlake.glogen.generator import GeneratedMotion, TrainedGenerator
    from motionlake.motion.canonicalise import CanonicalMotion

DRAWN: Final = ("start", "outside", "split", "min_quality")  # of a request: what its starts are drawn from
LONGEST: Final = 3600.0  # seconds of one motion


@dataclass(frozen=True)
class Request:
    """Motions to make.

    Attributes:
        classes: one after the other in each motion, equal shares of the time.
        seconds: of each motion.
        seed: of what is drawn; every motion is drawn for itself, so that it does not depend on how many are made.
        start: recorded clip that all start from, or with `outside` a clip file that need not be in the lake (its first
            body); None draws a clip of the first class for each.
        outside: `start` is the path of a file.
        split: draws from this split only.
        pace: 2 is twice as fast.
        temperature: of the latent variables: 0 for the likeliest motion, 1 as recordings vary.
        min_quality: the worst verdict of stage "quality" that a clip may have that is drawn; None: any.
    """

    classes: tuple[str, ...]
    seconds: float
    seed: int = 0
    start: str | None = None
    outside: bool = False
    split: str | None = None
    pace: float = 1.0
    temperature: float = 1.0
    min_quality: str | None = None


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
    """One motion of a request: its number from 1, and what it starts from."""

    number: int
    start: Start


def check_request(request: Request) -> None:
    """Raises `UserError` for numbers that no motion can have."""
    if not 0 < request.seconds <= LONGEST:
        raise UserError(f"{request.seconds:g} seconds: ask for more than 0, and at most {LONGEST:g}")
    if not (request.pace > 0 and math.isfinite(request.pace)):
        raise UserError(f"pace {request.pace:g}: must be more than 0; 1 is as recorded, 2 twice as fast")
    if not (request.temperature >= 0 and math.isfinite(request.temperature)):
        raise UserError(f"temperature {request.temperature:g}: must be 0 or more; 0 gives the likeliest motion")
    if request.seed < 0:
        raise UserError(f"seed {request.seed}: must be 0 or more")
    if request.start is not None and request.split is not None:
        raise UserError("a motion starts from one clip (--from) or from those of a split (--split): leave one out")


def find_starts(con: Connection, lake: Lake, model: Model, request: Request) -> list[Start]:
    """What the motions of a request may start from, by clip and frame.

    Recorded motion of the first class; in a lake that knows of no clip's class, any recorded clip.

    Raises:
        UserError: no motion can have these numbers, the generator does not know a class, the clip to start from is
            synthetic, the file cannot be read, or no recorded clip of the first class is long enough.
    """
    check_request(request)
    check_classes(model, request.classes)
    if request.start is not None and request.outside:
        return [_outside(lake, Path(request.start))]
    if request.start is not None:
        row = fetch(con, "clip", {"clip": request.start})[0]
        if row["format"] == "synthetic":
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


def motions_of(request: Request, starts: Sequence[Start], numbers: Iterable[int]) -> list[Motion]:
    """The motions of these numbers; each draws what it starts from by the seed and its number."""
    drawn = {n: np.random.default_rng([request.seed, n]).integers(len(starts)) for n in numbers}
    return [Motion(number, starts[int(index)]) for number, index in drawn.items()]


def make(generator: TrainedGenerator, lake: Lake, request: Request, motions: Sequence[Motion]) -> list[GeneratedMotion]:
    """The motions, in their order.

    Raises:
        UserError: a start is shorter than needed.
    """
    from motionlake.glogen.generator import MotionRequest, SeedClip

    starts = sorted({motion.start for motion in motions}, key=lambda start: (start.clip, start.start, start.stop))
    clips = {c.clip: c.positions for c in frames_of_clips(lake, [asdict(s) for s in starts if not s.outside])}
    seeds = {}
    for start in starts:
        whole = first_body(lake, Path(start.clip))[1].positions if start.outside else clips[start.clip]
        offsets = np.array(start.rest_offsets, dtype=float).reshape(-1, 3)
        seeds[start] = SeedClip(start.clip, whole[start.start : start.stop].astype(float), start.fps, offsets)
    wanted = []
    for motion in motions:
        seed = int(np.random.SeedSequence([request.seed, motion.number]).generate_state(1)[0])
        options = (seed, seeds[motion.start], request.pace, request.temperature)
        wanted.append(MotionRequest(request.classes, request.seconds, *options))
    try:
        return generator.generate(wanted)
    except ValueError as error:
        raise UserError(str(error)) from error


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
        body_height=body_height(rest_offsets), twist=False, filled=tuple(filled), up="y",
        metres_per_unit=METRES_PER_UNIT, fk_error=float(errors.max()), fk_error_mean=float(errors.mean()),
    )  # fmt: skip
