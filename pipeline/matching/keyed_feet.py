"""Feet that stand between given poses stay in place, but at the poses themselves, which are as they are given."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array, Int64Array
from motionlake.motion.kinematics import forward_kinematics, local_rotations, world_rotations
from motionlake.motion.skeleton import INDEX
from motionlake.motion.standing import SIDES
from motionlake.motion.two_bones import bent, level_ahead, turn_leg
from scipy.ndimage import label

FAR: Final = 0.3  # body lengths that a foot is held back while it stands, at most
BLEND: Final = 0.15  # seconds over which a foot comes to where it stands, and leaves it


def feet_held(
    hips: Float64Array, rotations: Float64Array, rest_offsets: Float64Array, stands: BoolArray, keys: Int64Array,
    fps: float, size: float,
) -> Float64Array:  # fmt: skip
    """Local rotations [T, 21, 4] by which hips and knees hold feet where they stand; those at the poses stay.

    Args:
        hips: [T, 3] metres.
        rotations: [T, 21, 4] local.
        rest_offsets: [21, 3] metres.
        stands: [T, 2] whether the left and the right foot stands.
        keys: [K] frames of the poses.
        fps: frames a second.
        size: metres of a body length.
    """
    joints = forward_kinematics(hips, rotations, rest_offsets)
    world = world_rotations(rotations)
    ahead = level_ahead(joints[:, INDEX["left_hip"]], joints[:, INDEX["right_hip"]])
    for i, side in enumerate(SIDES):
        hip, knee, ankle, toe = (INDEX[f"{side}_{part}"] for part in ("hip", "knee", "ankle", "toe"))
        change = still(joints[:, [ankle, toe]], stands[:, i], keys, round(BLEND * fps), FAR * size)
        leg = (joints[:, hip], joints[:, knee], joints[:, ankle])
        turn_leg(world, (hip, knee), leg, *bent(*leg, leg[2] + change, ahead))
    held = local_rotations(world)
    held[keys] = rotations[keys]
    return held


def still(foot: Float64Array, standing: BoolArray, keys: Int64Array, blend: int, far: float) -> Float64Array:
    """[T, 3] by which a foot ([T, 2, 3] ankle and toe) moves, level, to stay while it stands; none at the poses.

    Where it stands at poses it goes evenly from where they have it to where the next has it; else it stays where it is
    in the middle. Of ankle and toe the one that wanders less bears.
    """
    change = np.zeros((len(foot), 3))
    runs, count = label(standing)
    for run in range(1, count + 1):
        rows = np.flatnonzero(runs == run)
        own = keys[(keys >= rows[0]) & (keys <= rows[-1])]
        at = own if len(own) else rows[[len(rows) // 2]]
        flat = foot[rows][..., [0, 2]]
        bears = int(np.ptp(flat, axis=0).sum(axis=-1).argmin())
        places = foot[at, bears][:, [0, 2]]
        wanted = np.stack([np.interp(rows, at, places[:, axis]) for axis in (0, 1)], axis=1)
        off = wanted - flat[:, bears]
        if np.linalg.norm(off, axis=1).max() > far:
            continue
        change[rows[:, None], [0, 2]] += off
        for edge, step, value in ((rows[0], -1, off[0]), (rows[-1], 1, off[-1])):
            # At the next pose a foot is where that has it.
            ahead = [at - edge for at in (*keys.tolist(), -1, len(foot)) if (at - edge) * step > 0]
            reach = min(blend, *(abs(frames) for frames in ahead))
            for ago in range(1, reach):
                share = 0.5 + 0.5 * np.cos(np.pi * ago / reach)
                if not standing[edge + step * ago]:
                    change[edge + step * ago, [0, 2]] += share * value
    return change
