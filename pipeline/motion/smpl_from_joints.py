"""Rotations of SMPL's body joints from where the joints are, and from turns of bones where those are known."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.humanml3d import bone_vectors, joints_of_bones
from motionlake.motion.rotations import IDENTITY, angle, conjugate, from_matrix, multiply, rotate, slerp, swing
from motionlake.motion.smpl import BODY_JOINTS, INDEX, OFFSETS, PARENTS

CHILDREN: Final = tuple(
    tuple(child for child in range(BODY_JOINTS) if PARENTS[child] == joint) for joint in range(BODY_JOINTS)
)
PELVIS, CHEST = INDEX["pelvis"], INDEX["spine3"]  # each bears three bones, which tell how it turns
SPINE: Final = (PELVIS, INDEX["spine1"], INDEX["spine2"], CHEST)
# Bones of pelvis and chest that agree with where their joints are, to so many degrees on average, tell of a body.
AGREE: Final = 3.0


def joints_turn(positions: Float64Array, bones: Float64Array | None = None) -> Float64Array:
    """Global rotations [F, 22, 4] of SMPL's joints from the T-pose, by which every bone points where joints are.

    Pelvis and chest turn as the three bones that each bears. Any other joint turns from where its bone tells
    (`bones`), or else from its parent, by the smallest turn that lets its bone point along the measured one; the spine
    shares the turn from pelvis to chest. Hands, feet and head, which bear no bone, turn with their parents.

    Args:
        positions: [F, 22, 3] joints, y up.
        bones: [F', 22, 4] global turns of bones (`humanml3d.bones_of_joints`) of the first F' frames; frames after
            them keep the last ones relative to the parent.
    """
    vectors = bone_vectors(positions)
    world = np.tile(IDENTITY, (len(positions), BODY_JOINTS, 1))
    for joint in (PELVIS, CHEST):
        world[:, joint] = _as_a_whole(vectors[:, CHILDREN[joint]], OFFSETS[list(CHILDREN[joint])])
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
        world[:, joint] = own
    return world


def tell_of_a_body(positions: Float64Array, bones: Float64Array) -> bool:
    """Whether turns of bones [F, 22, 4] are those of a body's joints, with the turns about bones.

    The three bones of a pelvis or a chest turn as one. Smallest turns from a rest body do not, where it turns.
    """
    told, wanted = joints_of_bones(bones), joints_turn(positions)
    off = [angle(told[:, child], wanted[:, joint]) for joint in (PELVIS, CHEST) for child in CHILDREN[joint]]
    return float(np.mean(off)) < AGREE


def bones_at_rest(positions: Float64Array, world: Float64Array) -> Float64Array:
    """[22, 3] offsets of joints from their parents in the T-pose of the body, on average over the frames."""
    parents = [max(parent, 0) for parent in PARENTS[:BODY_JOINTS]]
    return np.asarray(rotate(conjugate(world[:, parents]), bone_vectors(positions)).mean(axis=0))


def _as_a_whole(bones: Float64Array, rest: Float64Array) -> Float64Array:
    """[F, 4] the rotation that brings bones at rest [n, 3] nearest to those measured [F, n, 3].

    Least squares over the directions (Kabsch, Acta Crystallographica A32, 1976), each bone for as much as it is long.
    """
    left, _, right = np.linalg.svd(np.einsum("fni,nj->fij", bones, rest))
    left[..., 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    return from_matrix(left @ right)


def _going_on(parent: Float64Array, last: Float64Array, frames: int) -> Float64Array:
    """Rotations after so many frames that stay as they were relative to the parent [F, 4]."""
    relative = multiply(conjugate(parent[frames - 1]), last)
    return multiply(np.ascontiguousarray(parent[frames:]), relative)
