"""Measures of synthesis, against loops, closed forms and hand-made motions that must be told apart."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import Float64Array
from motionlake.evaluation.synthesis.angles import angular_ranges, never_turned
from motionlake.evaluation.synthesis.contact import FALLS, FLESH, NEAR, SLIDES, footing
from motionlake.evaluation.synthesis.copying import Aligned, nearest_real_distances, rank_z
from motionlake.evaluation.synthesis.errors import errors_at, pose_errors, sparse_poses
from motionlake.evaluation.synthesis.likeness import frechet_distance, recognise
from motionlake.evaluation.synthesis.motions import Stretch, Usual
from motionlake.evaluation.synthesis.movement import (
    bone_length_drift,
    energy,
    energy_windows,
    jerk,
    path_turns,
    travel_speed,
)
from motionlake.evaluation.synthesis.transitions import continuing, reached, seam_jump
from motionlake.evaluation.synthesis.trials import poses_at
from motionlake.evaluation.synthesis.variety import neighbourhoods, pose_spread, spread
from motionlake.motion.dtw import nearest_stretch
from motionlake.motion.features import body_length
from motionlake.motion.ground import KINDS, SIDES, Ground, ground_of
from motionlake.motion.skeleton import INDEX, JOINTS, body_poses, facing
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


def naive_skates(body: Float64Array, fps: float, ground: Ground) -> tuple[float, float]:
    """Share of frames in which even the slowest low point travels, and their share of all frames."""
    size, slow = body_length(body), []
    for t in range(len(body)):
        before, after = max(t - 1, 0), min(t + 1, len(body) - 1)
        speeds = []
        for at, kind in enumerate(KINDS):
            for side in SIDES:
                joint = INDEX[f"{side}_{kind}"]
                x, y, z = body[t, joint]
                rise = y - ground.heights[at] - x * ground.slope[0] - z * ground.slope[1]
                if rise < NEAR * size:
                    way = body[after, joint] - body[before, joint]
                    speeds.append(np.hypot(way[0], way[2]) * fps / (after - before))
        up = [body[i, :, 1].mean() for i in (t - 2, t, t + 2)] if 2 <= t < len(body) - 2 else [0, 0, 0]
        if speeds and (up[0] - 2 * up[1] + up[2]) * (fps / 2) ** 2 > -FALLS:
            slow.append(min(speeds))
    return float(np.mean([v > SLIDES * size for v in slow])), len(slow) / len(body)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 99), st.floats(0, 0.05))
def test_a_body_slides_where_even_the_slowest_foot_travels(seed: int, noise: float) -> None:
    body = moving(1.5, 0.4) + noise * np.random.default_rng(seed).standard_normal((45, 21, 3))
    ground = Ground(ground_of(standing(10)).heights, np.array([0.01, -0.02]))
    found = footing(body, FPS, ground)
    assert (found.skates, found.contact) == pytest.approx(naive_skates(body, FPS, ground))


def test_feet_that_stand_do_not_slide_and_feet_that_swing_do_not_count() -> None:
    ground = ground_of(standing(30))
    assert footing(standing(30), FPS, ground).skates == 0
    glide = footing(moving(2, 0.7), FPS, ground)
    assert (glide.skates, glide.slide, glide.contact) == pytest.approx((1, 0.7, 1))
    assert footing(moving(2, 0.7, 120.0), 120.0, ground).slide == pytest.approx(0.7)
    stepping = moving(2, 0.7)  # the left foot stands still while the right one is dragged along
    stepping[:, [INDEX["left_ankle"], INDEX["left_toe"]]] = standing(60)[:, [INDEX["left_ankle"], INDEX["left_toe"]]]
    assert footing(stepping, FPS, ground).skates == 0
    with pytest.raises(ValueError, match="one frame"):
        footing(standing(1), FPS, ground)


def test_bodies_that_sink_or_fly_are_told_by_the_ground_of_the_recording() -> None:
    ground = ground_of(standing(30))
    size = body_length(standing(30))
    assert footing(standing(30), FPS, ground).depth == pytest.approx(0, abs=1e-9)
    sunk = footing(standing(30) - [0, 0.05, 0], FPS, ground)
    assert (sunk.depth, sunk.sunk, sunk.airborne) == pytest.approx((0.05, 1, 0))
    jump = standing(60)
    jump[20:35, :, 1] += 0.3
    up = footing(jump, FPS, ground)
    assert (up.airborne, up.height) == pytest.approx((0.5, 0.3))
    assert up.contact == pytest.approx(0.75)
    lies = jump.copy()
    lies[20:35, INDEX["hips"], 1] = ground.heights[1] + 0.9 * FLESH * size  # a body that rolls is not in the air
    assert footing(lies, FPS, ground).airborne == 0


def test_the_ground_of_a_recording_may_be_tilted() -> None:
    walk = moving(4, 1.2)
    walk[..., 1] += 0.015 * walk[:, :1, 2]
    walk[10:30, [INDEX["left_ankle"], INDEX["left_toe"]], 1] += 0.2
    ground = ground_of(walk)
    np.testing.assert_allclose(ground.slope, [0, 0.015], atol=1e-3)
    found = footing(walk, FPS, ground)
    assert found.airborne == 0
    assert found.depth < 0.005
    flat = footing(walk, FPS, Ground(ground.heights, np.zeros(2)))
    assert flat.airborne > 0.5  # a level ground would have the body fly
    np.testing.assert_array_equal(ground_of(standing(60)).slope, 0)
    level = ground.level_at(np.array([0, 9.0, 2.0]))
    np.testing.assert_allclose(level.heights, ground.heights + 2 * ground.slope[1])


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


def stretch(positions: Float64Array, label: str = "", fps: float = FPS) -> Stretch:
    return Stretch.alone(positions, fps, np.zeros((21, 3)), label=label)


def test_energy_tells_motion_that_freezes_or_explodes() -> None:
    lively = standing(150)
    lively[:, INDEX["head"], 1] += 0.5 * np.arange(150) / FPS  # 0.5 m/s, one of twenty joints
    assert energy(lively, FPS) == pytest.approx(0.0125)
    np.testing.assert_allclose(energy_windows(lively, FPS), 0.0125)
    assert energy(lively[::2], FPS / 2) == pytest.approx(0.0125)
    assert energy(moving(5, 2.0), FPS) == pytest.approx(0, abs=1e-12)  # where the body goes does not count
    freezing, exploding = lively.copy(), lively.copy()
    freezing[100:] = freezing[100]
    exploding[100:, INDEX["head"], 1] += 3 * (np.arange(50) / FPS)
    real = []
    for speed in np.linspace(0.4, 0.6, 9):
        body = standing(150)
        body[:, INDEX["head"], 1] += speed * np.arange(150) / FPS
        real.append(stretch(body))
    usual = Usual.of(real)
    assert usual.energy == pytest.approx((0.4**2 / 20, 0.6**2 / 20))
    assert usual.fits(stretch(lively)).all()
    for odd in (freezing, exploding):
        fits = usual.fits(stretch(odd))
        assert fits[:60].all()
        assert not fits[-20:].any()
    assert not usual.fits(stretch(standing(30))).any()


def test_jerk_is_the_third_difference() -> None:
    t = np.arange(60) / FPS
    body = standing(60)
    body[..., 1] += 2.0 * t[:, None] ** 3 + t[:, None] ** 2
    np.testing.assert_allclose(jerk(body, FPS), 12)
    assert len(jerk(body[:3], FPS)) == 0


@pytest.mark.parametrize("radius", [0.8, 2.0])
def test_a_circle_turns_by_its_radius_and_an_eight_back_again(radius: float) -> None:
    angle = np.linspace(0, 2 * np.pi, 600)
    circle = standing(600)
    circle[..., 0] += radius * np.sin(angle)[:, None]
    circle[..., 2] += radius * np.cos(angle)[:, None]
    turns = path_turns(circle, FPS)
    assert turns is not None
    np.testing.assert_allclose(turns, 1 / (2 * np.pi * radius), rtol=0.08)
    eight = np.concatenate([circle, circle * [1, 1, -1] + [0, 0, 2 * circle[0, 0, 2]]])
    both = path_turns(eight, FPS)
    assert both is not None
    assert both[1] < 0.25 * both[0]
    assert path_turns(moving(5, 1.0), FPS) == pytest.approx((0, 0), abs=1e-9)
    assert path_turns(standing(50), FPS) is None


def test_how_far_joints_turn_and_which_never_do() -> None:
    swing = np.radians(30) * np.sin(np.linspace(0, 20 * np.pi, 2000))
    turns = np.zeros((2000, 21, 4))
    turns[..., 0] = 1
    turns[:, INDEX["left_wrist"]] = np.stack([np.cos(swing / 2), np.sin(swing / 2), *np.zeros((2, 2000))], axis=1)
    turns[1::2] *= -1  # the same rotations
    found = angular_ranges(turns)
    assert found[INDEX["left_wrist"]] == pytest.approx(30 * np.sin(np.pi / 2 * 0.95), rel=0.01)
    assert found[INDEX["head"]] == pytest.approx(0, abs=1e-6)
    still = never_turned([turns[:4], turns])
    assert len(still) == 20
    assert "left_wrist" not in still
    assert never_turned([]) == []


@settings(max_examples=25, deadline=None)
@given(st.integers(6, 30), st.integers(6, 30), st.integers(1, 4), st.integers(0, 99))
def test_neighbourhoods_are_those_of_loops(n: int, m: int, d: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    real, made = random.standard_normal((n, d)), random.standard_normal((m, d)) + 0.5
    k = 5

    def reach(some: Float64Array, i: int) -> float:
        return float(sorted(np.linalg.norm(some - some[i], axis=1))[k])

    def inside(a: Float64Array, b: Float64Array, radius: float) -> bool:
        return bool(np.linalg.norm(a - b) < radius)

    found = neighbourhoods(real, made)
    balls = [[inside(real[i], made[j], reach(real, i)) for j in range(m)] for i in range(n)]
    assert found["precision"] == pytest.approx(np.mean(np.any(balls, axis=0)))
    assert found["coverage"] == pytest.approx(np.mean(np.any(balls, axis=1)))
    assert found["density"] == pytest.approx(np.sum(balls) / (k * m))
    made_balls = [[inside(real[i], made[j], reach(made, j)) for j in range(m)] for i in range(n)]
    assert found["recall"] == pytest.approx(np.mean(np.any(made_balls, axis=1)))


@settings(max_examples=25, deadline=None)
@given(st.integers(6, 40), st.integers(2, 6), st.integers(0, 99))
def test_equal_sets_cover_one_another_as_densely_as_themselves(n: int, d: int, seed: int) -> None:
    real = np.random.default_rng(seed).standard_normal((n, d))
    equal = neighbourhoods(real, real.copy())
    assert equal == pytest.approx({"precision": 1, "recall": 1, "density": 1, "coverage": 1})
    away = neighbourhoods(real, real + 100.0)
    assert set(away.values()) == {0.0}
    # One mode of two: what is made is real, but half of what is real is not made.
    modes = np.concatenate([real, real + 100.0])
    half = neighbourhoods(modes, real.copy())
    assert half["precision"] == 1
    assert (half["recall"], half["coverage"]) == (0.5, 0.5)
    with pytest.raises(ValueError, match="two vectors"):
        neighbourhoods(real[:1], real)


@settings(max_examples=15, deadline=None)
@given(st.floats(0.3, 3), st.floats(-2, 2), st.integers(0, 99))
def test_frechet_distance_of_gaussians_is_known(scale: float, shift: float, seed: int) -> None:
    random = np.random.default_rng(seed)
    real, made = _standard(random.standard_normal((2000, 2))), _standard(random.standard_normal((2000, 2)))
    expected = 2 * shift**2 + 2 * (scale - 1) ** 2
    assert frechet_distance(real, scale * made + shift) == pytest.approx(expected, rel=1e-5, abs=1e-6)


def _standard(drawn: np.ndarray) -> np.ndarray:
    """The same points [n, d] moved and sheared so that their mean is zero and their covariance one."""
    centred = drawn - drawn.mean(axis=0)
    return np.linalg.solve(np.linalg.cholesky(np.cov(centred.T)), centred.T).T


@settings(max_examples=15, deadline=None)
@given(st.integers(2, 12), st.integers(0, 99))
def test_spread_is_the_mean_distance_of_different_motions(n: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    vectors, of = random.standard_normal((n, 3)), np.sort(random.integers(0, 4, n))
    place = np.array([int((of[:i] == of[i]).sum()) for i in range(n)])
    classes = ["a", "b", "a", "b"]
    pairs = [(i, j) for i in range(n) for j in range(i) if of[i] != of[j] and place[i] == place[j]]
    apart = [
        np.linalg.norm(vectors[i] - vectors[j])
        for i in range(n)
        for j in range(i)
        if of[i] != of[j] and place[i] == place[j]
    ]
    within = [np.linalg.norm(vectors[i] - vectors[j]) for i, j in pairs if classes[of[i]] == classes[of[j]]]
    assert spread(vectors, of, place) == (pytest.approx(np.mean(apart)) if apart else None)
    assert spread(vectors, of, place, classes) == (pytest.approx(np.mean(within)) if within else None)


def test_poses_of_motions_spread_apart_at_the_same_time() -> None:
    up = standing(60)
    up[:, INDEX["left_wrist"], 1] += 0.21
    two = [stretch(standing(60)), stretch(moving(1, 2.0)), stretch(up)]
    length = body_length(standing(60))
    assert pose_spread(two) == pytest.approx(0.01 * 2 / 3 / length)  # a body that only goes elsewhere is the same
    assert pose_spread([stretch(up, "a"), stretch(up, "b")]) is None


def test_seams_are_seen_and_going_on_is_none() -> None:
    before, after = moving(1, 1.0)[-2:], moving(2, 1.0)[30:]
    assert seam_jump(before, after) == pytest.approx(0, abs=1e-9)
    assert seam_jump(before, after + np.array([0.3, 0, 0])) == pytest.approx(0.3)
    found = continuing(after, before, after, FPS)
    assert (found["made"], found["on"]) == pytest.approx((0, 0), abs=1e-9)
    assert found["held"] == pytest.approx(np.mean(np.arange(1, 7)) / FPS)


def test_a_class_is_reached_when_a_second_of_it_is_usual() -> None:
    real = [stretch(moving(4, speed)) for speed in np.linspace(0.9, 1.1, 9)]
    usual = Usual.of(real)
    begins = moving(4, 1.0)
    begins[:30] = begins[30]  # stands for a second
    assert reached(stretch(begins), usual) == pytest.approx(1, abs=0.15)
    assert reached(real[4], usual) == 0
    assert reached(stretch(standing(90)), usual) is None


@settings(max_examples=25, deadline=None)
@given(st.integers(2, 9), st.integers(2, 9), st.integers(0, 99))
def test_rank_z_is_that_of_pairs(n: int, m: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    made, real = random.integers(0, 6, n).astype(float), random.integers(0, 6, m).astype(float)
    u = sum((a > b) + 0.5 * (a == b) for a in made for b in real)
    expected = (u - n * m / 2) / np.sqrt(n * m * (n + m + 1) / 12)
    assert rank_z(made, real) == pytest.approx(expected)
    assert rank_z(real, made) == pytest.approx(-expected)


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
