"""Rotations of SMPL's body joints from where the joints are, and from turns of bones where those are known."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.humanml3d import bone_vectors, joints_of_bones
from motionlake.motion.rotations import (
    IDENTITY,
    angle,
    conjugate,
    from_matrix,
    multiply,
    of_length_one,
    rotate,
    slerp,
    swing,
)
from motionlake.motion.smpl import BODY_JOINTS, INDEX, OFFSETS, PARENTS

CHILDREN: Final = tuple(
    tuple(child for child in range(BODY_JOINTS) if PARENTS[child] == joint) for joint in range(BODY_JOINTS)
)
PELVIS, CHEST = INDEX["pelvis"], INDEX["spine3"]  # each bears three bones, which tell how it turns
SPINE: Final = (PELVIS, INDEX["spine1"], INDEX["spine2"], CHEST)
# Elbows and knees bend about one axis: the joint above each, and that axis in the T-pose.
HINGES: Final = {
    INDEX["left_shoulder"]: (0.0, -1.0, 0.0), INDEX["right_shoulder"]: (0.0, 1.0, 0.0),
    INDEX["left_hip"]: (1.0, 0.0, 0.0), INDEX["right_hip"]: (1.0, 0.0, 0.0),
}  # fmt: skip
BENT: Final = (0.1, 0.3)  # sines of a bend: below the first it says nothing of the axis, above the second all
# Where a limb is straight, it turns about itself as in the frames around it, so many each way, or as its parent does.
AROUND: Final = 10.0
AROUND_WEIGHT, PARENT_WEIGHT = 0.05, 0.01
# Bones of pelvis and chest that agree with where their joints are, to so many degrees on average, tell of a body.
AGREE: Final = 3.0


def joints_turn(positions: Float64Array, bones: Float64Array | None = None) -> Float64Array:
    """Global rotations [F, 22, 4] of SMPL's joints from the T-pose, by which every bone points where joints are.

    Pelvis and chest turn as the three bones that each bears. Any other joint turns from where its bone tells
    (`bones`), or else from its parent, by the smallest turn that lets its bone point along the measured one; the spine
    shares the turn from pelvis to chest. Upper arms and thighs turn about themselves so that elbows and knees bend
    about the axes that they have. Hands, feet and head, which bear no bone, turn with their parents.

    Args:
        positions: [F, 22, 3] joints, y up.
        bones: [F', 22, 4] global turns of bones (`humanml3d.bones_of_joints`) of the first F' frames; frames after
            them keep the last ones relative to the parent.
    """
    vectors = bone_vectors(positions)
    world = np.tile(IDENTITY, (len(positions), BODY_JOINTS, 1))
    for joint in (PELVIS, CHEST):
        world[:, joint] = _as_a_whole(vectors, joint)
    for share, joint in zip((1 / 3, 2 / 3), SPINE[1:3], strict=True):
        world[:, joint] = slerp(world[:, PELVIS], world[:, CHEST], np.full(len(positions), share))
    told = None if bones is None else joints_of_bones(bones)
    for joint, children in enumerate(CHILDREN):
        if joint in (PELVIS, CHEST):
            continue
        own = world[:, joint if joint in SPINE else PARENTS[joint]].copy()
        if told is not None and children:
            own[: len(told)] = told[:, children[0]]
            own[len(told) :] = _going_on(world[:, PARENTS[joint]], told[-1, children[0]], len(told))
        if children:
            bone = rotate(own, OFFSETS[children[0]])
            own = multiply(swing(bone, vectors[:, children[0]]), own)
        if told is None and joint in HINGES:
            [hinge] = children
            [end] = CHILDREN[hinge]
            own = _bending_right(own, vectors[:, hinge], vectors[:, end], np.array(HINGES[joint]))
        world[:, joint] = own
    return world


def tell_of_a_body(positions: Float64Array, bones: Float64Array) -> bool:
    """Whether turns of bones [F, 22, 4] are those of a body's joints, with the turns about bones.

    The three bones of a pelvis or a chest turn as one. Smallest turns from a rest body do not, where it turns.
    """
    told, vectors = joints_of_bones(bones), bone_vectors(positions)
    whole = {joint: _as_a_whole(vectors, joint) for joint in (PELVIS, CHEST)}
    off = [angle(told[:, child], own) for joint, own in whole.items() for child in CHILDREN[joint]]
    return float(np.mean(off)) < AGREE


def bones_at_rest(positions: Float64Array, world: Float64Array) -> Float64Array:
    """[22, 3] offsets of joints from their parents in the T-pose of the body, on average over the frames."""
    parents = [max(parent, 0) for parent in PARENTS[:BODY_JOINTS]]
    return np.asarray(rotate(conjugate(world[:, parents]), bone_vectors(positions)).mean(axis=0))


def _as_a_whole(vectors: Float64Array, joint: int) -> Float64Array:
    """[F, 4] the rotation of a joint that brings its bones at rest nearest to those measured, of vectors [F, 22, 3].

    Least squares (Kabsch, Acta Crystallographica A32, 1976): each bone counts for as much as it is long.
    """
    children = list(CHILDREN[joint])
    covariance = np.einsum("fni,nj->fij", vectors[:, children], OFFSETS[children])
    left, _, right = np.linalg.svd(covariance)
    left[..., 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    return from_matrix(left @ right)


def _bending_right(own: Float64Array, upper: Float64Array, lower: Float64Array, axis: Float64Array) -> Float64Array:
    """Rotations [F, 4] turned about the upper bone [F, 3] so that the lower one [F, 3] bends about an axis [3] at rest.

    As a canonical limb does, which is straight at rest, so that the axis is upright on both bones.
    """
    from scipy.ndimage import gaussian_filter1d

    upper, lower = of_length_one(upper), of_length_one(lower)
    bend, across = np.cross(upper, lower), rotate(own, axis)
    across -= np.sum(across * upper, axis=1, keepdims=True) * upper
    about = np.arctan2(np.sum(np.cross(across, bend) * upper, axis=1), np.sum(across * bend, axis=1))
    weight = np.clip((np.linalg.norm(bend, axis=1) - BENT[0]) / (BENT[1] - BENT[0]), 0.0, 1.0)
    pointing = weight[:, None] * np.stack([np.cos(about), np.sin(about)], axis=1)
    pointing = pointing + AROUND_WEIGHT * gaussian_filter1d(pointing, AROUND, axis=0, mode="nearest")
    pointing[:, 0] += PARENT_WEIGHT
    half = np.arctan2(pointing[:, 1], pointing[:, 0])[:, None] / 2
    return multiply(np.concatenate([np.cos(half), np.sin(half) * upper], axis=1), own)


def _going_on(parent: Float64Array, last: Float64Array, frames: int) -> Float64Array:
    """Rotations after so many frames that stay as they were relative to the parent [F, 4]."""
    relative = multiply(conjugate(parent[frames - 1]), last)
    return multiply(np.ascontiguousarray(parent[frames:]), relative)
