"""The skeleton of OpenSim's full-body gait models: bodies, where their joints are, and how coordinates turn them.

Offsets and axes are those of the full-body model of Rajagopal et al., "Full-body musculoskeletal model for
muscle-driven simulation of human gait" (IEEE TBME 2016), whose arms and trunk are those of Hamner, Seth and Delp (2010)
and whose legs' coordinates have the names of Delp et al. (1990). Left out is how the model's knee slides and turns
the shank about its own length as it bends.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.clip import POSITION_CHANNELS, QUATERNION_CHANNELS, ChannelKind, Hierarchy
from motionlake.motion.rotations import IDENTITY, from_axis_angle, multiply, rotate

Axis = tuple[float, float, float]


@dataclass(frozen=True)
class Body:
    """A body and the joint at which it begins.

    Attributes:
        name, parent: of the body and of the one it hangs from; "" at the root.
        offset: of its joint in the parent's frame, metres: x forward, y up, z to the right.
        turns: coordinates and their axes, in the order in which their rotations are multiplied.
    """

    name: str
    parent: str
    offset: Axis
    turns: tuple[tuple[str, Axis], ...] = ()


# From the model's frame of the pelvis to midway between the hips, where the joint `pelvis` of a clip stands.
HIPS: Final[Axis] = (-0.056276, -0.07849, 0.0)
TRANSLATION: Final = ("pelvis_tx", "pelvis_ty", "pelvis_tz")
_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_KNEE: Final = "knee_angle"
_MIDDLE: Final = (
    Body("pelvis", "", (0.0, 0.0, 0.0), (("pelvis_tilt", _Z), ("pelvis_list", _X), ("pelvis_rotation", _Y))),
    Body("torso", "pelvis", (-0.1007 - HIPS[0], 0.0815 - HIPS[1], 0.0),
         (("lumbar_extension", _Z), ("lumbar_bending", _X), ("lumbar_rotation", _Y))),
    # The models' torso ends in a head without a joint: the neck's is between their markers of C7 and the breastbone.
    Body("neck", "torso", (0.0, 0.4, 0.0), (("neck_flexion", _Z), ("neck_bending", _X), ("neck_rotation", _Y))),
    Body("head", "neck", (0.02, 0.13, 0.0)),
)  # fmt: skip
_RIGHT: Final = (
    Body("femur", "pelvis", (0.0, 0.0, 0.07726), (("hip_flexion", _Z), ("hip_adduction", _X), ("hip_rotation", _Y))),
    Body("tibia", "femur", (-4.6e-07, -0.404425, -0.00126526), ((_KNEE, (0.0, -0.0707131, -0.997497)),)),
    Body("talus", "tibia", (-0.01, -0.4, 0.0), (("ankle_angle", (-0.105014, -0.174022, 0.979126)),)),
    Body("calcn", "talus", (-0.04877, -0.04195, 0.00792), (("subtalar_angle", (0.78718, 0.604747, -0.120949)),)),
    Body("toes", "calcn", (0.1788, -0.002, 0.00108), (("mtp_angle", (0.580954, 0.0, -0.813936)),)),
    Body("humerus", "torso", (0.003155, 0.3715, 0.17), (("arm_flex", _Z), ("arm_add", _X), ("arm_rot", _Y))),
    Body("ulna", "humerus", (0.013144, -0.286273, -0.009595), (("elbow_flex", (0.226047, 0.022269, 0.973862)),)),
    Body("radius", "ulna", (-0.006727, -0.013007, 0.026083), (("pro_sup", (0.056398, 0.998406, 0.001952)),)),
    Body("hand", "radius", (-0.008797, -0.235841, 0.01361), (("wrist_flex", _Z), ("wrist_dev", _X))),
)


def _side(body: Body, side: str) -> Body:
    """A body of the right side, called so, or its mirror image, which turns the other way about x and y."""
    x, y, z = body.offset
    mirrored = side == "l"
    turns = tuple((f"{name}_{side}", (-axis[0], -axis[1], axis[2]) if mirrored else axis) for name, axis in body.turns)
    parent = body.parent if body.parent in ("pelvis", "torso") else f"{body.parent}_{side}"
    return Body(f"{body.name}_{side}", parent, (x, y, -z if mirrored else z), turns)


BODIES: Final = (*_MIDDLE, *(_side(body, side) for side in ("r", "l") for body in _RIGHT))
COORDINATES: Final = frozenset(name for body in BODIES for name, _ in body.turns)
KNEES: Final = (f"{_KNEE}_r", f"{_KNEE}_l")


def opensim_hierarchy() -> Hierarchy:
    """The tree of the bodies, quaternions for channels and a place for the pelvis; y is up, and it faces x."""
    names = tuple(body.name for body in BODIES)
    return Hierarchy(
        joints=names,
        parents=tuple(names.index(body.parent) if body.parent else -1 for body in BODIES),
        offsets=np.array([body.offset for body in BODIES]),
        channels=((*POSITION_CHANNELS, *QUATERNION_CHANNELS), *(QUATERNION_CHANNELS,) * (len(BODIES) - 1)),
        kind=ChannelKind.QUATERNION,
        axes=np.tile(IDENTITY, (len(BODIES), 1)),
    )


def opensim_channels(angles: Mapping[str, Float64Array], places: Float64Array) -> Float64Array:
    """[F, C] channels of `opensim_hierarchy`.

    Args:
        angles: coordinate -> [F] degrees, as Rajagopal's model turns: a knee that bends is positive. A coordinate that
            is not there is 0.
        places: [F, 3] of the model's frame of the pelvis, metres.
    """
    columns = []
    for body in BODIES:
        turn = np.tile(IDENTITY, (len(places), 1))
        for name, axis in body.turns:
            if name in angles:
                turn = multiply(turn, from_axis_angle(np.array(axis), angles[name]))
        if not body.parent:
            columns.append(places + rotate(turn, np.array(HIPS)))
        columns.append(turn)
    return np.hstack(columns)
