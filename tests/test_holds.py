"""Recordings that hold a pose within one frame, as one does that goes on after its last marker was lost."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from motionlake.arrays import Float64Array
from motionlake.matching.generator import MatchingGenerator
from motionlake.matching.recordings import sound_ranges
from motionlake.motion.generation import FPS, MotionRequest
from motionlake.motion.holds import held_ranges

from bench.canonical_sets import read
from bench.classes import CLASSES
from bench.made.splits import clips_of
from bench.matching_clips import database_of, seed_of


def moving(frames: int, speed: float = 1.0) -> Float64Array:
    """[F, 21, 3] joints that go ahead, metres a second at 100 frames a second."""
    rng = np.random.default_rng(0)
    joints = np.repeat(rng.normal(size=(1, 21, 3)), frames, axis=0)
    joints[..., 2] += speed * np.arange(frames)[:, None] / 100
    return joints


@pytest.mark.parametrize("at", [0, 40, 100])
def test_a_pose_that_is_held_at_once_is_told(at: int) -> None:
    joints = moving(101)
    held = np.concatenate([joints[:at], np.repeat(joints[at : at + 1], 7, axis=0), joints[at + 1 :]])
    assert held_ranges(held, 100) == [(at, at + 6)]
    assert held_ranges(joints, 100) == []


def test_a_body_that_comes_to_rest_is_not_held() -> None:
    rest = moving(200, 0.0)
    rest[:100, :, 2] += (np.linspace(1, 0, 101)[:-1] ** 3)[:, None]
    assert held_ranges(rest, 100) == []
    assert held_ranges(rest[::-1], 100) == []
    assert held_ranges(moving(50, 0.0), 100) == []


def test_a_slower_recording_whose_frames_come_several_times_is_left_alone() -> None:
    assert held_ranges(np.repeat(moving(50), 4, axis=0), 100) == []


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_short_recordings_have_no_holds(frames: int) -> None:
    assert held_ranges(moving(frames), 100) == []


@pytest.mark.recordings
def test_a_run_whose_recording_is_held_at_its_end_does_not_stop(recordings: Path) -> None:
    """Seen: hips went 3.2 m/s, and stood still in the next frame."""
    (clip,) = (run for run in read(CLASSES["run"]) if run.name.endswith("35_22"))
    assert sound_ranges(clip.positions, clip.rotations, clip.fps)[0] == (1, 157)
    made = MatchingGenerator(database_of([clip])).generate(
        [MotionRequest((clip.label,), 10.0, seed, seed_of(clips_of("run")[0])) for seed in range(3)]
    )
    for motion in made:
        ahead = np.linalg.norm(np.diff(motion.positions[:, 0, [0, 2]], axis=0), axis=1) * FPS
        assert ahead.min() > 0.5 * np.median(ahead)
