"""Measures of synthesis, against loops, closed forms and hand-made motions that must be told apart."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import Float64Array
from motionlake.evaluation.synthesis_likeness import Aligned, frechet_distance, nearest_real_distances, recognise
from motionlake.evaluation.synthesis_metrics import (
    LOW,
    Energy,
    body_poses,
    bone_length_drift,
    energy,
    errors_at,
    foot_sliding,
    pose_errors,
    sparse_poses,
    travel_speed,
    within_range,
)
from motionlake.evaluation.synthesis_trials import poses_at
from motionlake.motion.dtw import nearest_stretch
from motionlake.motion.features import body_length
from motionlake.motion.skeleton import INDEX, JOINTS, facing
from scipy.linalg import sqrtm

from tests.test_pictures import standing

FPS = 30.0


def moving(seconds: float, speed: float, fps: float = FPS) -> Float64Array:
    """A stiff body that glides along +z."""
    body = standing(round(seconds * fps))
    body[..., 2] += speed * np.arange(len(body))[:, None] / fps
    return body


def turned(positions: Float64Array, yaw: Float64Array) -> Float64Array:
    cos, sin = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    x, y, z = positions[..., 0], positions[..., 1], positions[..., 2]
    return np.stack([cos * x + sin * z, y, cos * z - sin * x], axis=-1)


@pytest.mark.parametrize(("n", "m", "d"), [(40, 30, 6), (5, 30, 12), (7, 6, 20)])
def test_frechet_distance_is_that_of_means_and_covariances(n: int, m: int, d: int) -> None:
    random = np.random.default_rng(n)
    real = random.standard_normal((n, d)) @ random.standard_normal((d, d))
    made = random.standard_normal((m, d)) * 2 + 1
    s, t = np.cov(real.T), np.cov(made.T)
    root = np.real(sqrtm(s + 1e-12 * np.eye(d)))  # singular where n < d; sqrtm (s t) would not do
    cross = np.sqrt(np.clip(np.linalg.eigvalsh(root @ t @ root), 0, None)).sum()
    expected = np.sum((real.mean(axis=0) - made.mean(axis=0)) ** 2) + np.trace(s) + np.trace(t) - 2 * cross
    assert frechet_distance(real, made) == pytest.approx(expected, rel=1e-4)
    assert frechet_distance(made, real) == pytest.approx(expected, rel=1e-4)
    assert frechet_distance(real, real) == pytest.approx(0, abs=1e-8)
    assert frechet_distance(real, real + 3.0) == pytest.approx(9 * d)
    with pytest.raises(ValueError, match="no Frechet distance"):
        frechet_distance(real[:1], made)


@settings(max_examples=25, deadline=None)
@given(st.integers(1, 5), st.integers(1, 4), st.integers(0, 99))
def test_errors_of_poses_are_means_over_joints_and_poses(frames: int, joints: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    made, true = random.standard_normal((2, frames, joints, 3))
    each = [[np.sqrt(sum((made[f, j] - true[f, j]) ** 2)) for j in range(joints)] for f in range(frames)]
    whole = [np.sqrt(sum(v**2 for v in (made[f] - true[f]).ravel())) for f in range(frames)]
    assert pose_errors(made, true) == pytest.approx((np.mean(each), np.mean(whole)))
    with pytest.raises(ValueError, match="cannot be compared"):
        pose_errors(made, true[:, :, :2])


def test_poses_do_not_tell_where_a_body_is_nor_where_it_faces() -> None:
    body = standing(20)
    body[:, INDEX["left_wrist"], 2] += np.linspace(0, 0.4, 20)
    elsewhere = turned(body, np.linspace(-2, 3, 20)) + np.array([3.0, 0.0, -1.0])
    np.testing.assert_allclose(body_poses(elsewhere), body_poses(body), atol=1e-9)
    np.testing.assert_allclose(facing(body_poses(elsewhere)), 0, atol=1e-9)
    np.testing.assert_allclose(body_poses(body)[:, :, 1], body[:, :, 1] - body[:, :1, 1])


def test_errors_at_real_times_count_from_the_last_pose_of_the_seed() -> None:
    fps = 25.0  # 80 ms is frame 1 of it
    true, held = standing(17), standing(9)
    away = 0.3 * (np.arange(17) + 1) / fps  # the hand goes off at 0.3 m/s from the seed's last pose on
    true[:, INDEX["left_wrist"], 1] += away
    found = errors_at(held, true, fps, (80, 100, 360, 361, 40, 39))
    expected = 0.3 * np.array([0.08, 0.1, 0.36, np.nan, 0.04, np.nan])
    np.testing.assert_allclose(found[:, 1], expected, atol=1e-12)
    np.testing.assert_allclose(found[:, 0], expected / len(JOINTS), atol=1e-12)
    assert np.isnan(errors_at(true[:2], true, fps, (81, 121))[:, 0]).tolist() == [True, True]
    np.testing.assert_allclose(poses_at(true, np.array([1.5])), [(true[1] + true[2]) / 2])


def test_sparse_poses_forget_timing_and_size() -> None:
    swing = standing(61)
    angle = np.linspace(0, 1.2, 61)
    for joint in ("left_elbow", "left_wrist"):
        arm = np.linalg.norm(swing[:, INDEX[joint]] - swing[:, INDEX["left_shoulder"]], axis=-1)
        swing[:, INDEX[joint], 0] = swing[:, INDEX["left_shoulder"], 0] + arm * np.cos(angle)
        swing[:, INDEX[joint], 1] = swing[:, INDEX["left_shoulder"], 1] + arm * np.sin(angle)
    late = np.concatenate([np.repeat(swing[:1], 3, axis=0), swing[::2], np.repeat(swing[-1:], 3, axis=0)])
    poses = sparse_poses(swing, FPS)
    assert poses.shape == (15, 20, 3)
    assert pose_errors(sparse_poses(1.3 * swing, FPS), poses)[0] < 1e-9
    backwards = pose_errors(sparse_poses(swing[::-1], FPS), poses)[0]
    assert pose_errors(sparse_poses(late, FPS), poses)[0] < backwards / 5
    steps = np.linalg.norm(np.diff(poses[:, INDEX["left_wrist"] - 1], axis=0), axis=1)
    assert steps.std() < 0.05 * steps.mean()


def naive_sliding(positions: Float64Array, fps: float) -> tuple[float, float]:
    height = LOW * body_length(positions)
    slides, near = [], []
    for kind in ("ankle", "toe"):
        feet = positions[:, [INDEX[f"left_{kind}"], INDEX[f"right_{kind}"]]]
        ground = np.quantile([min(pair[:, 1]) for pair in feet], 0.05)
        for foot in range(2):
            for before, after in zip(feet[:-1, foot], feet[1:, foot], strict=True):
                h = (before[1] + after[1]) / 2 - ground
                v = fps * np.hypot(after[0] - before[0], after[2] - before[2])
                slides.append(v * (2 - 2 ** min(max(h / height, 0), 1)))
                near.append(h < height)
    return float(np.mean(slides)), float(np.mean(near))


def test_feet_slide_where_they_are_low_and_move() -> None:
    random = np.random.default_rng(0)
    body = moving(2, 1.0) + 0.02 * random.standard_normal((60, 21, 3))
    found = foot_sliding(body, FPS)
    assert (found.speed, found.contact) == pytest.approx(naive_sliding(body, FPS))
    assert foot_sliding(standing(30), FPS).speed == 0
    glide = foot_sliding(moving(2, 0.7), FPS)
    assert (glide.speed, glide.standing_speed, glide.contact) == pytest.approx((0.7, 0.7, 1.0))
    assert foot_sliding(moving(2, 0.7, 120.0), 120.0).speed == pytest.approx(0.7)
    hop = moving(2, 0.7)
    hop[30:, :, 1] += 0.2
    hopping = foot_sliding(hop, FPS)
    assert hopping.contact == pytest.approx(29 / 59)
    assert hopping.speed == pytest.approx(0.7 * 29 / 59)
    assert hopping.standing_speed == pytest.approx(0.7)
    stepping = moving(2, 0.7)  # the left foot stands still while the right one swings high
    stepping[:, [INDEX["left_ankle"], INDEX["left_toe"]]] = standing(60)[:, [INDEX["left_ankle"], INDEX["left_toe"]]]
    stepping[:, [INDEX["right_ankle"], INDEX["right_toe"]], 1] += 0.1
    assert foot_sliding(stepping, FPS).speed == 0
    with pytest.raises(ValueError, match="one frame"):
        foot_sliding(body[:1], FPS)


def test_bone_length_drift_is_the_worst_of_all_bones_and_frames() -> None:
    body = standing(10)
    assert bone_length_drift(body) == pytest.approx(0)
    elbow, wrist = INDEX["left_elbow"], INDEX["left_wrist"]
    body[7, wrist] = body[7, elbow] + 0.97 * (body[7, wrist] - body[7, elbow])
    assert bone_length_drift(body) == pytest.approx(3)
    rest = np.zeros((21, 3))
    rest[1:, 1] = 1
    parents = np.array([0, 0, 1, 2, 3, 2, 5, 6, 7, 2, 9, 10, 11, 0, 13, 14, 15, 0, 17, 18, 19])
    rest[:, 1] = np.linalg.norm(standing(1)[0] - standing(1)[0, parents], axis=-1)
    rest[wrist] *= 2
    assert bone_length_drift(body, rest) == pytest.approx(100 * (1 - 0.97 / 2))


def test_energy_tells_motion_that_freezes_or_explodes() -> None:
    lively = standing(150)
    lively[:, INDEX["head"], 1] += 0.5 * np.arange(150) / FPS  # 0.5 m/s, one of twenty joints
    found = energy(lively, FPS)
    assert (found.mean, found.low, found.high) == pytest.approx((0.0125,) * 3)
    assert energy(lively[::2], FPS / 2).mean == pytest.approx(0.0125)
    assert energy(moving(5, 2.0), FPS).high == pytest.approx(0, abs=1e-12)  # where the body goes does not count
    freezing, exploding = lively.copy(), lively.copy()
    freezing[100:] = freezing[100]
    exploding[100:, INDEX["head"], 1] += 3 * (np.arange(50) / FPS)
    real = [energy(lively, FPS), Energy(0.012, 0.008, 0.02)]
    assert within_range([energy(each, FPS) for each in (lively, freezing, exploding)], real) == [True, False, False]
    assert within_range([energy(freezing[:90], FPS)], real) == [True]


def test_travel_is_not_sway() -> None:
    seconds = np.arange(300) / FPS
    walk = moving(10, 1.3)
    walk[..., 0] += 0.04 * np.sin(2 * np.pi * 0.9 * seconds)[:, None]
    assert travel_speed(walk, FPS) == pytest.approx(1.3, rel=0.01)
    sway = standing(300)
    sway[..., 0] += 0.04 * np.sin(2 * np.pi * 0.9 * seconds)[:, None]
    assert travel_speed(sway, FPS) < 0.03
    assert travel_speed(moving(0.5, 1.3), FPS) == pytest.approx(1.3)
    circle = standing(300)
    circle[..., 0] += 2 * np.sin(seconds / 2)[:, None]
    circle[..., 2] += 2 * np.cos(seconds / 2)[:, None]
    assert travel_speed(circle, FPS) == pytest.approx(1.0, rel=0.02)


def test_the_nearest_real_clip_is_found_without_itself() -> None:
    random = np.random.default_rng(0)
    real = [random.standard_normal((n, 4)).astype(np.float32) for n in (5, 9, 7)]
    made = [real[1].copy(), random.standard_normal((6, 4)).astype(np.float32)]
    seen: list[tuple[int, int]] = []
    clips = [Aligned(frames, frozenset({f"real {i}"})) for i, frames in enumerate(real)]
    motions = [Aligned(frames, frozenset()) for frames in made]
    found = nearest_real_distances(motions, clips, lambda done, total: seen.append((done, total)))
    assert found[0] == pytest.approx(0, abs=1e-3)
    assert found[1] == pytest.approx(min(nearest_stretch(made[1], clip).cost for clip in real))
    assert seen == [(1, 2), (2, 2)]
    alone = nearest_real_distances(clips, clips)
    for i in range(3):
        assert alone[i] == pytest.approx(min(nearest_stretch(real[i], real[j]).cost for j in range(3) if j != i))
    assert np.isnan(nearest_real_distances(clips[:1], clips[:1])).all()


def test_classes_are_recognised_across_what_varies_within_them() -> None:
    random = np.random.default_rng(0)
    labels = ["b", "a"] * 40
    points = np.array([[0.0, 0.0, 5.0 * random.standard_normal()] for _ in labels])
    points[:, 0] = [1.0 if label == "a" else -1.0 for label in labels]
    points[:, :2] += 0.2 * random.standard_normal((80, 2))
    seen = recognise(points[:60], labels[:60], points[60:])
    assert seen == labels[60:]
    nearest = [labels[int(np.linalg.norm(points[:60] - each, axis=1).argmin())] for each in points[60:]]
    assert nearest != labels[60:]  # what a plain nearest neighbour makes of it
    lone = np.concatenate([points, [[9.0, 9.0, 9.0]]])
    assert recognise(lone, [*labels, "c"], lone[-1:]) == ["c"]
    assert recognise(lone, [*labels, "c"], lone[[-1, 1]], [[80], []]) == ["a", "a"]
    assert recognise(np.ones((2, 3)), ["b", "a"], np.ones((1, 3))) == ["a"]


def test_what_cannot_be_measured_is_refused() -> None:
    short: dict[str, Any] = {"positions": standing(1), "fps": FPS}
    for measure in (energy, travel_speed, sparse_poses):
        with pytest.raises(ValueError, match="frame"):
            measure(**short)
    with pytest.raises(ValueError, match="real clips"):
        within_range([Energy(1, 1, 1)], [])
