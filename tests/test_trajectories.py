"""What generators read: motion seen from the body, and sparse poses of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.glogen.sparse import (
    DURATION,
    LONGEST,
    PIECE,
    POSES,
    STEP,
    TURN,
    cyclic_classes,
    even_motion,
    pieces,
    poses_at,
    ranges,
    reach,
    sparse_motion,
    uniform_places,
)
from motionlake.glogen.trajectories import (
    FPS,
    STANDARD,
    BodyMotion,
    body_motion,
    in_world,
    measured_length,
    mirrored,
    resampled,
    standard_joints,
)
from motionlake.motion.skeleton import FEET, INDEX, PARENTS, body_length, facing, mirrored_positions

from tests.lakes import canonical_clips, query
from tests.test_pictures import standing


def swinging(frames: int, seed: int = 0) -> np.ndarray:
    """[F, 21, 3] a body that walks along a bend and swings its arms."""
    rng = np.random.default_rng(seed)
    time = np.arange(frames) / 30
    joints = np.zeros((frames, 21, 3))
    for joint, parent in enumerate(PARENTS[1:], 1):
        joints[:, joint] = joints[:, parent] + STANDARD[joint]
    for side, sign in (("left", 1), ("right", -1)):
        swing = sign * np.sin(2 * np.pi * time * (0.8 + 0.1 * rng.random()))
        joints[:, INDEX[f"{side}_elbow"]] = joints[:, INDEX[f"{side}_shoulder"]] + 0.22 * np.stack(
            [0 * swing, -np.cos(swing), np.sin(swing)], axis=1
        )
        joints[:, INDEX[f"{side}_wrist"]] = joints[:, INDEX[f"{side}_elbow"]] + [0, -0.19, 0.02]
    yaw = 0.3 * time
    turned = np.stack(
        [
            joints[..., 0] * np.cos(yaw)[:, None] + joints[..., 2] * np.sin(yaw)[:, None], joints[..., 1] + 0.7,
            joints[..., 2] * np.cos(yaw)[:, None] - joints[..., 0] * np.sin(yaw)[:, None],
        ],
        axis=2,
    )  # fmt: skip
    path = np.stack([np.cumsum(np.sin(yaw)), 0 * yaw, np.cumsum(np.cos(yaw))], axis=1) / 30
    return 1.3 * (turned + path[:, None])


def test_the_standard_body_is_one_body_length_and_keeps_its_bones(built_lake: Path) -> None:
    assert body_length(STANDARD) == pytest.approx(1.0)
    wanted = np.linalg.norm(STANDARD[1:], axis=1)
    for name, _, positions, _ in canonical_clips(built_lake):
        joints = standard_joints(positions)
        bones = joints[:, 1:] - joints[:, list(PARENTS[1:])]
        np.testing.assert_allclose(np.linalg.norm(bones, axis=2), np.tile(wanted, (len(joints), 1)), atol=1e-9)
        np.testing.assert_array_equal(joints[:, 0], 0)
        elbow, wrist = INDEX["left_elbow"], INDEX["left_wrist"]
        forearm = positions[:, wrist] - positions[:, elbow]
        forearm = forearm / np.linalg.norm(forearm, axis=1, keepdims=True)
        np.testing.assert_allclose(joints[:, wrist] - joints[:, elbow], 0.19 * forearm, atol=1e-4, err_msg=name)


def test_a_clip_comes_back_from_what_generators_read(built_lake: Path) -> None:
    """Root within millimetres a second of the recording's, joints as close as one rigid body can be to the clip."""
    offsets = dict(query(built_lake, "SELECT clip, rest_offsets FROM clips"))
    for name, fps, positions, _ in canonical_clips(built_lake):
        rest = np.array(offsets[name], dtype=float).reshape(-1, 3)
        motion = body_motion(positions, fps)
        recorded = resampled(positions.reshape(len(positions), -1), fps, FPS).reshape(-1, 21, 3)
        root = recorded[0, 0].copy()
        root[1] -= motion.height[0] * body_length(rest)
        free = replace(motion, stands=np.zeros_like(motion.stands))
        made, rotations = in_world(free, rest, root, float(facing(recorded)[0]))
        seconds = len(motion) / FPS
        assert np.linalg.norm(made[:, 0] - recorded[:, 0], axis=1).max() < 0.03 + 0.01 * seconds, name
        apart = np.linalg.norm((made - made[:, :1]) - (recorded - recorded[:, :1]), axis=2)
        assert np.median(apart) < 0.04, name
        lengths = np.linalg.norm(made[:, 1:] - made[:, list(PARENTS[1:])], axis=2)
        np.testing.assert_allclose(lengths, np.tile(np.linalg.norm(rest[1:], axis=1), (len(made), 1)), atol=1e-6)
        assert rotations.shape == (len(made), 21, 4)


