"""Feet stay where they stand and clear the ground where they swing; legs bend for it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from motionlake.arrays import Float64Array
from motionlake.glogen.feet import BLEND, CLEAR, FAST, planted
from motionlake.glogen.trajectories import FPS, STANDARD, body_motion, measured_length, resampled
from motionlake.motion.skeleton import INDEX, PARENTS
from motionlake.motion.two_bones import bent

from tests.lakes import canonical_clips

LEGS = [INDEX[f"{side}_{part}"] for side in ("left", "right") for part in ("knee", "ankle", "toe")]
POINTS = arrays.arrays(np.float64, (4, 3), elements=st.floats(-1, 1).map(lambda x: round(x, 3)))


def standing(frames: int) -> np.ndarray:
    """[F, 21, 3] the standard body upright, its knees a little bent, toes on the ground."""
    joints = np.zeros((21, 3))
    for joint, parent in enumerate(PARENTS[1:], 1):
        joints[joint] = joints[parent] + STANDARD[joint]
    for side in ("left", "right"):
        hip, knee, ankle, toe = (INDEX[f"{side}_{part}"] for part in ("hip", "knee", "ankle", "toe"))
        joints[knee] = joints[hip] + 0.33 * np.array([0, -np.cos(0.3), np.sin(0.3)])
        joints[ankle] = joints[knee] + 0.31 * np.array([0, -np.cos(0.3), -np.sin(0.3)])
        joints[toe] = joints[ankle] + [0, 0, 0.1]
    joints[:, 1] -= joints[INDEX["left_ankle"], 1]
    return np.tile(joints, (frames, 1, 1))


def bones(joints: np.ndarray) -> np.ndarray:
    lengths: Float64Array = np.linalg.norm(joints[:, 1:] - joints[:, list(PARENTS[1:])], axis=2)
    return lengths


@settings(max_examples=200, deadline=None)
@given(POINTS, st.floats(0.2, 0.5), st.floats(0.2, 0.5))
@example(np.array([[0, 0, 0], [0, 0, 1], [0, 1, 0], [0, 0, 1]], dtype=float), 0.5, 0.5)
def test_a_leg_bends_to_where_its_foot_is_wanted(points: np.ndarray, thigh: float, shin: float) -> None:
    hip, towards, further, wanted = points[:, None]
    for apart in (towards, further):
        if np.linalg.norm(apart) < 0.1:
            return
    knee = hip + thigh * towards / np.linalg.norm(towards)
    ankle = knee + shin * further / np.linalg.norm(further)
    if np.linalg.norm(wanted - hip) < 0.05:
        return
    new_knee, new_ankle = bent(hip, knee, ankle, wanted, np.array([[0.0, 0.0, 1.0]]))
    assert np.linalg.norm(new_knee - hip) == pytest.approx(thigh, abs=1e-6)
    assert np.linalg.norm(new_ankle - new_knee) == pytest.approx(shin, abs=1e-6)
    reach = np.linalg.norm(wanted - hip)
    if abs(thigh - shin) <= reach <= 0.999 * (thigh + shin):
        np.testing.assert_allclose(new_ankle, wanted, atol=1e-6)
    np.testing.assert_allclose(np.cross(new_ankle - hip, wanted - hip), 0, atol=1e-6)  # on the way there at least


def test_a_knee_stays_on_its_side() -> None:
    hip, knee, ankle = np.zeros((1, 3)), np.array([[0, -0.3, 0.15]]), np.array([[0, -0.6, 0.0]])
    ahead = np.array([[0.0, 0.0, 1.0]])
    wanted = np.array([[0, -0.5, 0.0]])
    for side in (knee, knee * [1, 1, -1]):
        moved = bent(hip, side, ankle, wanted, ahead)[0]
        assert np.sign(moved[0, 2]) == np.sign(side[0, 2])
    straight = bent(hip, np.array([[0, -0.3, 0.0]]), ankle, wanted, ahead)[0]
    assert straight[0, 2] > 0.05  # as knees bend


def test_two_feet_that_stand_and_drift_apart_stay() -> None:
    frames = 40
    joints = standing(frames)
    drift = np.linspace(0, 0.06, frames)
    for side, sign in (("left", 1), ("right", -1)):
        parts = [INDEX[f"{side}_{part}"] for part in ("ankle", "toe")]
        knee, hip = INDEX[f"{side}_knee"], INDEX[f"{side}_hip"]
        wanted = joints[:, parts[0]] + np.stack([sign * drift, 0 * drift, 0 * drift], axis=1)
        moved_knee, ankle = bent(
            joints[:, hip], joints[:, knee], joints[:, parts[0]], wanted, np.tile([0.0, 0, 1], (frames, 1))
        )
        joints[:, parts[1]] += ankle - joints[:, parts[0]]
        joints[:, knee], joints[:, parts[0]] = moved_knee, ankle
    feet = [INDEX["left_toe"], INDEX["right_toe"]]
    held = planted(joints, np.ones((frames, 2)), 1.0, FPS)
    assert np.ptp(joints[:, feet], axis=0).max() > 0.05
    assert np.ptp(held[:, feet], axis=0).max() < 1e-6
    np.testing.assert_allclose(bones(held), bones(joints), atol=1e-9)
    rest = [joint for joint in range(21) if joint not in LEGS]
    np.testing.assert_array_equal(held[:, rest], joints[:, rest])
    # Who stands for half the time goes on as before, a while after.
    half = np.zeros((frames, 2))
    half[: frames // 2] = 1
    left = planted(joints, half, 1.0, FPS)
    assert np.ptp(left[: frames // 2, feet], axis=0).max() < 1e-6
    np.testing.assert_allclose(left[frames // 2 + BLEND :], joints[frames // 2 + BLEND :], atol=1e-9)


def test_a_foot_that_travels_clears_the_ground_and_one_that_stands_does_not_rise() -> None:
    frames = 30
    joints = standing(frames)
    joints[..., 2] += (np.arange(frames) * 1.3 * FAST / FPS)[:, None]  # glides ahead on both feet
    stands = np.zeros((frames, 2))
    stands[:, 0] = 1  # it is said of the left that it stands: too far to be held, and lifted like the other
    lifted = planted(joints, stands, 1.0, FPS)
    parts = [INDEX[f"{side}_{part}"] for side in ("left", "right") for part in ("ankle", "toe")]
    assert (lifted[:, parts, 1] >= CLEAR - 1e-6).all()
    np.testing.assert_allclose(bones(lifted), bones(joints), atol=1e-9)
    still = standing(frames)
    np.testing.assert_allclose(planted(still, np.ones((frames, 2)), 1.0, FPS), still, atol=1e-9)


def test_where_no_foot_ever_stands_nothing_changes() -> None:
    joints = standing(20) + np.linspace(0, 3, 20)[:, None, None]
    np.testing.assert_array_equal(planted(joints, np.full((20, 2), 0.4), 1.0, FPS), joints)
    np.testing.assert_array_equal(planted(joints[:1], np.ones((1, 2)), 1.0, FPS), joints[:1])


def test_recorded_feet_hardly_move(built_lake: Path) -> None:
    for name, fps, positions, _ in canonical_clips(built_lake):
        motion, size = body_motion(positions, fps), measured_length(positions)
        recorded = resampled(positions.reshape(len(positions), -1), fps, FPS).reshape(-1, 21, 3)
        found = planted(recorded, motion.stands, size, FPS)
        assert np.linalg.norm(found - recorded, axis=2)[:, LEGS].mean() < 0.02 * size, name
