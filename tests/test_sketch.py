"""Sketches of clips against naive ones, instants that keep pace with what moves, and directions that are learned."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from motionlake.arrays import Float32Array, Float64Array
from motionlake.deephums.batches import mirrored, resampled
from motionlake.deephums.sketch import BREADTH, COUNTS, FRAMES, INSTANTS, NUMBERS, Sketch, sketches
from motionlake.motion.skeleton import COMMON

WIDE = {"left_hip": 0.1, "right_hip": -0.1, "left_shoulder": 0.2, "right_shoulder": -0.2}


def wandering(seed: int, frames: int = FRAMES) -> Float32Array:
    """[T, 15, 3] joints that wander about a body facing +z."""
    rng = np.random.default_rng(seed)
    body = rng.normal(size=(15, 3)) / 2
    for name, x in WIDE.items():
        body[COMMON.index(name)] = (x, 0, 0)
    return np.asarray(body + np.cumsum(rng.normal(size=(frames, 15, 3)) / 100, axis=0), dtype=np.float32)


def naive(clip: Float64Array) -> Float64Array:
    """Sketch of one clip [48, 15, 3], number by number as the docstrings have it."""
    facing = np.zeros(2)
    for frame in clip:
        across = np.zeros(3)
        for joint in ("hip", "shoulder"):
            apart = frame[COMMON.index(f"left_{joint}")] - frame[COMMON.index(f"right_{joint}")]
            across += apart / np.linalg.norm(apart)
        facing += np.array([across[0], -across[2]]) / np.hypot(across[0], across[2])
    angle = np.arctan2(facing[1], facing[0])
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    turned = clip @ turn
    moved = turned - (turned[0] + turned[1] + turned[-2] + turned[-1]) / 4
    speed = np.gradient(turned, axis=0)
    parts = [part / np.sqrt((part**2).sum(axis=(1, 2)).mean()) for part in (moved, speed)]
    frames = np.concatenate([c * p.reshape(FRAMES, -1) for c, p in zip(COUNTS, [*parts, turned], strict=True)], axis=1)
    apart = np.concatenate([np.maximum(frames, 0), np.maximum(-frames, 0)], axis=1)
    found = np.zeros((INSTANTS, apart.shape[1]))
    reach = int(4 * BREADTH + 0.5)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / BREADTH) ** 2)
    for instant in range(INSTANTS):
        for step, weight in zip(range(-reach, reach + 1), weights / weights.sum(), strict=True):
            found[instant] += weight * apart[min(max(3 * instant + 1 + step, 0), FRAMES - 1)]
    return np.asarray(found.ravel() / np.linalg.norm(found))


@given(st.integers(0, 99), st.floats(-3, 3))
def test_sketches_are_as_they_are_defined_wherever_a_body_faces(seed: int, angle: float) -> None:
    clip = wandering(seed)
    found = sketches(torch.from_numpy(clip)[None])[0].numpy()
    assert found.shape == (NUMBERS,)
    np.testing.assert_allclose(found, naive(clip.astype(float)), atol=1e-5)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]], np.float32)
    np.testing.assert_allclose(sketches(torch.from_numpy(clip @ turn)[None])[0].numpy(), found, atol=1e-4)


def test_what_stands_still_has_a_sketch() -> None:
    assert torch.isfinite(sketches(torch.zeros(2, FRAMES, 15, 3))).all()
    assert torch.isfinite(sketches(torch.ones(2, FRAMES, 15, 3))).all()


def test_directions_keep_what_tells_clips_apart() -> None:
    clips = torch.from_numpy(np.stack([wandering(seed) for seed in range(20)]))
    sketch = Sketch(32)
    sketch.learn(clips)
    whole, kept = sketches(clips), sketch(clips)
    torch.testing.assert_close(kept @ kept.T, whole @ whole.T, atol=1e-4, rtol=0)
    assert not sketch.directions[20:].any()
    few = Sketch(3)
    few.learn(clips)
    torch.testing.assert_close(few.directions, sketch.directions[:3])


@given(st.integers(0, 99), st.integers(3, 60), st.integers(1, 60), st.floats(0, 1))
def test_instants_go_from_the_first_frame_to_the_last(seed: int, frames: int, count: int, paced: float) -> None:
    ramp = np.arange(frames, dtype=np.float32)[:, None, None] * np.ones((15, 3), dtype=np.float32)
    clip = wandering(seed, frames)
    clip[:, 1] = ramp[:, 1]
    found = resampled(clip, count, paced)[:, 1, 0]
    assert found[0] == 0
    assert count == 1 or found[-1] == pytest.approx(frames - 1, rel=1e-5)
    assert (np.diff(found) >= -1e-4).all()


def test_a_pause_does_not_count_for_instants_that_keep_pace() -> None:
    phase = np.linspace(0, 2 * np.pi, 61, dtype=np.float32)
    moves = np.sin(phase)[:, None, None] * np.linspace(0, 1, 45, dtype=np.float32).reshape(15, 3)
    paused = np.concatenate([moves[:30], np.repeat(moves[30:31], 60, axis=0), moves[30:]])
    even, kept = (np.abs(resampled(paused, 48, paced) - resampled(moves, 48, paced)).max() for paced in (0.0, 1.0))
    assert kept < even / 5
    still = np.ones((40, 15, 3), dtype=np.float32)
    np.testing.assert_array_equal(resampled(still, 48, 1.0), resampled(still, 48))


@given(st.integers(0, 99))
def test_mirrored_twice_is_the_same(seed: int) -> None:
    clip = wandering(seed)
    assert not np.array_equal(mirrored(clip), clip)
    np.testing.assert_array_equal(mirrored(mirrored(clip)), clip)
