"""The joints of a clip as alignment sees them, number by number, against what is written about them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import Float64Array
from motionlake.motion.moves import Track, at_12, ends, from_start, headings
from motionlake.motion.skeleton import COMMON
from scipy.spatial.transform import Rotation


def wandering(seed: int, frames: int, size: float = 1.0) -> Float64Array:
    """[N, 45] joints that wander about."""
    return np.asarray(np.cumsum(np.random.default_rng(seed).normal(size=(frames, 45)), axis=0) * size / 20)


def rise(values: Float64Array, frame: int) -> Float64Array:
    """How much values [N, D] change a frame: half of the change from the frame before to that after."""
    last = len(values) - 1
    before, after = max(0, frame - 1), min(last, frame + 1)
    return np.asarray((values[after] - values[before]) / (after - before))


@settings(max_examples=20)
@given(st.integers(0, 99), st.integers(2, 30))
def test_velocity_is_that_of_joints_smoothed_over_a_frame(seed: int, frames: int) -> None:
    joints = wandering(seed, frames)
    weights = {k: np.exp(-(k**2) / 2) for k in range(-4, 5)}
    mirrored = [*range(frames), *range(frames - 1, -1, -1)]
    smooth = np.array(
        [
            sum(weight * joints[mirrored[(i + k) % len(mirrored)]] for k, weight in weights.items())
            / sum(weights.values())
            for i in range(frames)
        ]
    )
    track = Track.of(joints.astype(np.float32))
    np.testing.assert_array_equal(track.joints, joints.astype(np.float32))
    np.testing.assert_allclose(track.velocity, [rise(smooth, i) for i in range(frames)], atol=1e-5)
    assert not Track.of(joints[:1]).velocity.any()


@settings(max_examples=20)
@given(st.integers(0, 99), st.integers(2, 30))
def test_the_pace_is_the_mean_of_three_frames(seed: int, frames: int) -> None:
    joints = wandering(seed, frames)
    speed = [float(np.linalg.norm(rise(joints, i))) for i in range(frames)]
    expected = [(speed[max(0, i - 1)] + speed[i] + speed[min(frames - 1, i + 1)]) / 3 for i in range(frames)]
    np.testing.assert_allclose(Track.of(joints).pace(), expected)
    assert Track.of(joints[:1]).pace().tolist() == [0]
    assert Track.of(np.stack([joints[0], joints[0] + 2 / np.sqrt(45)])).pace() == pytest.approx([2, 2])


def standing(angle: float, across: tuple[float, float] = (0.3, 0.5)) -> Float64Array:
    """[1, 45] a body that faces +z, turned about y; `across`: how far apart its hips and shoulders are."""
    joints = np.zeros((15, 3))
    for joint, width in zip(("hip", "shoulder"), across, strict=True):
        joints[COMMON.index(f"left_{joint}")] = [width / 2, 1.0, 0.1]
        joints[COMMON.index(f"right_{joint}")] = [-width / 2, 1.3, 0.1]
    return np.asarray(Rotation.from_euler("y", angle).apply(joints).reshape(1, 45))


@given(st.floats(-3, 3))
def test_a_body_faces_where_its_hips_and_shoulders_say(angle: float) -> None:
    """Both alike, however wide: shoulders turned out of the hips' direction by so much turn the body by half."""
    np.testing.assert_allclose(Track.of(standing(angle)).facing, [[np.cos(angle), np.sin(angle)]], atol=1e-9)
    twisted = standing(angle)
    for side in ("left", "right"):
        at = slice(3 * COMMON.index(f"{side}_shoulder"), 3 * COMMON.index(f"{side}_shoulder") + 3)
        level = twisted[0, at] * (1, 0, 1)
        twisted[0, at] = Rotation.from_euler("y", 1.0).apply(level) + np.array([0, 1, 0])
    for side, height in (("left", 1.0), ("right", 1.0)):
        twisted[0, 3 * COMMON.index(f"{side}_hip") + 1] = height
    half = angle + 0.5
    np.testing.assert_allclose(Track.of(twisted).facing, [[np.cos(half), np.sin(half)]], atol=1e-9)
    assert not Track.of(np.zeros((3, 45))).facing.any()


