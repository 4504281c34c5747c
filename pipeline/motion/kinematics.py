"""Kinematics: of a file's raw channels, and of the canonical skeleton, forward and from positions back."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, Int64Array
from motionlake.errors import ClipError
from motionlake.kernels import njit
from motionlake.motion.clip import (
    POSITION_CHANNELS,
    QUATERNION_CHANNELS,
    ROTATION_CHANNELS,
    ChannelKind,
    Hierarchy,
    SolvedMotion,
    SourceClip,
)
from motionlake.motion.rotation_kernels import multiply_into, rotate_into
from motionlake.motion.rotations import (
    IDENTITY,
    MIN_LENGTH,
    conjugate,
    from_matrix,
    multiply,
    normalise,
    rotate,
    swing,
)
from motionlake.motion.skeleton import BONES, INDEX, JOINTS, PARENTS, chained

# A channel's code: 0-2 position, 3-5 rotation, 6-9 quaternion.
_CODES: Final = {name: code for code, name in enumerate((*POSITION_CHANNELS, *ROTATION_CHANNELS, *QUATERNION_CHANNELS))}
_FIRST_ROTATION: Final = 3
_FIRST_QUATERNION: Final = 6


@njit(cache=True)
def _joint_rotation(values, begin, end, codes, fixed, out):  # type: ignore[no-untyped-def]
    """out = rotation of one joint's channels values[begin:end]; False where a quaternion has no length."""
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    quaternion = False
    for c in range(begin, end):
        code = codes[c]
        value = values[c]
        if code < _FIRST_ROTATION:
            continue
        if code >= _FIRST_QUATERNION:
            out[code - _FIRST_QUATERNION] = value
            quaternion = True
            continue
        if value == 0.0:
            continue
        half = value * (math.pi / 360.0)
        s, t = math.sin(half), math.cos(half)
        # Product with a turn about a coordinate axis; from the other side the vector part's cross term flips.
        r = -s if fixed else s
        if code == 3:
            w, x, y, z = w * t - x * s, x * t + w * s, y * t + z * r, z * t - y * r
        elif code == 4:
            w, x, y, z = w * t - y * s, x * t - z * r, y * t + w * s, z * t + x * r
        else:
            w, x, y, z = w * t - z * s, x * t + y * r, y * t - x * r, z * t + w * s
    if quaternion:
        length = math.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2] + out[3] * out[3])
        if not length > 0.0:
            return False
        for i in range(4):
            out[i] /= length
    else:
        out[0], out[1], out[2], out[3] = w, x, y, z
    return True


@njit(cache=True)
def _keep_sign(q, before):  # type: ignore[no-untyped-def]
    """Negate q in place where its opposite is nearer to `before`."""
    if q[0] * before[0] + q[1] * before[1] + q[2] * before[2] + q[3] * before[3] < 0.0:
        for i in range(4):
            q[i] = -q[i]


@njit(cache=True)
def _solve(channels, starts, codes, parents, offsets, axes, turned, fixed, positions, local, world):  # type: ignore[no-untyped-def]
    """Fill positions [F, J, 3], local and world [F, J, 4]; the (frame, joint) that fails first, or -1, -1."""
    frames, joints = positions.shape[0], positions.shape[1]
    vector = np.empty(3)
    inverse = np.empty(4)
    for f in range(frames):
        values = channels[f]
        for j in range(joints):
            begin, end = starts[j], starts[j + 1]
            q = local[f, j]
            if not _joint_rotation(values, begin, end, codes, fixed, q):
                return f, j
            if turned[j]:
                inverse[0] = axes[j, 0]
                for i in range(1, 4):
                    inverse[i] = -axes[j, i]
                multiply_into(axes[j], q, q)
                multiply_into(q, inverse, q)
            for i in range(3):
                vector[i] = offsets[j, i]
            for c in range(begin, end):
                if codes[c] < _FIRST_ROTATION:
                    vector[codes[c]] = values[c]
            parent = parents[j]
            if parent < 0:
                for i in range(4):
                    world[f, j, i] = q[i]
                for i in range(3):
                    positions[f, j, i] = vector[i]
            else:
                multiply_into(world[f, parent], q, world[f, j])
                rotate_into(world[f, parent], vector, vector)
                for i in range(3):
                    positions[f, j, i] = positions[f, parent, i] + vector[i]
            if f:
                _keep_sign(q, local[f - 1, j])
                _keep_sign(world[f, j], world[f - 1, j])
    return -1, -1


def channel_starts(hierarchy: Hierarchy) -> Int64Array:
    """Column [J + 1] at which each joint's channels start."""
    return np.cumsum([0, *map(len, hierarchy.channels)])


def solve(clip: SourceClip) -> SolvedMotion:
    """Forward kinematics of every frame, in file units and axes, of channels in degrees and file units.

    Along time the signs of a joint's quaternions are such that neighbours are near each other. Quaternions need not be
    of length 1.

    Raises:
        ClipError: a channel that its kind does not know, or a quaternion of length zero.
    """
    hierarchy = clip.hierarchy
    frames, joints = len(clip.channels), len(hierarchy.joints)
    channels = np.ascontiguousarray(clip.channels, float)
    if hierarchy.kind is ChannelKind.POSITIONS:
        if any(names != ("x", "y", "z") for names in hierarchy.channels):
            raise ClipError("a joint of a clip of positions needs the channels x, y, z")
        return SolvedMotion(channels.reshape(frames, joints, 3), None, None)
    names = [name for joint in hierarchy.channels for name in joint]
    unknown = next((name for name in names if name not in _CODES), None)
    if unknown is not None:
        raise ClipError(f"unknown channel {unknown!r}")
    if any(sum(name in QUATERNION_CHANNELS for name in joint) not in (0, 4) for joint in hierarchy.channels):
        raise ClipError("a joint has fewer or more than the four channels of a quaternion")
    positions = np.empty((frames, joints, 3))
    local, world = np.empty((frames, joints, 4)), np.empty((frames, joints, 4))
    axes = np.ascontiguousarray(hierarchy.axes, float)
    frame, joint = _solve(
        channels, channel_starts(hierarchy), np.array([_CODES[name] for name in names], np.int64),
        np.array(hierarchy.parents, np.int64), np.ascontiguousarray(hierarchy.offsets, float), axes,
        np.abs(axes[:, 0]) < 1.0, hierarchy.fixed_axes, positions, local, world,
    )  # fmt: skip
    if frame >= 0:
        raise ClipError(f"frame {frame + 1}: the quaternion of joint {hierarchy.joints[joint]!r} has length zero")
    return SolvedMotion(positions, local, world)


