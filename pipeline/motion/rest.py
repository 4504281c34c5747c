"""Rest poses: of a rig, and of a body known by its joint positions alone."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.clip import Hierarchy, SolvedMotion
from motionlake.motion.fill import Binding, place
from motionlake.motion.rigs import Rest, RigMap
from motionlake.motion.rotations import conjugate, from_axis_angle, from_matrix, multiply, normalise, rotate, swing
from motionlake.motion.skeleton import BONES, INDEX, JOINTS, PARENTS, TWIST_AXES

IDENTITY: Final = (1.0, 0.0, 0.0, 0.0)
SAMPLED_FRAMES: Final = 64
# Rest poses are modelled along the axes of the file; what is this near to them (degrees) is meant to be.
SNAP_DEGREES: Final = 15.0
# Cosine to the vertical that legs and torso of a standing rest pose reach at least.
STANDING: Final = 0.5
MIN_LENGTH: Final = 1e-9


def to_canonical_rest(
    rig: RigMap, binding: Binding, hierarchy: Hierarchy, motion: SolvedMotion, scale: float
) -> Float64Array | None:
    """Global orientation of each measured joint's source joint in the canonical rest pose.

    With it the canonical global rotation of a frame is `source rotation * result^-1`. The result is S A R: R
    the orientation in the source's rest pose, A the turn of the whole rest body to face +z with y up, S the
    smallest swing of the joint's bone to its canonical direction, and the rig's twist about that.

    Args:
        rig: its rest pose is not `Rest.POSITIONS`.
        binding: of the rig to the file.
        hierarchy: of the file.
        motion: of the file, with rotations.
        scale: metres per file unit.

    Returns:
        [21, 4], identity for filled joints; None where the zero pose is no standing human.
    """
    assert motion.world is not None
    if rig.rest is Rest.CANONICAL:
        return np.tile(IDENTITY, (len(JOINTS), 1))
    offsets = _mean_offsets(hierarchy, motion)
    orientations = _orientations(rig, binding, hierarchy)
    rest = _posed(hierarchy, orientations, offsets) * scale
    placed = place(binding, hierarchy, rest[None], orientations[None], scale)[0]
    if rig.rest is Rest.ZERO:
        aligned = _alignment(placed)
        if aligned is None:
            return None
        orientations, placed = multiply(aligned, orientations), rotate(aligned, placed)
    if not _stands(placed):
        return None
    swings = _swings(placed, binding)
    for name, degrees in rig.twists.items():
        twist = from_axis_angle(np.array(TWIST_AXES[name]), degrees)
        swings[INDEX[name]] = multiply(twist, swings[INDEX[name]])
    result = np.tile(np.array(IDENTITY), (len(JOINTS), 1))
    for joint, source in binding.source.items():
        result[joint] = multiply(swings[joint], orientations[source])
    return result


def _mean_offsets(hierarchy: Hierarchy, motion: SolvedMotion) -> Float64Array:
    """[J, 3] offsets from the parent as the motion shows them: position channels replace rest offsets."""
    assert motion.world is not None
    frames = np.unique(np.linspace(0, len(motion.positions) - 1, SAMPLED_FRAMES).round().astype(int))
    parents = list(hierarchy.parents)
    positions, world = motion.positions[frames], motion.world[frames]
    offsets: Float64Array = rotate(conjugate(world[:, parents]), positions - positions[:, parents]).mean(axis=0)
    offsets[0] = 0.0
    return offsets


def _orientations(rig: RigMap, binding: Binding, hierarchy: Hierarchy) -> Float64Array:
    """[J, 4] global orientations in the source's rest pose."""
    given = {binding.names.get(name.casefold()): q for name, q in rig.rest_orientations.items()}
    orientations = np.tile(np.array(IDENTITY), (len(hierarchy.joints), 1))
    for joint, parent in enumerate(hierarchy.parents):
        if joint in given:
            orientations[joint] = given[joint]
        elif parent >= 0:
            orientations[joint] = orientations[parent]
    return orientations


def _posed(hierarchy: Hierarchy, orientations: Float64Array, offsets: Float64Array) -> Float64Array:
    positions = np.zeros_like(offsets)
    for joint, parent in enumerate(hierarchy.parents):
        if parent >= 0:
            positions[joint] = positions[parent] + rotate(orientations[parent], offsets[joint])
    return positions


