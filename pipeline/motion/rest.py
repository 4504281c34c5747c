"""From the joints of one file to canonical joints: measured ones, those that rules of the rig place, the rest pose."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.motion.clip import Hierarchy, SolvedMotion
from motionlake.motion.rigs import Fill, Rest, RigMap, joints_by_name
from motionlake.motion.rotations import (
    IDENTITY,
    MIN_LENGTH,
    conjugate,
    from_axis_angle,
    from_matrix,
    multiply,
    rotate,
    swing,
)
from motionlake.motion.skeleton import BONES, INDEX, JOINTS, PARENTS, TWIST_AXES, chained

SAMPLED_FRAMES: Final = 64
# Rest poses are modelled along the file's axes: a direction this near to an axis (degrees) is taken for it.
SNAP_DEGREES: Final = 15.0
# Least cosine of the angle between legs or torso and the vertical in a rest pose that stands.
STANDING: Final = 0.5


@dataclass(frozen=True)
class Binding:
    """A rig map bound to the joints of one file.

    Attributes:
        rig, hierarchy: what is bound to what.
        source: canonical joint index -> index of the joint in the file, measured joints only.
        rules: canonical joint index -> rule, filled joints only, each after the joints it needs.
        names: index of a joint in the file by its name (`joints_by_name`).
    """

    rig: RigMap
    hierarchy: Hierarchy
    source: dict[int, int]
    rules: dict[int, Fill]
    names: dict[str, int]

    def end_site(self, name: str) -> tuple[int, Float64Array]:
        """Index of a joint of the file, and the offset of its first end site in file units."""
        index = self.names.get(name.casefold())
        for joint, offset in self.hierarchy.end_sites:
            if joint == index:
                return joint, np.array(offset)
        raise ClipError(f"joint {name} has no end site in this file")


def bind(rig: RigMap, hierarchy: Hierarchy) -> Binding:
    """Find the rig's joints in a file.

    Raises:
        ClipError: the file lacks a joint of the rig, or its fill rules need each other.
    """
    names = joints_by_name(hierarchy.joints)
    if missing := [name for name in rig.required if name.casefold() not in names]:
        raise ClipError(f"rig {rig.name} does not fit: the file has no joint {', '.join(missing)}")
    source = {INDEX[c]: names[s.casefold()] for c, s in rig.joints.items() if s.casefold() in names}
    waiting = {INDEX[c]: rule for c, rule in rig.filled.items() if INDEX[c] not in source}
    rules: dict[int, Fill] = {}
    while waiting:
        ready = [joint for joint, rule in waiting.items() if _needs(joint, rule) <= source.keys() | rules.keys()]
        if not ready:
            raise ClipError(f"rig {rig.name}: filled joint {JOINTS[min(waiting)]} needs itself")
        rules.update({joint: waiting.pop(joint) for joint in ready})
    return Binding(rig, hierarchy, source, rules, names)


def _needs(joint: int, rule: Fill) -> set[int]:
    if rule.between is not None:
        return {INDEX[other] for other in rule.between}
    return {PARENTS[joint]} if rule.offset is not None else set()


def place(binding: Binding, positions: Float64Array, world: Float64Array | None, scale: float) -> Float64Array:
    """Canonical joints [F, 21, 3] of measured ones and of the rules `between` and `end_site`.

    Joints of the rule `offset` stand at their parent until `place_offsets` moves them.

    Args:
        binding: of the rig to the file.
        positions: [F, J, 3] of the file's joints in canonical axes, metres.
        world: [F, J, 4] of the file's joints in canonical axes, or None.
        scale: metres per file unit, for end sites.

    Raises:
        ClipError: an end site that the file has not.
    """
    placed = np.zeros((len(positions), len(JOINTS), 3))
    placed[:, list(binding.source)] = positions[:, list(binding.source.values())]
    for joint, rule in binding.rules.items():
        if rule.between is not None:
            first, second = (placed[:, INDEX[name]] for name in rule.between)
            placed[:, joint] = first + rule.at * (second - first)
        elif rule.end_site is not None:
            index, offset = binding.end_site(rule.end_site)
            if world is None:
                raise ClipError(f"{JOINTS[joint]} needs the end site of {rule.end_site}, but the file has no rotations")
            placed[:, joint] = positions[:, index] + rotate(np.ascontiguousarray(world[:, index]), offset * scale)
        else:
            placed[:, joint] = placed[:, PARENTS[joint]]
    return placed


def place_offsets(binding: Binding, placed: Float64Array, world: Float64Array, height: float) -> bool:
    """Move joints of the rule `offset` in place: `placed` [F, 21, 3], turned by `world` [F, 21, 4], `height` metres.

    Returns whether there are any.
    """
    moved = False
    for joint, rule in binding.rules.items():
        if rule.offset is not None:
            parent = PARENTS[joint]
            offset = np.array(rule.offset) * height
            placed[:, joint] = placed[:, parent] + rotate(np.ascontiguousarray(world[:, parent]), offset)
            moved = True
    return moved


def to_canonical_rest(binding: Binding, motion: SolvedMotion, scale: float) -> Float64Array | None:
    """Global orientations [21, 4] of source joints in the canonical rest pose; None where the zero pose does not stand.

    With them the canonical global rotation of a frame is `source rotation * result^-1`. The result is S A R: R
    the orientation in the source's rest pose, A the turn of the whole rest body to face +z with y up, S the
    smallest swing of the joint's bone to its canonical direction, and the rig's twist about that; identity for
    filled joints.

    Args:
        binding: of a rig whose rest pose is not `Rest.POSITIONS`.
        motion: of the file, with rotations.
        scale: metres per file unit.
    """
    result = np.tile(IDENTITY, (len(JOINTS), 1))
    if binding.rig.rest is Rest.CANONICAL:
        return result
    standing = standing_rest(binding, motion, scale)
    if standing is None:
        return None
    orientations, placed = standing
    swings = _swings(placed, binding)
    for name, degrees in binding.rig.twists.items():
        twist = from_axis_angle(np.array(TWIST_AXES[name]), degrees)
        swings[INDEX[name]] = multiply(twist, swings[INDEX[name]])
    for joint, source in binding.source.items():
        result[joint] = multiply(swings[joint], orientations[source])
    return result


def standing_rest(binding: Binding, motion: SolvedMotion, scale: float) -> tuple[Float64Array, Float64Array] | None:
    """The rest pose of a file, y up and facing +z; None where it does not stand. Arguments as of `to_canonical_rest`.

    Returns:
        [J, 4] the global orientations A R of the file's joints, and [21, 3] where canonical joints are, metres.
    """
    orientations = rest_orientations(binding)
    parents = binding.hierarchy.parents
    rest = chained(rotate(orientations[list(parents)], mean_offsets(parents, motion)), parents) * scale
    placed = place(binding, rest[None], orientations[None], scale)[0]
    if binding.rig.rest is Rest.ZERO:
        upright = _to_upright(placed)
        if upright is None:
            return None
        orientations, placed = multiply(upright, orientations), rotate(upright, placed)
    return (orientations, placed) if _stands(placed) else None


def mean_offsets(parents: tuple[int, ...], motion: SolvedMotion) -> Float64Array:
    """[J, 3] offsets from the parent as the motion shows them: position channels replace rest offsets."""
    assert motion.world is not None
    frames = np.unique(np.linspace(0, len(motion.positions) - 1, SAMPLED_FRAMES).round().astype(int))
    above = list(parents)
    positions, world = motion.positions[frames], motion.world[frames]
    offsets: Float64Array = rotate(conjugate(world[:, above]), positions - positions[:, above]).mean(axis=0)
    offsets[0] = 0.0
    return offsets


def rest_orientations(binding: Binding) -> Float64Array:
    """[J, 4] global orientations in the source's rest pose."""
    given = {binding.names.get(name.casefold()): q for name, q in binding.rig.rest_orientations.items()}
    orientations = np.tile(IDENTITY, (len(binding.hierarchy.joints), 1))
    for joint, parent in enumerate(binding.hierarchy.parents):
        if joint in given:
            orientations[joint] = given[joint]
        elif parent >= 0:
            orientations[joint] = orientations[parent]
    return orientations


