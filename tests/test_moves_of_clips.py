"""The moves of many clips at once are those of one after the other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motionlake.motion.moves import MOST, Track
from motionlake.motion.moves_of_clips import instants_of_clips, moves_of_clips
from motionlake.motion.sketches import instants
from motionlake.stages import moves as stage


def wandering(seed: int, frames: int) -> np.ndarray:
    """[frames, 45] joints of a body that moves; of seed 0 of one that stands still."""
    steps = np.random.default_rng(seed).normal(size=(frames, 45)) * bool(seed)
    return (np.linspace(0.1, 1, 45) + 0.1 * np.cumsum(steps, axis=0)).astype(np.float32)


@given(
    st.lists(st.tuples(st.integers(0, 99), st.integers(1, 30) | st.integers(MOST - 2, MOST + 90)), max_size=5),
    st.integers(1, 16),
)
def test_moves_and_instants_are_those_of_each_clip(clips: Sequence[tuple[int, int]], count: int) -> None:
    joints = [wandering(*each) for each in clips]
    starts = np.concatenate([[0], np.cumsum([len(each) for each in joints])]).astype(np.int64)
    moves, first = moves_of_clips(np.concatenate([np.zeros((0, 45), np.float32), *joints]), starts)
    found = instants_of_clips(moves, first, count)
    assert found.shape == (len(clips), count, 135)
    for at, own in enumerate(joints):
        expected = Track.of(own).moves()
        np.testing.assert_allclose(moves[first[at] : first[at + 1]], expected, rtol=1e-5, atol=1e-5)
        np.testing.assert_allclose(found[at], instants(expected, count), rtol=1e-4, atol=1e-4)


def test_a_clip_that_nothing_tells_the_facing_of() -> None:
    joints = np.zeros((6, 45), dtype=np.float32)
    moves, _ = moves_of_clips(joints, np.array([0, 6]))
    assert moves == pytest.approx(Track.of(joints).moves())


@pytest.mark.parametrize("lengths", [(3,), (1200, 2, 3), (1, 2, 1200), (40, 1, 7, 30, 22)])
def test_moves_of_many_clips_are_those_of_each(lengths: tuple[int, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    """Whichever thread works them out."""
    joints = {f"c{seed}": wandering(seed, frames) for seed, frames in enumerate(lengths, 1)}
    names = list(joints)[::-1]
    alone = [Track.of(joints[name]).moves() for name in names]
    monkeypatch.setattr(stage, "MANY", 0)
    many = stage.Tracks(joints).moves(names)
    assert [len(moves) for moves in many] == [len(moves) for moves in alone]
    for one, other in zip(many, alone, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-5, atol=1e-5)
    assert stage.Tracks(joints).moves([]) == []