def _alignment(placed: Float64Array) -> Float64Array | None:
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
    return from_matrix(np.stack([left, up, np.cross(left, up)]))


def _snapped(direction: Float64Array) -> Float64Array:
    """The unit vector along `direction`, or along the file's axis that is near to it."""
    direction = direction / np.linalg.norm(direction)
    axis = np.zeros(3)
    nearest = int(np.argmax(np.abs(direction)))
    axis[nearest] = np.sign(direction[nearest])
    return axis if axis @ direction > np.cos(np.deg2rad(SNAP_DEGREES)) else direction


def _stands(placed: Float64Array) -> bool:
    bones = [("hips", "neck", 1.0), ("left_hip", "left_ankle", -1.0), ("right_hip", "right_ankle", -1.0)]
    for start, end, sense in bones:
        bone = placed[INDEX[end]] - placed[INDEX[start]]
        if not sense * bone[1] > STANDING * np.linalg.norm(bone):
            return False
    return bool(placed[INDEX["left_hip"], 0] > placed[INDEX["right_hip"], 0])


def _swings(placed: Float64Array, binding: Binding) -> Float64Array:
    """[21, 4] swing of every joint's bone to its canonical direction; hands turn with their forearms."""
    swings = np.tile(np.array(IDENTITY), (len(JOINTS), 1))
    for name, (child, direction) in BONES.items():
        bone = placed[INDEX[child]] - placed[INDEX[name]]
        if INDEX[name] in binding.source and np.linalg.norm(bone) > MIN_LENGTH:
            swings[INDEX[name]] = swing(bone, np.array(direction))
    for side in ("left", "right"):
        swings[INDEX[f"{side}_wrist"]] = swings[INDEX[f"{side}_elbow"]]
    return swings


def world_from_positions(positions: Float64Array) -> Float64Array:
    """Global canonical rotations without twist.

    Hips and chest turn with the line across hips or shoulders and the line up to the neck. Any other joint
    turns from its parent by the smallest rotation that points its bone along the measured one. A bone
    of length zero, or a body line that gives no frame, turns with the parent (hips: as canonical).

    Args:
        positions: [F, 21, 3] canonical joints, y up.

    Returns:
        [F, 21, 4].
    """
    world = np.zeros((len(positions), len(JOINTS), 4))
    for joint, name in enumerate(JOINTS):
        identity = np.tile(np.array([1.0, 0.0, 0.0, 0.0]), (len(positions), 1))
        parent = np.ascontiguousarray(world[:, PARENTS[joint]]) if joint else identity
        if name == "hips":
            world[:, joint] = _body_frame(positions, "hip", "hips", parent)
        elif name == "chest":
            world[:, joint] = _body_frame(positions, "shoulder", "hips", parent)
        elif name in BONES:
            child, direction = BONES[name]
            bone = rotate(conjugate(parent), positions[:, INDEX[child]] - positions[:, joint])
            world[:, joint] = multiply(parent, _swing(np.array(direction), bone))
        else:
            world[:, joint] = parent
    return world


def _body_frame(positions: Float64Array, across: str, below: str, otherwise: Float64Array) -> Float64Array:
    """[F, 4] frame with x along right to left and y near to the line from joint `below` to the neck."""
    left = positions[:, INDEX[f"left_{across}"]] - positions[:, INDEX[f"right_{across}"]]
    up = positions[:, INDEX["neck"]] - positions[:, INDEX[below]]
    forward = np.cross(left, up)
    valid = np.linalg.norm(forward, axis=-1) > MIN_LENGTH
    frame = np.array(otherwise)
    if valid.any():
        left, forward = left[valid], forward[valid]
        axes = (left, np.cross(forward, left), forward)
        frame[valid] = from_matrix(np.stack([normalise(axis) for axis in axes], axis=-1))
    return frame


def _swing(direction: Float64Array, bones: Float64Array) -> Float64Array:
    rotations = np.tile(np.array([1.0, 0.0, 0.0, 0.0]), (len(bones), 1))
    valid = np.linalg.norm(bones, axis=-1) > MIN_LENGTH
    if valid.any():
        rotations[valid] = swing(np.broadcast_to(direction, bones[valid].shape), bones[valid])
    return rotations