def world_rotations(local: Float64Array, parents: Sequence[int] = PARENTS) -> Float64Array:
    """Global rotations [..., J, 4] of local ones, of the canonical skeleton or another whose parents come first."""
    world = np.array(local, float)
    for joint, parent in enumerate(parents):
        if parent >= 0:
            world[..., joint, :] = multiply(
                np.ascontiguousarray(world[..., parent, :]), np.ascontiguousarray(local[..., joint, :])
            )
    return world


def local_rotations(world: Float64Array, parents: Sequence[int] = PARENTS) -> Float64Array:
    """Local rotations [..., J, 4] of global ones: parent^-1 * own."""
    local: Float64Array = multiply(conjugate(world[..., list(parents), :]), world)
    local[..., 0, :] = world[..., 0, :]
    return local


def bone_vectors(positions: Float64Array, world: Float64Array) -> Float64Array:
    """Offsets [F, 21, 3] of joints from their parents, as the parents see them; zero at the hips."""
    parents = list(PARENTS)
    vectors: Float64Array = rotate(conjugate(world[:, parents]), positions - positions[:, parents])
    vectors[:, 0] = 0.0
    return vectors


def forward_kinematics(root: Float64Array, rotations: Float64Array, rest_offsets: Float64Array) -> Float64Array:
    """Joint positions [F, 21, 3] in the units of `root`.

    Args:
        root: [F, 3] position of the hips.
        rotations: [F, 21, 4] local rotations (w, x, y, z).
        rest_offsets: [21, 3] offset of every joint from its parent in the canonical rest pose.
    """
    return joints_of_bones(root, world_rotations(rotations), rest_offsets)


def joints_of_bones(root: Float64Array, world: Float64Array, rest_offsets: Float64Array) -> Float64Array:
    """The same by global rotations [F, 21, 4]."""
    bones = rotate(world[:, list(PARENTS)], rest_offsets)
    bones[:, 0] = root
    return chained(bones)


def continuous_signs(q: Float64Array) -> Float64Array:
    """[F, J, 4] with the signs that keep neighbours in time on one hemisphere; the first has w >= 0."""
    signs = np.ones((*q.shape[:-1], 1))
    signs[0] = np.where(q[0, :, :1] < 0, -1.0, 1.0)
    signs[1:] = np.where(np.sum(q[1:] * q[:-1], axis=-1, keepdims=True) < 0, -1.0, 1.0)
    return np.asarray(q * np.cumprod(signs, axis=0))


# The joints that span the line from right to left by which a joint's frame is known.
_ACROSS: Final = {"hips": "hip", "chest": "shoulder"}


def world_from_positions(positions: Float64Array) -> Float64Array:
    """Global canonical rotations [F, 21, 4] of joints [F, 21, 3], y up, without twist.

    Hips and chest turn with the line across hips or shoulders and the line up to the neck. Any other joint
    turns from its parent by the smallest rotation that points its bone along the measured one. A bone
    of length zero, or a body line that gives no frame, turns with the parent (hips: as canonical).
    """
    world = np.tile(IDENTITY, (*positions.shape[:2], 1))
    for joint, name in enumerate(JOINTS):
        if joint:
            world[:, joint] = world[:, PARENTS[joint]]
        parent = np.ascontiguousarray(world[:, joint])
        if name in _ACROSS:
            left = positions[:, INDEX[f"left_{_ACROSS[name]}"]] - positions[:, INDEX[f"right_{_ACROSS[name]}"]]
            forward = np.cross(left, positions[:, INDEX["neck"]] - positions[:, INDEX["hips"]])
            known = np.linalg.norm(forward, axis=-1) > MIN_LENGTH
            if known.any():
                axes = (left[known], np.cross(forward, left)[known], forward[known])
                world[known, joint] = from_matrix(np.stack([normalise(axis) for axis in axes], axis=-1))
        elif name in BONES:
            child, direction = BONES[name]
            bone = rotate(conjugate(parent), positions[:, INDEX[child]] - positions[:, joint])
            world[:, joint] = multiply(parent, swing(np.array(direction), bone))
    return world


def with_end_sites(hierarchy: Hierarchy, motion: SolvedMotion) -> tuple[Float64Array, tuple[int, ...]]:
    """Positions [F, J + E, 3] and parents of the J joints and, after them, of the E end sites of a file.

    A motion without rotations has none.
    """
    if motion.world is None or not hierarchy.end_sites:
        return motion.positions, hierarchy.parents
    joints = [joint for joint, _ in hierarchy.end_sites]
    offsets = np.array([offset for _, offset in hierarchy.end_sites], dtype=np.float64)
    ends = motion.positions[:, joints] + rotate(np.ascontiguousarray(motion.world[:, joints]), offsets)
    return np.concatenate([motion.positions, ends], axis=1), (*hierarchy.parents, *joints)
