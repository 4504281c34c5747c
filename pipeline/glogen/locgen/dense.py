"""Dense motion of sparse poses, by a LocGen network."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import torch
from motionlake.arrays import Float64Array
from motionlake.glogen.locgen.interpolation import between, interpolated_motion
from motionlake.glogen.locgen.network import MOVING, POSE, Between, Frames
from motionlake.glogen.trajectories.motion import FPS, JOINTS_GIVEN, BodyMotion, interpolated
from motionlake.glogen.trajectories.sparse import HEIGHT

# Batches of exactly this many, the last one filled up, so that a motion does not depend on those beside it.
BATCH: Final = 16


def dense_motions(
    network: Frames | Between, rows: Sequence[Float64Array], times: Sequence[Float64Array], frames: int
) -> list[BodyMotion]:
    """Motions of `frames` frames at 30 a second; the first is a thirtieth of a second after the first sparse pose.

    Args:
        network: trained.
        rows: of each motion its sparse poses [n, 65].
        times: of each the seconds of these, ascending from 0; `frames` frames lie within.
        frames: T.
    """
    at = np.arange(1, frames + 1) / FPS
    given = np.stack([interpolated_motion(r, t, np.minimum(at, t[-1])) for r, t in zip(rows, times, strict=True)])
    if isinstance(network, Between):
        return [_between(network, *one, at) for one in zip(rows, times, given, strict=True)]
    made = []
    for start in range(0, len(given), BATCH):
        some = given[start : start + BATCH]
        batch = np.concatenate([some, np.repeat(some[:1], BATCH - len(some), axis=0)])
        with torch.inference_mode():
            found = network(torch.from_numpy(batch).float())
            scale, mean = network.scale.scale[:MOVING], network.scale.mean[:MOVING]
            moving = (found[..., :MOVING] * scale + mean).double().numpy()
            stands = torch.sigmoid(found[..., MOVING:]).double().numpy()
        made += [_motion(moving[i], stands[i]) for i in range(len(some))]
    return made


def _motion(moving: Float64Array, stands: Float64Array) -> BodyMotion:
    joints = moving[:, :HEIGHT].reshape(len(moving), JOINTS_GIVEN, 3)
    return BodyMotion(joints, moving[:, HEIGHT], moving[:, HEIGHT + 1 : HEIGHT + 3], moving[:, HEIGHT + 3], stands)


def _between(
    network: Between, rows: Float64Array, times: Float64Array, given: Float64Array, at: Float64Array
) -> BodyMotion:
    """The thesis's: M poses between each two sparse poses, evenly in time; ways and turning as interpolated."""
    count = network.recipe.between
    poses = np.stack([between(rows[i, :POSE], rows[i + 1, :POSE], count) for i in range(len(rows) - 1)])
    with torch.inference_mode():
        found = network(torch.from_numpy(poses).float())
        natural = (found * network.scale.scale[:POSE] + network.scale.mean[:POSE]).double().numpy()
    shares = np.arange(1, count + 1) / count
    instants = np.concatenate([[0.0], (times[:-1, None] + np.diff(times)[:, None] * shares).ravel()])
    known = np.concatenate([rows[:1, :POSE], natural.reshape(-1, POSE)])
    places = np.interp(np.minimum(at, times[-1]), instants, np.arange(len(instants)))
    pose = interpolated(known, places)
    return _motion(np.concatenate([pose, given[:, POSE:MOVING]], axis=1), np.zeros((len(at), 2)))
