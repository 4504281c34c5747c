"""Limbs of constant length beside recorded joints whose bones change their length."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import Float64Array
from motionlake.matching.recordings import FPS, rooted
from motionlake.motion.kinematics import forward_kinematics
from motionlake.motion.limbs import BONES, LIMBS, even_limbs, nearest, nearest_limbs
from motionlake.motion.skeleton import INDEX, body_length
from scipy.optimize import minimize

from bench.made.splits import clips_of
from bench.matching_clips import offsets_of


def _limbs(rng: np.random.Generator, frames: int) -> list[Float64Array]:
    """Root, middle and end of limbs, and joints near by that are not as far apart."""
    root = rng.normal(size=(frames, 3))
    bones = rng.normal(size=(2, frames, 3))
    middle = root + bones[0]
    end = middle + bones[1]
    return [root, middle, end, middle + 0.3 * rng.normal(size=(frames, 3)), end + 0.3 * rng.normal(size=(frames, 3))]


def _apart(middle: Float64Array, end: Float64Array, wanted: tuple[Float64Array, Float64Array]) -> Float64Array:
    return np.asarray(np.square(middle - wanted[0]).sum(axis=-1) + np.square(end - wanted[1]).sum(axis=-1))


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 9999))
def test_bones_keep_their_length_and_come_nearer(seed: int) -> None:
    root, middle, end, *wanted = _limbs(np.random.default_rng(seed), 20)
    found_middle, found_end = nearest(root, middle, end, wanted[0], wanted[1])
    for (a, b), (c, d) in (((root, middle), (root, found_middle)), ((middle, end), (found_middle, found_end))):
        np.testing.assert_allclose(np.linalg.norm(b - a, axis=1), np.linalg.norm(d - c, axis=1), rtol=1e-9)
    both = wanted[0], wanted[1]
    assert (_apart(found_middle, found_end, both) <= _apart(middle, end, both) + 1e-9).all()


def test_no_other_limb_is_nearer() -> None:
    """A general solver that begins anywhere finds none."""
    root, middle, end, *wanted = _limbs(np.random.default_rng(5), 12)
    found = _apart(*nearest(root, middle, end, wanted[0], wanted[1]), (wanted[0], wanted[1]))
    rng = np.random.default_rng(6)
    for i in range(len(root)):
        upper, lower = np.linalg.norm(middle[i] - root[i]), np.linalg.norm(end[i] - middle[i])

        def cost(flat: Float64Array, i: int = i, upper: float = float(upper), lower: float = float(lower)) -> float:
            knee = root[i] + upper * flat[:3] / np.linalg.norm(flat[:3])
            return float(_apart(knee, knee + lower * flat[3:] / np.linalg.norm(flat[3:]), (wanted[0][i], wanted[1][i])))

        best = min(minimize(cost, rng.normal(size=6)).fun for _ in range(8))
        assert found[i] < best + 1e-3 * (1 + best)


def test_limbs_of_a_body_whose_bones_keep_their_length_stay(recordings: Path) -> None:
    clip = clips_of("walk")[0]
    turned = clip.rotations.astype(float)
    assert nearest_limbs(clip.positions.astype(float), turned, offsets_of(clip)) is turned


def test_arms_and_legs_of_a_sensor_are_as_long_on_both_sides(recordings: Path) -> None:
    clip = clips_of("lunge")[0]
    body = offsets_of(clip)
    even = even_limbs(clip.positions.astype(float), body)
    before, after = (np.linalg.norm(each, axis=1) for each in (body, even))
    left, right = np.array(BONES).T
    assert np.abs(before[left] - before[right]).max() > 0.01
    np.testing.assert_allclose(after[left], after[right], rtol=1e-9)
    np.testing.assert_allclose(after[left] + after[right], before[left] + before[right], rtol=1e-9)
    others = np.delete(np.arange(len(body)), [*left, *right])
    np.testing.assert_array_equal(even[others], body[others])
    np.testing.assert_allclose(np.cross(even, body), 0, atol=1e-12)  # they point as before


def test_a_body_whose_bones_keep_their_length_stays_as_it_is(recordings: Path) -> None:
    clip = clips_of("walk")[0]
    body = offsets_of(clip)
    assert even_limbs(clip.positions.astype(float), body) is body


@pytest.mark.parametrize("label", ["squat", "jog", "arm_curl"])
def test_joints_of_a_depth_sensor_are_met_more_nearly(recordings: Path, label: str) -> None:
    joints = [joint for limb in LIMBS for joint in limb[1:]]
    for clip in clips_of(label)[:8]:
        positions, turned, body = clip.positions.astype(float), clip.rotations.astype(float), offsets_of(clip)
        off = [
            np.linalg.norm(forward_kinematics(positions[:, 0], own, body) - positions, axis=-1)[:, joints].mean()
            for own in (turned, nearest_limbs(positions, turned, body))
        ]
        assert off[1] < off[0]


def test_one_who_squats_bends_the_knees(recordings: Path) -> None:
    """Where the hips are lowest the ankles of the frames that motion is made of lie about where they were recorded."""
    ankles = [INDEX["left_ankle"], INDEX["right_ankle"]]
    sunk = []
    for clip in clips_of("squat"):
        positions, turned, body = clip.positions.astype(float), clip.rotations.astype(float), offsets_of(clip)
        low = positions[:, 0, 1].argmin()
        each = [
            forward_kinematics(positions[:, 0], own, body) for own in (turned, nearest_limbs(positions, turned, body))
        ]
        sunk.append([float((positions[low, ankles, 1] - joints[low, ankles, 1]).mean()) for joints in each])
    plain, found = np.mean(sunk, axis=0) / np.mean([body_length(offsets_of(clip)) for clip in clips_of("squat")])
    assert plain > 0.05
    assert abs(found) < plain / 2


def test_motion_is_made_of_the_nearest_limbs(recordings: Path) -> None:
    clip = clips_of("squat")[0]
    body, turned = offsets_of(clip), clip.rotations.astype(float)
    motion = rooted(clip.positions.astype(float), turned, body, clip.fps)
    other = rooted(
        clip.positions.astype(float), nearest_limbs(clip.positions.astype(float), turned, body), body, clip.fps
    )
    np.testing.assert_allclose(motion.rotations, other.rotations, atol=1e-3)
    knees = [INDEX["left_knee"], INDEX["right_knee"]]
    assert clip.fps == FPS
    assert np.abs(motion.rotations[:, knees] - turned[:, knees]).max() > 0.05
