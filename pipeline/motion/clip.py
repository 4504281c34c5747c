"""A clip as its file holds it: the joint tree, the raw channels, and the motion they describe."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array

POSITION_CHANNELS: Final = ("Xposition", "Yposition", "Zposition")
ROTATION_CHANNELS: Final = ("Xrotation", "Yrotation", "Zrotation")
QUATERNION_CHANNELS: Final = ("Wquaternion", "Xquaternion", "Yquaternion", "Zquaternion")


class ChannelKind(StrEnum):
    """What the channels of a file are."""

    EULER = "euler"  # rotations about axes, in degrees, and translations
    QUATERNION = "quaternion"  # rotations as quaternions, and translations
    POSITIONS = "positions"  # global joint positions, no rotations


@dataclass(frozen=True)
class Hierarchy:
    """The joint tree of a file: J joints, parents before children.

    A joint stands at the *start* of the bone it turns, as in BVH (an ASF bone is a joint at the bone's
    start; the end of a bone without children is an end site).

    Attributes:
        joints: J names as the file spells them.
        parents: J indices; -1 at the root, which is joint 0.
        offsets: [J, 3] rest offset from the parent joint, file units (zeros for POSITIONS).
        channels: for each joint its channel names in file order. EULER: of `POSITION_CHANNELS` and
            `ROTATION_CHANNELS`. QUATERNION: of `POSITION_CHANNELS` and all `QUATERNION_CHANNELS`. POSITIONS:
            "x", "y", "z". A position channel replaces the rest offset along its axis.
        kind: what the channels are.
        axes: [J, 4] unit quaternions (w, x, y, z): local rotation = axis * R(channels) * axis^-1. Identity
            but for ASF.
        fixed_axes: EULER only. False (BVH): the listed rotations multiply left to right. True (ASF): they
            are applied in listed order about fixed axes, hence multiply right to left.
        end_sites: (joint index, offset) of every end site, file units; a joint may have several.
    """

    joints: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: Float64Array
    channels: tuple[tuple[str, ...], ...]
    kind: ChannelKind
    axes: Float64Array
    fixed_axes: bool = False
    end_sites: tuple[tuple[int, tuple[float, float, float]], ...] = ()

    @classmethod
    def of_positions(cls, joints: tuple[str, ...], parents: tuple[int, ...]) -> Hierarchy:
        """The tree of a clip of positions."""
        count = len(joints)
        axes = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
        return cls(joints, parents, np.zeros((count, 3)), (("x", "y", "z"),) * count, ChannelKind.POSITIONS, axes)

    @property
    def channel_names(self) -> tuple[str, ...]:
        """Every channel in file order, as "joint.channel"."""
        return tuple(f"{j}.{c}" for j, cs in zip(self.joints, self.channels, strict=True) for c in cs)


def depth_first(parents: Sequence[int]) -> list[int]:
    """The joints that hang from the roots (parent -1), every branch whole before the next; siblings as they come."""
    children: dict[int, list[int]] = {}
    for joint, parent in enumerate(parents):
        children.setdefault(parent, []).append(joint)
    order: list[int] = []
    waiting = children.get(-1, [])[::-1]
    while waiting:
        order.append(waiting.pop())
        waiting += reversed(children.get(order[-1], []))
    return order


@dataclass(frozen=True)
class SourceClip:
    """One body's motion as one file holds it.

    Attributes:
        hierarchy: the joint tree and channel layout.
        channels: [F, C] raw values in `hierarchy.channel_names` order: degrees, file units.
        fps: frames a second.
        body: suffix of the clip's name where one file holds several bodies, else "".
        metres_per_unit: where the file itself declares its length unit, else None.
        up: where the file itself, or its format, declares its up axis, one of x y z -x -y -z; else None.
        repaired: frames whose missing values were filled by interpolation (Kinect).
        notes: what a person should know of how the file was read.
        filled: joints of the hierarchy that the file does not hold, and that were made up when it was read.
        twist: False where the rotations come from positions, so that turns about a bone's axis are unknown.
    """

    hierarchy: Hierarchy
    channels: Float64Array
    fps: float
    body: str = ""
    metres_per_unit: float | None = None
    up: str | None = None
    repaired: int = 0
    filled: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    twist: bool = True


@dataclass(frozen=True)
class SolvedMotion:
    """Forward kinematics of a `SourceClip`, in file units and axes.

    Attributes:
        positions: [F, J, 3] global joint positions.
        local: [F, J, 4] rotation relative to the parent (w, x, y, z), or None for POSITIONS.
        world: [F, J, 4] global rotation, or None for POSITIONS. In the zero pose of the file every world
            rotation is the identity.
    """

    positions: Float64Array
    local: Float64Array | None
    world: Float64Array | None