def test_a_standing_foot_stays_on_the_ground() -> None:
    positions = swinging(60)
    motion = body_motion(positions, 30.0)
    slides = in_world(replace(motion, stands=np.zeros((60, 2))), STANDARD, np.zeros(3), 0.0)[0]
    held = in_world(replace(motion, stands=np.tile([1.0, 0.0], (60, 1))), STANDARD, np.zeros(3), 0.0)[0]
    foot = INDEX["left_ankle"]
    assert np.linalg.norm(np.diff(slides[:, foot, ::2], axis=0), axis=1).mean() > 0.02
    assert np.linalg.norm(np.diff(held[5:-5, foot, ::2], axis=0), axis=1).mean() < 0.002
    floats = replace(motion, height=motion.height + 0.2)
    for stands, least, most in ((0.0, 0.15, 1.0), (1.0, -0.01, 0.02)):
        made = in_world(replace(floats, stands=np.full((60, 2), stands)), STANDARD, np.array([0.0, 0.5, 0.0]), 0.0)[0]
        lowest = made[:, FEET, 1].min(axis=1) - 0.5
        assert least < lowest.mean() < most
        assert np.ptp(lowest) < 0.05 or not stands


def test_who_stands_sinks_no_deeper_than_the_legs_bend_and_who_flies_is_left_alone() -> None:
    motion = body_motion(swinging(60), 30.0)
    dip = 0.2 * np.exp(-(((np.arange(60) - 30) / 6) ** 2))

    def lowest(change: np.ndarray, stands: float) -> np.ndarray:
        moved = replace(motion, height=motion.height + change, stands=np.full((60, 2), stands))
        made = in_world(moved, STANDARD, np.array([0.0, 0.5, 0.0]), 0.0)[0]
        return np.asarray(made[:, FEET, 1].min(axis=1) - 0.5)

    # The legs stay straight while the hips go down and up by as much.
    assert lowest(-dip, 0.7).min() < -0.1
    assert np.abs(lowest(-dip, 1.0)).max() < 0.06
    hop = lowest(dip, 0.0)
    np.testing.assert_allclose(hop - lowest(0 * dip, 0.0), dip, atol=1e-6)


@settings(max_examples=20, deadline=None)
@given(st.floats(-3, 3), st.floats(-5, 5), st.floats(-5, 5), st.floats(0.5, 2))
def test_place_facing_and_size_do_not_count(yaw: float, x: float, z: float, size: float) -> None:
    positions = swinging(40)
    cosine, sine = np.cos(yaw), np.sin(yaw)
    turn = np.array([[cosine, 0, -sine], [0, 1, 0], [sine, 0, cosine]])
    moved = size * (positions @ turn) + [x, 0, z]
    one, other = body_motion(positions, 30.0), body_motion(moved, 30.0)
    for field in ("joints", "height", "velocity", "turn", "stands"):
        np.testing.assert_allclose(getattr(one, field), getattr(other, field), atol=1e-6, err_msg=field)


def test_mirrored_motion_is_the_motion_of_the_mirrored_clip(built_lake: Path) -> None:
    for name, fps, positions, _ in canonical_clips(built_lake)[::3]:
        turned = mirrored_positions(positions).astype(float)
        one, other = mirrored(body_motion(positions, fps)), body_motion(turned, fps)
        for field in ("joints", "height", "velocity", "turn", "stands"):
            np.testing.assert_allclose(getattr(one, field), getattr(other, field), atol=1e-5, err_msg=f"{name} {field}")
        assert np.abs(one.joints - body_motion(positions, fps).joints).max() > 0.01


def test_sparse_poses_are_equally_far_apart_and_keep_the_way(built_lake: Path) -> None:
    for name, fps, positions, _ in canonical_clips(built_lake):
        motion = body_motion(positions, fps)
        places = uniform_places(motion)
        assert len(places) == POSES
        assert [places[0], places[-1]] == pytest.approx([0, len(motion) - 1])
        assert (np.diff(places) > 0).all(), name
        sparse = sparse_motion(motion)
        assert sparse.rows.shape == (20, 65)
        # Steps from pose to pose, each seen from the pose before, lead where frames lead.
        there, yaw = np.zeros(2), 0.0
        for row in sparse.rows[1:]:
            there = there + _turned(row[STEP], yaw)
            yaw += row[TURN]
        path, facing_there = np.zeros(2), 0.0
        for speed, turn in zip(motion.velocity[:-1], motion.turn[:-1], strict=True):
            path = path + _turned(speed / FPS, facing_there)
            facing_there += turn / FPS
        np.testing.assert_allclose(there, path, atol=1e-6, err_msg=name)
        assert yaw == pytest.approx(facing_there, abs=1e-6)
        assert np.exp(sparse.rows[1:, DURATION]).sum() == pytest.approx((len(motion) - 1) / FPS, rel=0.02)


