"""Motions of one request that differ: none nearer to another than recorded clips of the class are to one another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection
from motionlake.lake.layout import Lake
from motionlake.motion.calibration import recorded_range
from motionlake.motion.generation import FPS
from motionlake.motion.resampling import resample
from motionlake.motion.skeleton import body_length, body_poses
from motionlake.stages.generator_model import classed_motions, long_enough
from motionlake.stages.synthesis_control import Request
from motionlake.stages.synthesis_requests import Motion, make, motions_of
from motionlake.stages.synthesis_starts import Start
from motionlake.stages.training_clips import frames_of_clips

if TYPE_CHECKING:
    from motionlake.motion.generation import MotionGenerator

TRIES: Final = 8  # seeds a motion
FLOOR: Final = 0.05  # quantile of the distances between recorded clips below which motions are alike
CLIPS: Final = 40  # recorded clips that the floor is measured on
SECONDS: Final = 4.0  # of motions that are compared
STEP: Final = 3  # frames at 30 a second from pose to pose
SHIFTS: Final = 5  # poses by which one motion is moved against the other, either way


@dataclass(frozen=True)
class Diverse:
    """Motions that differ as far as they could be made to.

    Attributes:
        motions: in their order.
        floor: how far recorded clips are from one another, body lengths.
        alike: numbers of motions that are nearer than that to one before them, for all seeds that were tried.
    """

    motions: list[Motion]
    floor: float
    alike: list[int]


def poses(positions: Float64Array, fps: float, size: float) -> Float64Array:
    """[P, 21, 3] poses of a motion's first seconds, seen from the body, in body lengths.

    Args:
        positions: [F, 21, 3] joints, metres.
        fps: frames a second.
        size: metres of a body length.
    """
    start, stop = recorded_range(positions, fps)
    sampled = resample(positions[start:stop].astype(float), fps, FPS)[: round(SECONDS * FPS) : STEP]
    return np.asarray(body_poses(sampled) / size)


def distance(one: Float64Array, other: Float64Array) -> float:
    """Mean distance of the joints of two motions [P, 21, 3], one of which is moved in time to be nearest."""
    found = np.inf
    for shift in range(-SHIFTS, SHIFTS + 1):
        first, second = one[max(0, shift) :], other[max(0, -shift) :]
        count = min(len(first), len(second))
        if count:
            found = min(found, float(np.linalg.norm(first[:count] - second[:count], axis=-1).mean()))
    return found


def floor_of(clips: Sequence[Float64Array]) -> float | None:
    """The distance that 95 % of pairs of recorded motions exceed; None of fewer than three."""
    if len(clips) < 3:
        return None
    apart = [distance(clips[i], clips[j]) for i in range(len(clips)) for j in range(i)]
    return float(np.quantile(apart, FLOOR))


def diverse(
    con: Connection, lake: Lake, generator: MotionGenerator, request: Request, starts: Sequence[Start], count: int
) -> Diverse:
    """Motions 1 to `count` of a request; one that is too near to one before it is made again from another seed.

    So a motion depends on those before it alone, and is the same however many are made.

    Raises:
        UserError: the lake has fewer than three recorded clips of the first class to measure the floor on.
    """
    floor = floor_of(_recorded(con, lake, request.classes[0]))
    if floor is None:
        raise UserError(
            f"--diverse: {lake.root} has fewer than three recorded clips of class {request.classes[0]}: nothing says "
            "how far motions of it differ; label more, then `motionlake train synthesis`"
        )
    kept: list[Float64Array] = []
    motions: list[Motion] = []
    alike: list[int] = []
    for number in range(1, count + 1):
        best: tuple[float, Motion, Float64Array] | None = None
        for attempt in range(TRIES):
            (tried,) = motions_of(request, starts, [number], attempt)
            (made,) = make(generator, lake, request, [tried])
            own = poses(made.positions, made.fps, body_length(made.rest_offsets))
            near = min((distance(own, other) for other in kept), default=np.inf)
            if best is None or near > best[0]:
                best = (near, tried, own)
            if near >= floor:
                break
        assert best is not None, "one motion is made at least"
        kept.append(best[2])
        motions.append(best[1])
        alike += [number] * (best[0] < floor)
    return Diverse(motions, floor, alike)


def _recorded(con: Connection, lake: Lake, label: str) -> list[Float64Array]:
    rows = [row for row in classed_motions(con, None, label) if long_enough(row)]
    chosen = [rows[i] for i in np.linspace(0, len(rows) - 1, min(CLIPS, len(rows))).round().astype(int)]
    found = {clip.clip: clip for clip in frames_of_clips(lake, chosen)}
    return [
        poses(
            found[row["clip"]].positions[row["start"] : row["stop"]].astype(float), row["fps"],
            body_length(np.array(row["rest_offsets"], dtype=float).reshape(-1, 3)),
        )
        for row in chosen
    ]  # fmt: skip
