"""Features of frames and the windows cut from them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.motion.features import (
    WordConfig,
    body_length,
    native_ranges,
    padded,
    windows,
    word_features,
    word_windows,
)
from motionlake.motion.resampling import resample, sample_count
from motionlake.motion.skeleton import COMMON, DEEP_MOTIFS, INDEX, JOINTS, facing
from numpy.typing import NDArray

NO_ROTATIONS = np.empty((0, 21, 4))
NO_POSITIONS = np.empty((0, 21, 3))


def walker(n_frames: int, fps: float, *, seed: int = 0) -> NDArray[np.float64]:
    """[F, 21, 3] a body facing +z that sways smoothly while it walks along +z."""
    rng = np.random.default_rng(seed)
    rest = np.add(rng.uniform(-0.6, 0.6, (21, 3)), [0, 1, 0])
    for side, x in (("left", 0.2), ("right", -0.2)):
        rest[INDEX[f"{side}_hip"]] = [x, 1, 0]
        rest[INDEX[f"{side}_shoulder"]] = [x, 1.5, 0]
    time = np.arange(n_frames)[:, None, None] / fps
    sway = 0.05 * np.sin(2 * time + rng.uniform(0, 6, (21, 3)))
    for side in ("left", "right"):
        sway[:, [INDEX[f"{side}_hip"], INDEX[f"{side}_shoulder"]]] = 0
    return rest + sway + np.array([0, 0, 1.0]) * time


def turned(positions: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    c, s = np.cos(angle), np.sin(angle)
    there: NDArray[np.float64] = positions @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T
    return there


def quaternions(n_frames: int, seed: int = 0) -> NDArray[np.float64]:
    q = np.random.default_rng(seed).standard_normal((n_frames, 21, 4))
    unit: NDArray[np.float64] = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return unit


@settings(max_examples=25, deadline=None)
@given(st.floats(-3, 3), st.floats(-5, 5), st.floats(0.3, 3), st.integers(0, 99))
def test_features_know_neither_place_nor_facing_nor_size(angle: float, shift: float, size: float, seed: int) -> None:
    config = WordConfig(root_weight=3.0, velocity_weight=2.0, smoothing=0.0)
    body = walker(50, 30.0, seed=seed)
    moved = size * turned(body, angle) + [shift, 0.3, -shift]
    expected = word_features(body, NO_ROTATIONS, 30.0, config)
    np.testing.assert_allclose(word_features(moved, NO_ROTATIONS, 30.0, config), expected, atol=2e-5)


def test_the_layout_of_position_features() -> None:
    body = walker(121, 120.0)
    size = body_length(body)
    config = WordConfig(root_weight=3.0, velocity_weight=2.0, smoothing=0.0)
    features = word_features(body, NO_ROTATIONS, 120.0, config)
    assert features.shape == (25, config.dimension)
    assert features.dtype == np.float32
    joints = [INDEX[name] for name in COMMON if name != "hips"]
    expected = (body[::5][:, joints] - body[::5][:, :1]) / size
    np.testing.assert_allclose(features[:, :42], expected.reshape(25, 42), atol=1e-5)
    np.testing.assert_allclose(features[:, 42:84], 2 * np.gradient(expected, axis=0).reshape(25, 42), atol=1e-5)
    np.testing.assert_allclose(features[:, 84:86], 3 * np.gradient(body[::5, 0], axis=0)[:, :2] / size, atol=1e-5)
    np.testing.assert_allclose(features[:, 87], 0, atol=1e-6)
    assert WordConfig(root_weight=0, velocity_weight=0).dimension == 42


def test_smoothing_averages_positions_over_time() -> None:
    rng = np.random.default_rng(0)
    body = walker(100, 24.0) + 0.02 * rng.standard_normal((100, 21, 3))
    plain, smooth = (WordConfig(root_weight=0, velocity_weight=0, smoothing=s) for s in (0.0, 1.0))
    weights = np.exp(-0.5 * np.arange(-4, 5) ** 2)
    averaged = body.copy()
    for t in range(4, 96):
        averaged[t] = np.tensordot(weights / weights.sum(), body[t - 4 : t + 5], axes=1)
    found = word_features(body, NO_ROTATIONS, 24.0, smooth)
    expected = word_features(averaged, NO_ROTATIONS, 24.0, plain) * (body_length(averaged) / body_length(body))
    np.testing.assert_allclose(found[4:96], expected[4:96], atol=1e-5)


def test_turning_shows_as_yaw_rate_and_velocity_is_seen_from_the_body() -> None:
    still = np.repeat(walker(1, 24.0), 240, axis=0)
    angles = 0.05 * np.arange(240)
    spinning = np.concatenate([turned(frame[None], a) for frame, a in zip(still, angles, strict=True)])
    path = np.cumsum(np.column_stack([np.sin(angles), 0 * angles, np.cos(angles)]), axis=0) * 0.01
    config = WordConfig(root_weight=1.0, velocity_weight=0, smoothing=0)
    features = word_features(spinning + path[:, None], NO_ROTATIONS, 24.0, config)
    np.testing.assert_allclose(np.diff(facing(spinning)), 0.05, atol=1e-9)
    np.testing.assert_allclose(features[:, -1], 0.05, atol=1e-6)
    root = (spinning + path[:, None])[:, 0]
    speed = np.linalg.norm(np.gradient(root, axis=0), axis=1) / body_length(spinning)
    np.testing.assert_allclose(np.linalg.norm(features[:, -4:-1], axis=1), speed, rtol=1e-4)
    assert np.ptp(features[5:-5], axis=0).max() < 1e-4


def test_a_body_lying_on_its_side_keeps_its_heading() -> None:
    body = np.repeat(turned(walker(1, 24.0), 0.7), 5, axis=0)
    for side, y in (("left", 1.0), ("right", 0.6)):
        for joint in ("hip", "shoulder"):
            body[2:4, INDEX[f"{side}_{joint}"]] = [0.1, y, 0.2]
    np.testing.assert_allclose(facing(body), 0.7, atol=1e-9)
    lying = word_features(body, NO_ROTATIONS, 24.0, WordConfig(velocity_weight=0))
    np.testing.assert_allclose(lying[:, -1], 0, atol=1e-6)


@pytest.mark.parametrize(
    ("n", "fps", "t"),
    [(1, 120, 1), (121, 120, 25), (120, 120, 24), (31, 30, 25), (30, 30, 24), (5, 24, 5), (101, 59.94, 41)],
)
def test_how_many_frames_are_sampled(n: int, fps: float, t: int) -> None:
    assert sample_count(n, fps, WordConfig().fps) == t


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 200), st.sampled_from([24.0, 30.0, 59.94, 60.0, 100.0, 120.0, 12.5]))
def test_sampling_is_at_exact_instants(n: int, fps: float) -> None:
    config = WordConfig()
    line = np.arange(n, dtype=float)[:, None, None] / fps
    sampled = resample(line, fps, config.fps)[:, 0, 0]
    np.testing.assert_allclose(sampled, np.arange(len(sampled)) / 24, atol=1e-7)
    assert sampled[-1] + 1 / 24 > line[-1, 0, 0] - 1e-6


def test_rotations_are_blended_on_one_hemisphere() -> None:
    config = WordConfig.deep_motifs()
    half = np.zeros((3, 21, 4))
    for frame, angle in enumerate((0.0, 0.4, 0.8)):
        half[frame, :, 0], half[frame, :, 1] = np.cos(angle), np.sin(angle)
    half[1] *= -1
    features = word_features(NO_POSITIONS, half, 48.0, config)
    assert features.shape == (2, 64) == (2, 4 * len(DEEP_MOTIFS))
    np.testing.assert_allclose(features[1, :4], [np.cos(0.8), np.sin(0.8), 0, 0], atol=1e-7)
    between = word_features(NO_POSITIONS, half, 12.0, config)
    np.testing.assert_allclose(between[1, :4], [np.cos(0.2), np.sin(0.2), 0, 0], atol=1e-7)
    random = word_features(NO_POSITIONS, quaternions(40), 30.0, config).reshape(-1, 16, 4)
    np.testing.assert_allclose(np.linalg.norm(random, axis=-1), 1, atol=1e-6)
    assert random[..., 0].min() >= 0
    first = quaternions(40)[0, [INDEX[name] for name in DEEP_MOTIFS]]
    np.testing.assert_allclose(random[0], np.where(first[:, :1] < 0, -first, first), atol=1e-6)


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 80), st.integers(1, 20), st.integers(1, 20))
def test_windows_are_the_frames_they_start_at(n_frames: int, length: int, stride: int) -> None:
    config = WordConfig(length=length, stride=stride)
    features = np.random.default_rng(0).random((n_frames, 3)).astype(np.float32)
    starts, words = windows(n_frames, config), word_windows(features, config)
    assert words.shape == (len(starts), length, 3)
    assert len(starts) == max(1, (n_frames - length) // stride + 1)
    for start, word in zip(starts, words, strict=True):
        expected = features[np.minimum(np.arange(start, start + length), n_frames - 1)]
        np.testing.assert_array_equal(word, expected)
    if n_frames >= length:
        assert np.shares_memory(words, features)
    assert len(padded(features, config)) == max(n_frames, length)


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 500), st.sampled_from([24.0, 30.0, 59.94, 60.0, 100.0, 120.0, 12.5]))
def test_native_ranges_stay_inside_and_follow_each_other(n_frames: int, fps: float) -> None:
    config = WordConfig(length=16, stride=4)
    starts = windows(sample_count(n_frames, fps, config.fps), config)
    ranges = native_ranges(starts, fps, n_frames, config).tolist()
    for (first, stop), start in zip(ranges, starts.tolist(), strict=True):  # as if it were the only word
        assert first == min(round(start * (fps / config.fps)), n_frames - 1)
        assert stop == max(first + 1, min(round((start + config.length) * (fps / config.fps)), n_frames))
    assert all(0 <= first < stop <= n_frames for first, stop in ranges)
    assert ranges[0][0] == 0
    for (_, stop), (first, _) in zip(ranges, ranges[4:], strict=False):
        assert stop == first
    assert native_ranges(np.array([8]), 120.0, 10_000, config).tolist() == [[40, 120]]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"representation": "angles"}, "representation"),
        ({"joints": "all"}, "joints"),
        ({"stride": 0}, "positive"),
        ({"fps": float("nan")}, "positive"),
        ({"root_weight": -1.0}, "negative"),
        ({"smoothing": -1.0}, "negative"),
        ({"representation": "rotations"}, "deep_motifs16"),
    ],
)
def test_configurations_without_meaning_are_refused(change: dict[str, object], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        WordConfig(**change)  # type: ignore[arg-type]


def test_clips_without_meaning_are_refused() -> None:
    with pytest.raises(ValueError, match="without frames"):
        word_features(NO_POSITIONS, NO_ROTATIONS, 24.0, WordConfig())
    with pytest.raises(ValueError, match="no size"):
        word_features(np.zeros((4, len(JOINTS), 3)), NO_ROTATIONS, 24.0, WordConfig())
    with pytest.raises(ValueError, match="frame rate"):
        word_features(walker(4, 24.0), NO_ROTATIONS, 0.0, WordConfig())
    with pytest.raises(ValueError, match="without frames"):
        windows(0, WordConfig())
