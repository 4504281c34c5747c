"""Making motions that are requested."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from motionlake.errors import UserError
from motionlake.lake.layout import Lake
from motionlake.stages.synthesis_control import Request
from motionlake.stages.synthesis_edits import edge_poses, edited_clip
from motionlake.stages.synthesis_keys import key_poses, style_frames
from motionlake.stages.synthesis_options import path_of
from motionlake.stages.synthesis_starts import Start, seed_clips

if TYPE_CHECKING:
    from motionlake.motion.canonicalise import CanonicalMotion
    from motionlake.motion.generation import Control, GeneratedMotion, MotionGenerator, SeedClip
    from motionlake.motion.keyframes import KeyPoses


@dataclass(frozen=True)
class Motion:
    """One motion of a request: its number from 1, what it starts from, and how often it was tried before."""

    number: int
    start: Start
    attempt: int = 0


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
    from motionlake.motion.generation import MotionRequest

    seeds = seed_clips(lake, {motion.start for motion in motions})
    control = _control(request, None if request.style is None else style_frames(lake, request.style))
    wanted = []
    for motion in motions:
        seed = int(np.random.SeedSequence(_seeds(request, motion.number, motion.attempt)).generate_state(1)[0])
        options = (seed, seeds[motion.start], request.pace, request.temperature)
        keys = _keys(request, seeds[motion.start])
        wanted.append(MotionRequest(request.classes, request.lasts, *options, request.parts, control, keys))
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