def _to_upright(placed: Float64Array) -> Float64Array | None:
    """Turn [4] that brings the rest body's up to +y and its left to +x; None where it has neither."""

    def joints(part: str) -> Float64Array:
        return placed[[INDEX[f"left_{part}"], INDEX[f"right_{part}"]]]

    up = joints("shoulder").mean(axis=0) - joints("ankle").mean(axis=0)
    across = joints("hip") + joints("shoulder")
    left = across[0] - across[1]
    if np.linalg.norm(np.cross(left, up)) < MIN_LENGTH:
        return None
    up = _snapped(up)
    left = _snapped(left - (left @ up) * up)
    return _from_axes(np.stack([left, up, np.cross(left, up)]).tobytes())


@lru_cache(maxsize=64)  # most files are modelled along their axes
def _from_axes(axes: bytes) -> Float64Array:
    """Rotation [4], not to be changed, of the bytes of its matrix."""
    turn = from_matrix(np.frombuffer(axes).reshape(3, 3).copy())
    turn.setflags(write=False)
    return turn


def _snapped(direction: Float64Array) -> Float64Array:
    """The unit vector along `direction`, or along the file's axis that is near to it."""
    direction = direction / np.linalg.norm(direction)
    axis = np.zeros(3)
    nearest = int(np.argmax(np.abs(direction)))
    axis[nearest] = np.sign(direction[nearest])
    return axis if axis @ direction > np.cos(np.deg2rad(SNAP_DEGREES)) else direction


def _stands(placed: Float64Array) -> bool:
    """Whether torso and legs point up and down, and left is +x."""
    bones = [("hips", "neck", 1.0), ("left_hip", "left_ankle", -1.0), ("right_hip", "right_ankle", -1.0)]
    for start, end, sense in bones:
        bone = placed[INDEX[end]] - placed[INDEX[start]]
        if not sense * bone[1] > STANDING * np.linalg.norm(bone):
            return False
    return bool(placed[INDEX["left_hip"], 0] > placed[INDEX["right_hip"], 0])


def _swings(placed: Float64Array, binding: Binding) -> Float64Array:
    """[21, 4] swing of every joint's bone to its canonical direction; hands turn with their forearms."""
    swings = np.tile(IDENTITY, (len(JOINTS), 1))
    bones = [(INDEX[name], INDEX[child], to) for name, (child, to) in BONES.items() if INDEX[name] in binding.source]
    joints, children = [joint for joint, _, _ in bones], [child for _, child, _ in bones]
    directions = np.array([direction for _, _, direction in bones]).reshape(-1, 3)
    swings[joints] = swing(placed[children] - placed[joints], directions)
    for side in ("left", "right"):
        swings[INDEX[f"{side}_wrist"]] = swings[INDEX[f"{side}_elbow"]]
    return swings
