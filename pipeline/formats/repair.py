"""Fill in what a depth camera did not see: missing joint positions, interpolated over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array
from motionlake.errors import ClipError

# No recording is this large; a value beyond it is a broken number, and its square must stay finite.
FARTHEST: Final = 1e5
MAX_MISSING: Final = 0.5
MIN_SEEN: Final = 2


def missing_samples(positions: Float64Array) -> BoolArray:
    """[F, J] where a joint has no position: a coordinate is not finite or absurd, or all three are zero.

    `positions` are [F, J, 3], the root first. A root at the origin in every frame that has it is a root-centred
    recording, not a missing joint.
    """
    # Most recordings lack nothing: none of their numbers is zero, not finite, or so large as their squares' sum.
    if np.vdot(positions, positions) <= FARTHEST**2 and positions[..., 0].all():
        return np.zeros(positions.shape[:2], bool)
    with np.errstate(invalid="ignore"):
        sound = all_three(np.abs(positions) <= FARTHEST)
    at_origin = all_three(positions == 0.0)
    if np.all(at_origin[:, 0] | ~sound[:, 0]):
        at_origin[:, 0] = at_origin.all(axis=1)
    return np.asarray(at_origin | ~sound)


def all_three(flags: BoolArray) -> BoolArray:
    """[F, J] where all of [F, J, 3] are true, some times as fast as NumPy's `all` over so short an axis."""
    return np.asarray(flags[..., 0] & flags[..., 1] & flags[..., 2])


def fill_missing(positions: Float64Array, missing: BoolArray, joints: Sequence[str]) -> tuple[Float64Array, int]:
    """Interpolate every `missing` joint [F, J] linearly between the frames that show it; hold it at both ends.

    Returns:
        The filled positions [F, J, 3], finite everywhere (those given, where none is missing), and how many frames
        needed it.

    Raises:
        ClipError: a joint is missing in more than half of the frames, or seen in fewer than two.
    """
    frames = len(positions)
    if frames >= MIN_SEEN and not missing.any():
        return positions, 0
    seen = frames - missing.sum(axis=0)
    worst = int(seen.argmin())
    if rarely_seen(missing).any():
        whose = "the body" if (seen == seen[worst]).all() else joints[worst]
        raise ClipError(f"{whose} is seen in {seen[worst]} of {frames} frames")
    filled = positions.copy()
    times = np.arange(frames)
    for joint in np.flatnonzero(missing.any(axis=0)):
        gaps = missing[:, joint]
        for axis in range(3):
            filled[gaps, joint, axis] = np.interp(times[gaps], times[~gaps], positions[~gaps, joint, axis])
    return filled, int(missing.any(axis=1).sum())


def fill_rotations(rotations: Float64Array, missing: BoolArray) -> Float64Array:
    """[F, J, 4] rotations (w, x, y, z) of which those that are `missing` [F, J] go evenly from the last to the next.

    Held at both ends. Every joint must be there in one frame. Where none is missing, those given.
    """
    from motionlake.motion.rotations import normalise, slerp

    if not missing.any():
        return rotations
    filled = rotations.copy()
    times = np.arange(len(rotations))
    for joint in np.flatnonzero(missing.any(axis=0)):
        seen = np.flatnonzero(~missing[:, joint])
        gaps = np.flatnonzero(missing[:, joint])
        after = np.clip(np.searchsorted(seen, gaps), 0, len(seen) - 1)
        before = np.clip(np.searchsorted(seen, gaps) - 1, 0, len(seen) - 1)
        width = np.maximum(seen[after] - seen[before], 1)
        weight = np.clip((times[gaps] - seen[before]) / width, 0.0, 1.0)
        known = normalise(rotations[seen, joint])
        filled[gaps, joint] = slerp(known[before], known[after], weight)
    return filled


def rarely_seen(missing: BoolArray) -> BoolArray:
    """[J] joints that `fill_missing` would refuse; `missing` is [F, J]."""
    seen = len(missing) - missing.sum(axis=0)
    rare: BoolArray = (seen < MIN_SEEN) | (len(missing) - seen > MAX_MISSING * len(missing))
    return rare


def carry(positions: Float64Array, missing: BoolArray, joint: int, carrier: int) -> None:
    """Place a joint where it is missing [F, J] relative to `carrier`, which is known in every frame, in place.

    Its offset is interpolated over time and held at both ends; zero where it was never seen.
    """
    gaps = missing[:, joint]
    times = np.arange(len(positions))
    offsets = positions[~gaps, joint] - positions[~gaps, carrier]
    for axis in range(3):
        between = np.interp(times[gaps], times[~gaps], offsets[:, axis]) if len(offsets) else 0.0
        positions[gaps, joint, axis] = positions[gaps, carrier, axis] + between


def repair_note(repaired: int, frames: int) -> tuple[str, ...]:
    """What a person should know of the repair; nothing where there was none."""
    return (f"{repaired} of {frames} frames had missing joints, interpolated",) if repaired else ()
