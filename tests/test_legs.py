"""Legs of made motion: knees keep to their side, heels are raised about toes that stay, and knees do not snap."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import BoolArray, Float64Array
from motionlake.matching.generator import MatchingGenerator
from motionlake.matching.legs import SMOOTH, STRETCH, bring_foot
from motionlake.motion.generation import FPS, MotionRequest
from motionlake.motion.two_bones import REACH

from bench.made.splits import parted
from bench.matching_clips import database_of, seed_of

AHEAD = np.array([0.0, 0.0, 1.0])
FOOT = np.array([0.0, -0.05, 0.15])
FRAMES = 40


def leg(bend: Float64Array) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Hip, knee and ankle [T, 3] of a leg of two bones of .4 m below the origin whose knee is so far ahead [T]."""
    down = np.sqrt(0.4**2 - bend**2)
    zero = np.zeros_like(bend)
    knee = np.stack([zero, -down, bend], axis=1)
    return np.zeros((len(bend), 3)), knee, knee + np.stack([zero, -down, -bend], axis=1)


def led(
    at: tuple[Float64Array, Float64Array, Float64Array], wanted: Float64Array, flat: BoolArray
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Knee, ankle and toes [T, 3] afterwards."""
    count = len(wanted)
    world = np.zeros((count, 21, 4))
    world[..., 0] = 1
    hip, knee, ankle = at
    bring_foot(world, (1, 2, 3), at, wanted, np.tile(FOOT, (count, 1)), flat, np.tile(AHEAD, (count, 1)))
    bones = [knee - hip, ankle - knee, np.tile(FOOT, (count, 1))]
    turned = [bone + 2 * np.cross(q[:, 1:], np.cross(q[:, 1:], bone) + q[:, :1] * bone)
              for bone, q in zip(bones, np.moveaxis(world[:, 1:4], 1, 0), strict=True)]  # fmt: skip
    places = hip + np.cumsum(turned, axis=0)
    return places[0], places[1], places[2]


def test_the_knee_of_a_leg_that_was_straight_for_some_frames_bends_as_before_and_after() -> None:
    """Seen of walks: it was recorded bent a little backwards, and bent backwards or aside to lift the foot."""
    bend = 0.1 * np.abs(np.linspace(-1, 1, FRAMES))
    bend[18:22] = -0.005
    at = leg(bend)
    wanted = at[2] + [0.0, 0.04, 0.0]
    knee, ankle, _ = led(at, wanted, np.ones(FRAMES, dtype=bool))
    np.testing.assert_allclose(ankle, wanted, atol=1e-9)
    assert knee[:, 2].min() > 0.05
    assert np.abs(knee[:, 0]).max() < 1e-9
    assert np.abs(np.diff(knee[:, 2], n=2)).max() < 0.01


@settings(max_examples=50, deadline=None)
@given(st.floats(0.03, 0.2), st.floats(-0.2, 0.2), st.floats(-0.1, 0.1), st.booleans())
def test_a_heel_is_raised_about_its_toes_where_the_leg_would_be_stretched(
    bend: float, ahead: float, down: float, flat: bool
) -> None:
    at = leg(np.full(FRAMES, bend))
    wanted = at[2] + [0.0, -down, ahead]
    knee, ankle, toes = led(at, wanted, np.full(FRAMES, flat))
    own = float(np.linalg.norm(at[2][0]))
    longest = max(REACH * 0.8, own)
    reach = own + (1.0 if flat else STRETCH) * (longest - own)
    length, asked = np.linalg.norm(ankle, axis=1), float(np.linalg.norm(wanted[0]))
    np.testing.assert_allclose(np.linalg.norm(knee, axis=1), 0.4)
    np.testing.assert_allclose(np.linalg.norm(toes - ankle, axis=1), np.linalg.norm(FOOT))
    if asked <= reach:
        np.testing.assert_allclose(ankle, wanted, atol=1e-9)
    else:
        np.testing.assert_allclose(length, reach, atol=1e-9)
    if np.linalg.norm(wanted[0] + FOOT) < reach + np.linalg.norm(FOOT):
        np.testing.assert_allclose(toes, wanted + FOOT, atol=1e-9)


def test_a_foot_that_leaves_the_ground_lets_its_heel_rise_by_and_by() -> None:
    at = leg(np.full(FRAMES, 0.15))
    wanted = np.tile([0.0, -0.78, 0.0], (FRAMES, 1))
    flat = np.arange(FRAMES) < FRAMES // 2
    _, ankle, _ = led(at, wanted, flat)
    lengths = np.linalg.norm(ankle, axis=1)
    assert np.ptp(lengths) > 0.005
    assert np.abs(np.diff(lengths)).max() < np.ptp(lengths) / SMOOTH


@pytest.mark.recordings
def test_knees_snap_no_more_than_recorded(recordings: Path) -> None:
    """Seen of walks sideways: half of them had a knee that went off faster than any recorded joint."""
    known, unseen = ([clip for clip in some if clip.label == "bandai1 walk-right"] for some in parted("bandai1", 0))
    requests = [MotionRequest(("bandai1 walk-right",), 6.0, 0, seed_of(clip)) for clip in unseen]
    made = MatchingGenerator(database_of(known)).generate(requests)
    fastest = max(_acceleration(clip.positions, clip.fps) for clip in known)
    assert max(_acceleration(motion.positions, FPS) for motion in made) < 1.1 * fastest


def _acceleration(positions: Float64Array, fps: float) -> float:
    """Metres a square second, the greatest of any joint."""
    frames = positions[:: round(fps / FPS)].astype(float)
    return float(np.linalg.norm(np.diff(frames, n=2, axis=0), axis=2).max() * FPS**2)
