"""Half turns of joints about their bones: they are taken out, and no joint moves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motionlake.arrays import Float64Array
from motionlake.motion.flips import without_flips
from motionlake.motion.kinematics import forward_kinematics, local_rotations, world_rotations
from motionlake.motion.rotations import from_vectors, multiply
from motionlake.motion.skeleton import INDEX, PARENTS, TWIST_AXES

from bench.canonical_sets import LabelledSet, read


def body() -> Float64Array:
    """[21, 3] rest offsets: every bone along its axis, those of the trunk anywhere."""
    offsets = 0.1 * np.random.default_rng(0).normal(size=(21, 3))
    for joint, parent in enumerate(PARENTS):
        name = next((n for n, i in INDEX.items() if i == parent), "")
        if name in TWIST_AXES:
            offsets[joint] = 0.3 * np.array(TWIST_AXES[name])
    return offsets


def smooth(frames: int, seed: int) -> Float64Array:
    """[F, 21, 4] local rotations that change little from frame to frame."""
    rng = np.random.default_rng(seed)
    turns = 0.8 * rng.normal(size=(1, 21, 3)) + np.cumsum(0.03 * rng.normal(size=(frames, 21, 3)), axis=0)
    return np.asarray(from_vectors(turns))


def flipped(rotations: Float64Array, joint: str, frames: slice) -> Float64Array:
    """The same joints, by rotations of which one is turned by half about its bone; those below stay in the world."""
    world = world_rotations(rotations)
    own = np.ascontiguousarray(world[frames, INDEX[joint]])
    world[frames, INDEX[joint]] = multiply(own, from_vectors(np.pi * np.array(TWIST_AXES[joint])))
    return np.asarray(local_rotations(world))


@given(
    st.integers(0, 1000),
    st.lists(st.tuples(st.sampled_from(sorted(TWIST_AXES)), st.integers(1, 39), st.integers(1, 8)), max_size=3,
             unique_by=lambda flip: flip[0]),
)  # fmt: skip
def test_half_turns_are_taken_out(seed: int, flips: list[tuple[str, int, int]]) -> None:
    before = smooth(40, seed)
    rotations = before
    for joint, start, count in flips:
        rotations = flipped(rotations, joint, slice(start, start + count))
    found = without_flips(rotations)
    alike = np.abs((world_rotations(found) * world_rotations(before)).sum(axis=-1))
    np.testing.assert_allclose(alike, 1, atol=1e-9)
    root, offsets = np.zeros((40, 3)), body()
    np.testing.assert_allclose(
        forward_kinematics(root, found, offsets), forward_kinematics(root, rotations, offsets), atol=1e-9
    )
    if not flips:
        assert found is rotations


@pytest.mark.parametrize("most", [slice(0, 30), slice(10, 40)])
def test_of_two_sides_that_of_most_frames_is_taken(most: slice) -> None:
    rotations = flipped(smooth(40, 0), "left_hip", most)
    found, kept = (world_rotations(each)[:, INDEX["left_hip"]] for each in (without_flips(rotations), rotations))
    alike = np.zeros(40)
    alike[most] = 1
    np.testing.assert_allclose(np.abs((found * kept).sum(axis=-1)), alike, atol=1e-9)


@pytest.mark.recordings
def test_thighs_of_deep_squats_turn_no_more_by_half(recordings: Path) -> None:
    clips = read(LabelledSet("hdm05", "label", lambda row: "dg_squat1Reps" in row["file"]))
    turned = 0
    for clip in clips:
        rotations = clip.rotations.astype(float)
        found = without_flips(rotations)
        legs = [INDEX[f"{side}_{joint}"] for side in ("left", "right") for joint in ("hip", "knee")]
        apart, left = (np.abs((each[1:] * each[:-1]).sum(axis=-1))[:, legs].min() for each in (rotations, found))
        turned += apart < 0.1
        assert left > np.cos(np.pi / 8)
        root, offsets = clip.positions[:, 0].astype(float), clip.rest_offsets
        assert offsets is not None
        moved = forward_kinematics(root, found, offsets) - forward_kinematics(root, rotations, offsets)
        assert np.abs(moved).max() < 1e-9
    assert turned > 5