@settings(max_examples=30)
@given(st.integers(0, 99), st.integers(1, 30))
def test_a_turned_body_faces_ahead_in_the_mean_and_is_else_the_same(seed: int, frames: int) -> None:
    track = Track.of(wandering(seed, frames))
    angle = np.arctan2(*track.facing.sum(axis=0)[::-1])
    back = Rotation.from_euler("y", -angle)
    turned = track.turned()
    for part, other in ((track.joints, turned.joints), (track.velocity, turned.velocity)):
        expected = back.apply(part.reshape(-1, 3)).reshape(part.shape)
        np.testing.assert_allclose(other, expected, atol=1e-9)
    np.testing.assert_allclose(turned.facing, Track.of(turned.joints).facing, atol=1e-9)
    unknown = Track(track.joints, track.velocity, 0 * track.facing).turned()
    np.testing.assert_array_equal(unknown.joints, track.joints)


@given(st.floats(-10, 10), st.floats(-10, 10))
def test_a_heading_is_a_direction(cosine: float, sine: float) -> None:
    length = np.hypot(cosine, sine)
    expected = (cosine / length, sine / length) if length > 1e-6 else (1, 0)
    found = headings(np.array([[cosine, sine], [0, 0], [0, -2]]))
    assert found.ravel().tolist() == pytest.approx([*expected, 1, 0, 0, -1])


@pytest.mark.parametrize("frames", [1, 2, 3, 4, 12, 160, 161, 330])
def test_moves_are_displacement_velocity_and_joints(frames: int) -> None:
    track = Track.of(wandering(frames, frames, 3.0))
    turned = track.turned()
    count = min(frames, 160)
    chosen = [round(k * (frames - 1) / (count - 1)) if frames > 160 else k for k in range(count)]
    joints, velocity = turned.joints[chosen], turned.velocity[chosen]
    rest = (joints[0] + joints[min(1, count - 1)] + joints[max(0, count - 2)] + joints[-1]) / 4
    started = joints.copy()
    hips = 3 * COMMON.index("hips")
    started[:, hips : hips + 3] -= joints[0, hips : hips + 3]

    def scaled(part: Float64Array) -> Float64Array:
        return np.asarray(part / max(np.sqrt(np.mean([frame @ frame for frame in part])), 1e-6))

    expected = np.hstack([0.3 * scaled(joints - rest), scaled(velocity), 0.4 * started])
    np.testing.assert_allclose(track.moves(), expected, rtol=1e-4, atol=1e-5)
    np.testing.assert_array_equal(from_start(joints), started)


def test_a_clip_starts_and_ends_in_two_frames_each() -> None:
    assert [ends(count) for count in (1, 2, 3, 4, 9)] == [
        [0, 0, 0, 0], [0, 1, 0, 1], [0, 1, 1, 2], [0, 1, 2, 3], [0, 1, 7, 8],
    ]  # fmt: skip


@pytest.mark.parametrize(("frames", "count"), [(1, 4), (9, 4), (11, 4), (12, 5), (30, 12), (31, 12), (100, 40)])
def test_twelve_frames_of_thirty_are_taken_evenly(frames: int, count: int) -> None:
    sequence = np.arange(frames * 45, dtype=np.float64).reshape(frames, 15, 3)
    chosen = [round(k * (frames - 1) / (count - 1)) for k in range(count)]
    found = at_12(sequence)
    np.testing.assert_array_equal(found, sequence.reshape(frames, 45)[chosen])
    assert found.dtype == np.float32


@given(st.integers(0, 9), st.integers(0, 9))
def test_a_cut_track_has_those_frames(start: int, length: int) -> None:
    track = Track.of(wandering(0, 20))
    part = track.cut(start, start + length)
    for name in ("joints", "velocity", "facing"):
        np.testing.assert_array_equal(getattr(part, name), getattr(track, name)[start : start + length])
