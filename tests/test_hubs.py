"""Hubs: what it costs to begin in recordings that are near to most poses."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import Float64Array, Int64Array
from motionlake.matching.course import GIVEN, Part, Start
from motionlake.matching.database import MotionDatabase
from motionlake.matching.hubs import (
    CHANCE,
    DRAWS,
    PULL,
    apart_from_recordings,
    asked_frames,
    balanced,
    costs_of_beginning,
)
from motionlake.matching.player import Player

from bench.canonical_sets import LabelledClip
from bench.made.splits import parted
from bench.matching_clips import database_of, offsets_of

BOWS = "bandai1 bow"  # of fifteen manners


@cache
def bows() -> MotionDatabase:
    return database_of(clips_of_bows(0))


def clips_of_bows(side: int) -> list[LabelledClip]:
    """Those of the other folds (0), and those of the first (1)."""
    return [clip for clip in parted("bandai1", 0)[side] if clip.label == BOWS]


def shares(apart: Float64Array, costs: Float64Array, owners: Int64Array) -> Float64Array:
    """How often each recording is drawn, naively: frame by frame."""
    found = np.zeros(len(costs))
    for row in apart:
        chances = np.array([np.exp(-(row[c] + costs[owners[c]] - row.min()) / CHANCE) for c in range(len(row))])
        for c, chance in enumerate(chances / chances.sum()):
            found[owners[c]] += chance
    return found


@settings(max_examples=60)
@given(st.integers(2, 12), st.integers(1, 20), st.booleans(), st.integers(0, 10_000))
def test_recordings_are_drawn_more_nearly_alike(count: int, asked: int, mirrored: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    owners = np.tile(np.arange(count), 2 if mirrored else 1)
    apart = rng.uniform(0, 3, (asked, len(owners))) + rng.uniform(0, 2, count)[owners]
    if count > 2:
        apart[np.arange(asked), rng.integers(len(owners), size=asked)] = np.inf
    costs = balanced(apart, owners)
    assert costs.mean() == pytest.approx(0, abs=1e-9)
    usual = sum(np.bincount(owners, np.isfinite(row) / np.isfinite(row).sum(), count) for row in apart)

    def uneven(costs: Float64Array) -> float:
        return float(np.std(np.log((shares(apart, costs, owners) + DRAWS) / (usual + DRAWS))))

    assert uneven(costs) <= uneven(np.zeros(count)) + 1e-9
    # What the iteration is to come to: the cost is that of how often a recording is still drawn.
    wanted = PULL * np.log((shares(apart, costs, owners) + DRAWS) / (usual + DRAWS))
    np.testing.assert_allclose(costs, wanted - wanted.mean(), atol=0.01)


def test_a_hub_costs_and_what_is_far_from_all_is_cheaper() -> None:
    apart = np.ones((20, 5))
    apart[:, 0], apart[:, 4] = 0.2, 2.5
    costs = balanced(apart, np.arange(5))
    assert costs.argmax() == 0
    assert costs.argmin() == 4
    assert costs[1] == pytest.approx(costs[2]) == pytest.approx(costs[3])
    np.testing.assert_allclose(balanced(np.ones((20, 5)), np.arange(5)), 0, atol=1e-9)


@pytest.mark.recordings
def test_one_clip_is_not_drawn_beside_itself(recordings: Path) -> None:
    clip = clips_of_bows(0)[0]
    np.testing.assert_array_equal(database_of([clip]).begins, 0)
    cuts = [slice(0, 60), slice(20, 70), slice(40, 100)]
    pieces = [replace(clip, positions=clip.positions[cut], rotations=clip.rotations[cut]) for cut in cuts]
    np.testing.assert_array_equal(database_of(pieces).begins, 0)
    others = [replace(piece, name=f"{i}") for i, piece in enumerate(pieces)]
    assert np.ptp(database_of(others).begins) > 0


@pytest.mark.recordings
def test_recordings_are_as_far_as_a_naive_search_says(recordings: Path) -> None:
    data = bows()
    apart, frames = apart_from_recordings(data, 0), asked_frames(data, 0)
    columns = np.unique(data.recordings[data.rows[0]])
    assert apart.shape == (len(frames), len(columns))
    ending, scales = data.is_action(0), data.pose_scales
    for q in (0, len(frames) // 2):
        frame = int(frames[q])
        own, left = int(data.piece_of[frame]), float(data.left[frame])
        before = data.compared[max(frame - 3, data.pieces[own, 0])]
        for c, recording in enumerate(columns):
            piece = int(recording) % len(data.pieces)
            nearest = np.inf
            for at in range(*data.pieces[piece, :2]):
                row = at + (len(data) if recording != piece else 0)
                earlier = row - 3 if at - 3 >= data.pieces[piece, 0] else row
                cost = float(np.linalg.norm((data.compared[row] - data.compared[frame]) * scales))
                cost += 0.5 * float(np.linalg.norm((data.compared[earlier] - before) * scales))
                cost += data.tolerance * abs(float(data.aloft[at] - data.aloft[frame]))
                landing = float(data.landing[at])
                if landing > 0 and data.aloft[frame] + landing > data.longest_flight(0):
                    cost += 8 * data.tolerance
                remains, rest = float(data.left[at]), min(left, 30.0)
                cost += 3 * data.tolerance * max(0.0, 1 - remains / max(rest, 1.0)) ** 2
                if ending and left >= np.median(np.diff(data.pieces[:, :2])) / 2:
                    cost += 4 * data.tolerance * min(abs(remains - left) / 30, 1.0)
                if remains >= min(4, rest):
                    nearest = min(nearest, cost)
            wanted = np.inf if piece == own else nearest / data.tolerance
            assert apart[q, c] == pytest.approx(wanted, rel=1e-4)


@pytest.mark.recordings
def test_the_same_frames_get_the_same_costs(recordings: Path) -> None:
    data = bows()
    np.testing.assert_array_equal(data.begins, costs_of_beginning(data))
    assert data.begins.mean() == pytest.approx(0, abs=1e-9)
    assert np.ptp(data.begins) > 0.2
    bigger = [replace(c, positions=c.positions * 100, rest_offsets=offsets_of(c) * 100) for c in clips_of_bows(0)]
    np.testing.assert_allclose(database_of(bigger).begins, data.begins, atol=0.05)  # nothing is told in metres


def begun(data: MotionDatabase, temperature: float = 1.0, style: Float64Array | None = None) -> list[int]:
    """Pieces that motions of bows begin in, that go on from clips left out."""
    found = []
    given = database_of(clips_of_bows(1))
    for first, stop, *_ in given.pieces:
        at = int(first) + GIVEN
        start = Start(given.features[at], 0.0, np.zeros(3), np.zeros(2), 0.0, given.features[at - 3])
        for seed in range(30):
            rng = np.random.default_rng(seed)
            player = Player(data, [Part(0, 0)], int(stop) - at, rng, temperature=temperature, style=style)
            found.append(int(data.piece_of[int(player.run(start).at[0])]))
    return found


@pytest.mark.recordings
def test_motions_begin_in_more_recordings_alike(recordings: Path) -> None:
    data = bows()
    without = replace(data, begins=np.zeros(len(data.pieces)))

    def most(found: list[int]) -> float:
        counts = np.sort(np.bincount(found, minlength=len(data.pieces)))[::-1]
        return float(counts[:2].sum() / counts.sum())

    assert most(begun(data)) < most(begun(without)) - 0.05
    assert begun(data, temperature=0.0) == begun(without, temperature=0.0)  # the likeliest motion is the nearest
    manner = np.zeros(2 * len(data))
    assert begun(data, style=manner) == begun(without, style=manner)  # what is asked for comes first
