"""A motion of SMPL's joints, whatever its body, put on the mean body of SMPL."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.motion.canonicalise import turn_to_y_up
from motionlake.motion.clip import SourceClip
from motionlake.motion.kinematics import solve
from motionlake.motion.rigs import joints_by_name
from motionlake.motion.rotations import IDENTITY, multiply, rotate
from motionlake.motion.skeleton import chained
from motionlake.motion.smpl import BODY_JOINTS, JOINTS, OFFSETS, PARENTS

_LEG: Final = ("hip", "knee", "ankle")


@dataclass(frozen=True)
class SmplMotion:
    """A motion of the mean body, y up.

    Attributes:
        root: [F, 3] places of the pelvis, metres.
        rotations: [F, 24, 4] local rotations (w, x, y, z) from the T-pose.
        scale: of the way that the pelvis goes, from the clip's body to the mean body: the ratio of their legs.
    """

    root: Float64Array
    rotations: Float64Array
    scale: float


def on_mean_body(clip: SourceClip, metres_per_unit: float, up: str) -> SmplMotion:
    """A clip that has SMPL's joints and rotations from SMPL's T-pose, put on the mean body.

    Where its legs are longer or shorter than the mean body's, its way is scaled by the ratio about the origin, which
    lies on the ground, so that feet keep standing.

    Raises:
        ClipError: a body joint is missing (hands may be), the clip holds positions only, or its legs have no length.
    """
    names = joints_by_name(clip.hierarchy.joints)
    if missing := [name for name in JOINTS[:BODY_JOINTS] if name not in names]:
        raise ClipError(f"is no motion of the SMPL skeleton: it has no joint {missing[0]}")
    motion = solve(clip)
    if motion.local is None:
        raise ClipError("holds positions only, without rotations")
    rotations = np.tile(IDENTITY, (len(motion.local), len(JOINTS), 1))
    for joint, name in enumerate(JOINTS):
        if name in names:
            rotations[:, joint] = motion.local[:, names[name]]
    turn = turn_to_y_up(up)
    rotations[:, 0] = multiply(turn, np.ascontiguousarray(motion.local[:, names["pelvis"]]))
    legs = _leg_length({name: motion.positions[:, names[name]] for name in JOINTS[:BODY_JOINTS]}) * metres_per_unit
    if not legs > 0:
        raise ClipError("its legs have no length")
    mean_body = chained(OFFSETS, PARENTS)
    scale = _leg_length({name: mean_body[None, joint] for joint, name in enumerate(JOINTS)}) / legs
    root = rotate(turn, motion.positions[:, names["pelvis"]]) * (metres_per_unit * scale)
    return SmplMotion(root, rotations, scale)


def _leg_length(places: dict[str, Float64Array]) -> float:
    """Thigh and shin together, the mean of both sides and of all frames; `places` [F, 3] by joint."""
    bones = [
        np.linalg.norm(places[f"{side}_{lower}"] - places[f"{side}_{upper}"], axis=-1).mean()
        for side in ("left", "right")
        for upper, lower in itertools.pairwise(_LEG)
    ]
    return float(sum(bones)) / 2
