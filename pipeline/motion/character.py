"""A character: the joint tree of somebody's rig, what of it is which canonical joint, and how it stands in a T-pose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.motion.canonicalise import CanonicalMotion, canonicalise, turn_to_y_up
from motionlake.motion.clip import Hierarchy, SolvedMotion, SourceClip
from motionlake.motion.kinematics import solve, world_rotations
from motionlake.motion.posing import posed
from motionlake.motion.rest import Binding, bind, mean_offsets, rest_orientations, standing_rest, to_canonical_rest
from motionlake.motion.rigs import Rest, RigMap
from motionlake.motion.rotations import IDENTITY, conjugate, multiply
from motionlake.motion.skeleton import INDEX, JOINTS, chained
from motionlake.motion.standing import SIDES, FlatFoot, foot_of_pose, measured_foot


@dataclass(frozen=True, repr=False)
class Character:
    """What a motion is put on.

    Attributes:
        rig: name of its rig map.
        hierarchy: its joint tree, as the file has it.
        source: canonical joint index -> index of the joint in the file, for those that it has.
        in_rest: [21, 4] global orientation, y up, of the file's joint in the canonical T-pose.
        relative_rest: [J, 4] orientation of each joint relative to its parent in that pose.
        offsets: [J, 3] of each joint from its parent, file units.
        up, metres_per_unit: of the file.
        rest_offsets: [21, 3] canonical bones, metres.
        foot: how its feet stand flat, by a zero pose that stands or else by the frames in which they stand; None where
            neither tells.
    """

    rig: str
    hierarchy: Hierarchy
    source: Mapping[int, int]
    in_rest: Float64Array
    relative_rest: Float64Array
    offsets: Float64Array
    up: str
    metres_per_unit: float
    rest_offsets: Float64Array
    foot: FlatFoot | None


def character_of(
    clip: SourceClip, rig: RigMap, *, up: str | None = None, metres_per_unit: float | None = None
) -> Character:
    """The character of a clip file, from its zero pose; where that is no standing body, from its first frame.

    Raises:
        ClipError: the file holds positions only, or its motion cannot be put on the canonical skeleton.
    """
    motion = solve(clip)
    if motion.world is None:
        raise ClipError("holds positions only: a character needs joints that turn")
    canonical = canonicalise(clip, motion, rig, up=up, metres_per_unit=metres_per_unit)
    binding, scale = bind(rig, clip.hierarchy), canonical.metres_per_unit
    in_rest = None if rig.rest is Rest.POSITIONS else to_canonical_rest(binding, motion, scale)
    standing = standing_rest(binding, motion, scale) if rig.rest is Rest.ZERO else None
    foot = measured_foot(canonical) if standing is None else foot_of_pose(standing[1])
    if in_rest is None:
        in_rest = _from_first_frame(binding, motion, canonical)
    orientations = rest_orientations(binding)
    above = list(clip.hierarchy.parents)
    relative = multiply(conjugate(orientations[above]), orientations)
    relative[0] = orientations[0]
    return Character(
        rig=rig.name,
        hierarchy=clip.hierarchy,
        source=binding.source,
        in_rest=in_rest,
        relative_rest=relative,
        offsets=mean_offsets(clip.hierarchy.parents, motion),
        up=canonical.up,
        metres_per_unit=scale,
        rest_offsets=canonical.rest_offsets,
        foot=foot,
    )


def _from_first_frame(binding: Binding, motion: SolvedMotion, canonical: CanonicalMotion) -> Float64Array:
    """[21, 4] orientations of the file's joints in the T-pose, from those that they have in a known pose."""
    assert motion.world is not None
    pose = world_rotations(canonical.rotations[:1])[0]
    result = np.tile(IDENTITY, (len(JOINTS), 1))
    turn = turn_to_y_up(canonical.up)
    for joint, source in binding.source.items():
        result[joint] = multiply(conjugate(pose[joint]), multiply(turn, motion.world[0, source]))
    return result


def leg_length(rest_offsets: Float64Array) -> float:
    """Metres from the hips down to the ankles in the canonical rest pose with these offsets [21, 3]."""
    heights = chained(rest_offsets)[:, 1]
    return float(-np.mean([heights[INDEX[f"{side}_ankle"]] for side in SIDES]))


def zero_clip(hierarchy: Hierarchy) -> SourceClip:
    """Two frames of a joint tree in its zero pose; they are what `character_of` needs of a skeleton without motion."""
    local = np.tile(IDENTITY, (2, len(hierarchy.joints), 1))
    return posed(hierarchy, local, np.tile(hierarchy.offsets, (2, 1, 1)), 30.0)
