"""LocGen between poses that a person gives: the thesis's sparse poses, of a user's own (section 4.2, second stage).

LocGen passes by sparse poses, as near as a network does; here its motion is bent onto them (`motion.keyframes`).
"""

from __future__ import annotations

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.glogen.inbetweening import DenseDecoder, Inbetweener, dense_motions
from motionlake.glogen.sparse import WIDTH
from motionlake.glogen.trajectories import FPS, BodyMotion, posed, standard_joints, turned_steps
from motionlake.motion.generation import GeneratedMotion, MotionRequest
from motionlake.motion.keyframes import KeyPoses, Stretch, ground_below, through
from motionlake.motion.kinematics import continuous_signs, forward_kinematics
from motionlake.motion.resampling import interpolated
from motionlake.motion.rotations import normalise, turn_about_y
from motionlake.motion.skeleton import body_length, facing


def sparse_rows(keys: KeyPoses, rest_offsets: Float64Array, ground: float) -> Float64Array:
    """[K, 65] poses of a body as sparse poses (`SparseMotion`).

    Args:
        keys: K poses.
        rest_offsets: [21, 3] of the body, metres.
        ground: height of the ground, metres.
    """
    size = body_length(rest_offsets)
    joints = forward_kinematics(keys.hips, keys.rotations, rest_offsets) / size
    yaw = facing(joints)
    seconds = np.diff(keys.frames) / keys.fps
    rows = np.empty((len(joints), WIDTH))
    rows[:, :-5] = turn_about_y(standard_joints(joints), -yaw)[:, 1:].reshape(len(joints), -1)
    rows[:, -5] = joints[:, 0, 1] - ground / size
    rows[1:, -4:-2] = turned_steps(np.diff(joints[:, 0, [0, 2]], axis=0), -yaw[:-1])
    rows[1:, -2], rows[1:, -1] = np.diff(yaw), np.log(seconds)
    rows[0, -4:] = rows[1, -4:]
    return rows


def keyed_motion(locgen: DenseDecoder | Inbetweener, request: MotionRequest) -> GeneratedMotion:
    """The motion through the poses of a request, as LocGen leads from each to the next.

    Raises:
        ValueError: a seed clip of another skeleton.
    """
    assert request.keys is not None, "a request of poses"
    keys, body, ground = (
        request.keys,
        request.start.rest_offsets,
        ground_below(request.start.positions, request.start.clip),
    )
    times = (keys.frames - keys.frames[0]) / keys.fps
    (motion,) = dense_motions(
        locgen, [sparse_rows(keys, body, ground)], [times], max(1, int(np.ceil(times[-1] * FPS)))
    )  # fmt: skip
    stretches = [_stretch(motion, keys, i, body) for i in range(len(times) - 1)]
    hips, rotations = through(keys, stretches)
    positions = forward_kinematics(hips, rotations, body)
    return GeneratedMotion(positions, rotations, body, keys.fps, (0,), 0, 1)


def _stretch(motion: BodyMotion, keys: KeyPoses, index: int, body: Float64Array) -> Stretch:
    """Frames from a pose to the next, from the place and heading of the first on."""
    start, stop = (int(frame - keys.frames[0]) for frame in keys.frames[index : index + 2])
    # Row t of the motion is (t + 1) / FPS seconds after the first pose; before that it is its first row.
    at = np.clip(np.arange(start, stop + 1) / keys.fps * FPS - 1, 0, len(motion) - 1)
    rows = interpolated(motion.rows, at)
    size, (key,) = body_length(body), forward_kinematics(keys.hips[[index]], keys.rotations[[index]], body)
    turns = np.concatenate([[0.0], np.cumsum(rows[:-1, -1])]) / keys.fps
    yaws = float(facing(key[None])[0]) + turns
    ways = turned_steps(rows[:, -3:-1], yaws)[:-1] * size / keys.fps
    x, z = (keys.hips[index, [0, 2]] + np.concatenate([np.zeros((1, 2)), np.cumsum(ways, axis=0)])).T
    joints = rows[:, :-4].reshape(len(rows), -1, 3)
    seen = turn_about_y(np.concatenate([np.zeros((len(rows), 1, 3)), joints], axis=1), yaws)
    height = keys.hips[index, 1] + (rows[:, -4] - rows[0, -4]) * size
    hips = np.stack([x, height, z], axis=1)
    return Stretch(hips, normalise(continuous_signs(posed(seen, body, hips)[1])))
