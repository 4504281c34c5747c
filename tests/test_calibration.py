"""Calibration poses at the ends of recordings: found in real ones and in made ones, and left out of synthesis."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motionlake.arrays import BoolArray, Float64Array
from motionlake.glogen.config import SynthesisConfig
from motionlake.glogen.generator import TrainingMotion, start_state
from motionlake.glogen.generator_training import train_generator
from motionlake.motion.calibration import (
    AROUND,
    DEGREES,
    EDGE,
    HELD,
    LONGEST,
    SETTLED,
    SLOW,
    STEPS,
    STILL,
    jumps,
    recorded,
    recorded_range,
    run_of,
    tposes,
)
from motionlake.motion.generation import MotionRequest, SeedClip
from motionlake.motion.skeleton import INDEX, PARENTS

from bench import canonical_sets
from bench.glogen.sets import SETS
from bench.pretrained_generator import classes
from tests.test_pictures import standing

FPS = 120.0


def stretched(frames: int) -> Float64Array:
    """A body in a T-pose that holds still."""
    return np.asarray(standing(frames))


def lowered(frames: int) -> Float64Array:
    """Its arms hang."""
    body = stretched(frames)
    for side in ("left", "right"):
        for joint, down in (("elbow", 0.28), ("wrist", 0.53)):
            body[:, INDEX[f"{side}_{joint}"]] = body[:, INDEX[f"{side}_shoulder"]] - np.array([0, down, 0])
    return body


def walking(frames: int) -> Float64Array:
    body: Float64Array = lowered(frames) + np.array([0.4, 0, 0])
    t = np.arange(frames) / FPS
    body[..., 2] += t[:, None]
    body[:, INDEX["left_wrist"], 2] += 0.1 * np.sin(6 * t)
    return body


@pytest.mark.parametrize("before", [0, 1, 4, 60])
@pytest.mark.parametrize("after", [0, 1, 30])
def test_tposes_at_either_end_are_found(before: int, after: int) -> None:
    body = np.concatenate([stretched(before), walking(240), stretched(after) + np.array([0.4, 0, 2])])
    assert recorded_range(body, FPS) == (before, before + 240)
    assert len(recorded(body, FPS)) == 240


def test_slow_arms_pass_through_a_tpose() -> None:
    body = stretched(240)
    for side, sign in (("left", 1), ("right", -1)):
        for joint, far in (("elbow", 0.28), ("wrist", 0.53)):
            down = np.radians(15 + np.arange(240) * 0.6)
            arms = np.column_stack([sign * np.cos(down), -np.sin(down), np.zeros(240)])
            body[:, INDEX[f"{side}_{joint}"]] = body[:, INDEX[f"{side}_shoulder"]] + far * arms
    assert 5 < tposes(body).sum() < 0.25 * FPS
    assert recorded_range(body, FPS) == recorded_range(body[::-1], FPS) == (0, 240)


def test_other_poses_are_found_where_the_joints_jump_from_them() -> None:
    odd = walking(240)
    odd[:3] += [0.5, 0.2, 0]
    assert recorded_range(odd, FPS) == (3, 240)
    smeared = walking(240)
    smeared[:6, :, 0] += np.array([0.5, 0.1, 0.06, 0.03, 0.012, 0.004])[:, None]  # as a filter leaves it
    assert recorded_range(smeared, FPS)[0] in (4, 5)
    late = walking(240)
    late[:60] += [0.5, 0.2, 0]  # a cut within the motion is no calibration pose
    assert recorded_range(late, FPS) == (0, 240)
    assert recorded_range(walking(240), FPS) == (0, 240)
    spread = walking(240) - lowered(240) + stretched(240)  # who walks with arms spread calibrates nothing
    assert tposes(spread).all()
    assert recorded_range(np.concatenate([spread, walking(240) + spread[-1, 0] - walking(1)[0, 0]]), FPS)[0] == 0


def unit(positions: Float64Array, start: str, stop: str) -> Float64Array:
    bone = positions[:, INDEX[stop]] - positions[:, INDEX[start]]
    return np.asarray(bone / np.maximum(np.linalg.norm(bone, axis=1, keepdims=True), 1e-9))


def naive_tposes(positions: Float64Array) -> BoolArray:
    """Bone by bone."""
    left, down = unit(positions, "right_shoulder", "left_shoulder"), unit(positions, "neck", "hips")
    fits = np.ones(len(positions), dtype=np.bool_)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for start, stop in (("shoulder", "elbow"), ("elbow", "wrist")):
            arm = unit(positions, f"{side}_{start}", f"{side}_{stop}")
            fits &= (sign * arm * left).sum(axis=1) > np.cos(np.radians(DEGREES))
        fits &= (unit(positions, f"{side}_hip", f"{side}_ankle") * down).sum(axis=1) > np.cos(np.radians(DEGREES))
    return fits


def naive_beginning(body: Float64Array) -> int:
    """As `recorded_range` has it, with every frame looked at."""
    edge, most = round(EDGE * FPS), round(LONGEST * FPS)
    body = body[: most + 6 * edge + 4 * AROUND]
    steps = np.linalg.norm(np.diff(body, axis=0), axis=2).mean(axis=1)
    still = np.minimum(np.r_[np.inf, steps], np.r_[steps, np.inf])[: len(body)] * FPS < SLOW
    stretched = naive_tposes(body)
    start = run_of(stretched & still, most)
    start = start if start >= HELD * FPS else 0
    near = jumps(body[: start + edge + 2 * AROUND + 2])
    start = max([start, *(jump.stop for jump in near if jump.stop <= start + edge)])
    after = steps[start : start + 4 * edge - 1]
    if len(after) <= edge:
        return start
    usual = max(after[edge:].max(), STILL)
    if not start and not (stretched[0] and after[0] > STEPS * usual):
        return 0
    restless = np.flatnonzero(after[:edge] > SETTLED * usual)
    return start + (int(restless[-1]) + 1 if len(restless) else 0)


@given(
    before=st.integers(0, 60), frames=st.integers(30, 200), turned=st.floats(0, 60),
    leap=st.sampled_from([0.0, 0.02, 0.3]), seed=st.integers(0, 1000),
)  # fmt: skip
def test_what_is_looked_at_first_decides_as_all_frames_would(
    before: int, frames: int, turned: float, leap: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    arms = np.radians(turned)
    body = np.concatenate([stretched(before), walking(frames) + np.array([leap, 0, 0])])
    for side, sign in (("left", 1), ("right", -1)):
        arm = np.array([sign * np.cos(arms), -np.sin(arms), 0])
        for joint, far in (("elbow", 0.28), ("wrist", 0.53)):
            body[:before, INDEX[f"{side}_{joint}"]] = body[:before, INDEX[f"{side}_shoulder"]] + far * arm
    body += rng.normal(0, 1e-4, body.shape)
    assert tposes(body).tolist() == naive_tposes(body).tolist()
    start, stop = naive_beginning(body), len(body) - naive_beginning(body[::-1])
    assert recorded_range(body, FPS) == ((start, stop) if stop - start >= 2 else (0, len(body)))


def test_a_recording_that_is_nothing_else_is_left_whole() -> None:
    assert tposes(stretched(5)).all()
    assert not tposes(lowered(5)).any()
    for frames in (0, 1, 2, 100, round(LONGEST * FPS) + 1):
        assert recorded_range(stretched(frames), FPS) == (0, frames)


def test_motion_neither_starts_from_calibration_poses_nor_learns_from_them() -> None:
    clean = walking(360)
    calibrated = np.concatenate([stretched(12), clean])
    rest = clean[0] - clean[0, np.maximum(PARENTS, 0)]
    seeds = [SeedClip("clip", body, FPS, rest) for body in (clean, calibrated)]
    for cyclic in (False, True):
        first, second = (start_state(seed, 0, 20, cyclic) for seed in seeds)
        np.testing.assert_array_equal(first.rows, second.rows)
        np.testing.assert_array_equal(first.root, second.root)
        assert (second.first, second.last) == (first.first + 12, first.last + 12)  # frames of the clip as it is
    generators = [
        train_generator([TrainingMotion(body, FPS, "walk")] * 4, SynthesisConfig(epochs=1))
        for body in (clean, calibrated)
    ]
    made = [
        each.generate([MotionRequest(("walk",), 1.0, 0, seed)])[0].positions
        for each, seed in zip(generators, seeds, strict=True)
    ]
    np.testing.assert_array_equal(made[0], made[1])
    with pytest.raises(ValueError, match=r"lasts 0\.50 s without its calibration poses"):
        start_state(SeedClip("clip", calibrated[:72], FPS, rest), 0, 20)


def test_every_clip_of_cmu_begins_with_one_and_no_clip_of_utd_mhad(recordings: Path) -> None:
    for name in ("walk", "indian", "martial"):
        for clip in canonical_sets.read(SETS[name]):
            start, stop = recorded_range(clip.positions, clip.fps)
            assert 0 < start <= 0.1 * clip.fps, clip.name
            assert len(clip.positions) - stop < 0.2 * clip.fps
            kept = clip.positions[start:stop].astype(float)
            steps = np.linalg.norm(np.diff(kept, axis=0), axis=2).mean(axis=1)
            assert steps[0] < 0.05  # metres: no jump is left
    for clip in canonical_sets.load("utd_mhad")[::9]:
        assert recorded_range(clip.positions, clip.fps) == (0, len(clip.positions))


def test_a_run_and_leap_is_no_run(recordings: Path) -> None:
    found = classes()
    told = [label for path, label in found.items() if path.parts[-3] == "cmu_bvh"]
    assert (told.count("run"), told.count("walk"), told.count("ballet")) == (11, 68, 28)