def _turned(step: np.ndarray, yaw: float) -> np.ndarray:
    left, forward = step
    return np.array([left * np.cos(yaw) + forward * np.sin(yaw), forward * np.cos(yaw) - left * np.sin(yaw)])


def test_moved_distance_between_sparse_poses_is_equal() -> None:
    motion = body_motion(swinging(90), 30.0)
    places = uniform_places(motion, 200)
    joints = poses_at(motion, places).rows[:, :60].reshape(-1, 20, 3)
    moved = np.linalg.norm(np.diff(joints, axis=0), axis=2).mean(axis=1)
    assert moved.std() < 0.1 * moved.mean()
    seconds = np.diff(places)
    assert seconds.std() > 0.2 * seconds.mean()  # time is not


def test_a_body_that_holds_still_has_sparse_poses() -> None:
    still = np.repeat(swinging(1), 30, axis=0)
    sparse = sparse_motion(body_motion(still, 30.0))
    assert np.isfinite(sparse.rows).all()
    np.testing.assert_allclose(np.diff(sparse.places), 29 / 19, atol=0.1)


def test_long_clips_are_broken_into_pieces_of_a_hundred_frames() -> None:
    assert ranges(LONGEST) == [(0, LONGEST)]
    assert ranges(301) == [(0, 100), (100, 200), (200, 300), (201, 301)]
    long = body_motion(swinging(230), 30.0)
    made = pieces([long, body_motion(swinging(50), 30.0)], [1, 0], mirror=True)
    assert [len(piece.motion) for piece in made] == [PIECE] * 6 + [50] * 2
    assert [piece.target for piece in made] == [1] * 6 + [0] * 2


@pytest.mark.parametrize("broken", [np.zeros((1, 21, 3)), np.zeros((9, 21, 3)), np.full((9, 21, 3), np.nan)])
def test_what_is_no_motion_is_refused(broken: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r"frames|length"):
        body_motion(broken, 30.0)


def test_measured_length_is_that_of_the_bones() -> None:
    assert measured_length(swinging(5)) == pytest.approx(1.3)


def test_cut_is_a_range_of_frames() -> None:
    motion = body_motion(swinging(30), 30.0)
    part = motion.cut(5, 12)
    assert isinstance(part, BodyMotion)
    assert len(part) == 7
    np.testing.assert_array_equal(part.turn, motion.turn[5:12])


def test_a_walk_goes_on_and_a_gesture_comes_to_its_end() -> None:
    walks = [body_motion(swinging(90, i), 30.0) for i in range(3)]
    gestures = []
    for i in range(3):
        positions = swinging(90, i)
        positions[70:] = positions[70]
        gestures.append(body_motion(positions, 30.0))
    assert cyclic_classes([*walks, *gestures], [0, 0, 0, 1, 1, 1], 3) == [True, False, False]
    long = body_motion(swinging(LONGEST + 1), 30.0)
    assert cyclic_classes([long], [0], 1) == [True]
    made = pieces([long, gestures[0]], [0, 1], cyclic=[True, False])
    assert [len(piece.motion) for piece in made] == [LONGEST + 1, 90]
    assert [len(piece.sparse.rows) for piece in made] == [30, 20]
    again = pieces([long, gestures[0]], [0, 1], cyclic=[True, False], again=20)
    assert [len(piece.motion) for piece in again] == [PIECE, PIECE, PIECE, 90]
    assert not np.allclose(again[0].sparse.rows[5:10], again[1].sparse.rows[5:10])


def test_a_class_reaches_as_far_ahead_as_half_of_its_motions() -> None:
    def lasting(frames: int) -> BodyMotion:
        return body_motion(standing(frames), FPS)

    motions = [lasting(38), lasting(43), lasting(100), lasting(100), lasting(300), lasting(20)]
    assert [len(even_motion(motion).rows) for motion in motions] == [8, 9, 20, 20, 58, 5]
    assert reach(motions, [0, 0, 0, 1, 1, 2], [True, True, True, True], 5) == [4, 15, 1, 15]
    assert reach(motions, [0, 0, 0, 1, 1, 2], [False, True, True, True], 5) == [15, 15, 1, 15]
