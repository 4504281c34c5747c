"""Moves of clips: what they do not tell, their alignment against a naive one, and the nearest clips and ranges."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from motionlake.arrays import Float32Array, Float64Array
from motionlake.deephums.sequence import clip_sequence
from motionlake.motion import stacks
from motionlake.motion.dtw import clip_dtw, clip_dtws
from motionlake.motion.moves import DISPLACEMENT_COUNT, FPS, JOINTS_COUNT, LEAST, MOST, WIDTH, Track, at_12
from motionlake.motion.moves_index import MovesIndex, moves_distance, moves_distances, sampled
from motionlake.motion.moves_windows import nearest_place, windows_distances
from motionlake.motion.stacks import Halves, Stack, aligned, aligned_halves


def walking(frames: int) -> Float64Array:
    """[N, 45] two steps: legs and arms swing against each other while all moves ahead."""
    phase = np.linspace(0, 2 * np.pi, frames)[:, None]
    swing = np.sin(phase + np.arange(15) % 2 * np.pi) * np.linspace(0.1, 0.6, 15)
    return np.stack([0 * swing, 0 * swing, swing + phase / 5], axis=-1).reshape(frames, 45)


def naive(one: Float32Array, other: Float32Array) -> float:
    """Sum of Euclidean distances along the cheapest path of ordinary steps, over the frames of both."""
    n, m = len(one), len(other)
    cost = np.full((n + 1, m + 1), np.inf)
    cost[0, 0] = 0
    for i in range(n):
        for j in range(m):
            apart = np.linalg.norm(one[i].astype(float) - other[j].astype(float))
            cost[i + 1, j + 1] = apart + min(cost[i, j], cost[i, j + 1], cost[i + 1, j])
    return float(cost[n, m] / (n + m))


def wandering(seed: int, frames: int) -> Track:
    """Fifteen joints that wander about."""
    steps = np.random.default_rng(seed).normal(size=(frames, 45))
    return Track.of(np.cumsum(steps, axis=0) / 20)


clips = st.builds(lambda seed, frames: wandering(seed, frames).moves(), st.integers(0, 99), st.integers(LEAST, 30))


@given(clips, st.lists(clips, max_size=20))
def test_many_are_aligned_as_one_by_one(query: Float32Array, others: list[Float32Array]) -> None:
    stack = Stack.of(others)
    found = stack.spread(aligned(query, stack))
    np.testing.assert_allclose(found, [naive(query, other) for other in others], rtol=1e-4, atol=2e-3)
    np.testing.assert_allclose(found, [moves_distance(query, other) for other in others], rtol=1e-4, atol=2e-3)


halves = st.floats(-1000, 1000, width=16)


@given(st.lists(st.lists(halves, min_size=5, max_size=5), min_size=1, max_size=40), st.integers(1, 9), st.data())
def test_clips_in_half_precision_are_aligned_alike(rows: list[list[float]], frames: int, data: st.DataObject) -> None:
    """Wherever they lie, some of their frames and columns alone; the smallest numbers and zeros below zero, too."""
    held = np.array(rows, dtype=np.float16)
    pieces, every = [held, held[::-1].copy()], data.draw(st.integers(1, 5))
    first = data.draw(st.integers(0, 4))
    columns = slice(first, data.draw(st.integers(first + 1, 5)))
    place = st.integers(0, len(held) - 1).flatmap(
        lambda at: st.tuples(st.integers(0, 1), st.just(at), st.integers(1, len(held) - at))
    )
    places = np.array(data.draw(st.lists(place, max_size=20)), dtype=np.int64).reshape(-1, 3)
    query = np.resize(held, (frames, 5)).astype(np.float32)[:, columns]
    found = aligned_halves(query, Halves(pieces, *places.T), every, columns)
    some = [pieces[piece][start : start + count : every, columns] for piece, start, count in places]
    np.testing.assert_allclose(found, clip_dtws(query, [clip.astype(np.float32) for clip in some]), rtol=1e-3, atol=2.0)
    if some:
        stack = Stack.of(some)
        np.testing.assert_allclose(found, stack.spread(aligned(query, stack)), rtol=1e-4, atol=0.1)


def test_clips_of_many_groups_are_aligned_as_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(9)
    held = rng.normal(size=(3000, 6)).astype(np.float16)
    counts = rng.integers(1, 60, 90)
    starts = rng.integers(0, len(held) - 60, 90)
    query = rng.normal(size=(7, 6)).astype(np.float32)
    clips = [held[start : start + count].astype(np.float32) for start, count in zip(starts, counts, strict=True)]
    wanted = [clip_dtw(query, clip) for clip in clips]
    for most in (1, 500, 10**6):
        monkeypatch.setattr(stacks, "_ROWS", most)
        found = aligned_halves(query, Halves([held], np.zeros_like(starts), starts, counts))
        np.testing.assert_allclose(found, wanted, rtol=1e-5)


def test_a_clip_without_frames_is_not_aligned() -> None:
    some = Halves([np.zeros((3, 2), dtype=np.float16)], *np.array([[0, 0], [0, 1], [1, 0]]))
    with pytest.raises(ValueError, match="without frames"):
        aligned_halves(np.ones((2, 2), np.float32), some)


@given(st.lists(clips, max_size=20), st.integers(1, 60))
def test_frames_are_sampled_as_of_one_array(some: list[Float32Array], about: int) -> None:
    whole = np.concatenate([*some, np.zeros((0, WIDTH), dtype=np.float32)])
    np.testing.assert_array_equal(sampled(some, about), whole[:: max(1, len(whole) // about)])


@given(clips, st.lists(clips, max_size=30), st.integers(0, 12))
def test_the_nearest_are_those_of_a_scan(query: Float32Array, others: list[Float32Array], k: int) -> None:
    found = MovesIndex(others).nearest(query, k)
    every = np.array([moves_distance(query, other) for other in others])
    order = np.lexsort((np.arange(len(others)), every))[:k]
    assert found.indices.tolist() == order.tolist()
    assert found.distances.tolist() == every[order].tolist()


@given(clips, st.lists(clips, min_size=1, max_size=11), st.integers(0, 14), st.data())
def test_the_nearest_among_some_are_those_of_an_index_of_these(
    query: Float32Array, others: list[Float32Array], k: int, data: st.DataObject
) -> None:
    some = np.array(sorted(data.draw(st.sets(st.integers(0, len(others) - 1)))), dtype=np.int64)
    found = MovesIndex(others).nearest(query, k, some)
    alone = MovesIndex([others[row] for row in some.tolist()]).nearest(query, k) if len(some) else None
    assert found.indices.tolist() == (some[alone.indices].tolist() if alone else [])
    assert found.distances.tolist() == (alone.distances.tolist() if alone else [])


def test_most_clips_of_a_set_need_no_alignment(recordings: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from motionlake.motion import moves_index

    from bench.canonical_sets import load

    tracks = [track_of(clip.positions, clip.fps) for clip in load("hdm05")]
    known = [track.moves() for track in tracks]
    index, count = MovesIndex(known), [0]

    def counted(query: Float32Array, clips: Sequence[Float32Array]) -> Float64Array:
        count[0] += len(clips)
        return moves_distances(query, clips)

    monkeypatch.setattr(moves_index, "moves_distances", counted)
    for query in known[::10]:
        every = np.array([moves_distance(query, other) for other in known])
        found = index.nearest(query, 10)
        assert found.distances.tolist() == sorted(every)[:10]
    assert count[0] < 0.15 * len(known) * len(known[::10])


def test_a_clip_without_frames_cannot_be_aligned() -> None:
    with pytest.raises(ValueError, match="without frames"):
        Stack.of([np.zeros((0, WIDTH), dtype=np.float32)])


def track_of(positions: Float64Array, fps: float) -> Track:
    return Track.of(at_12(clip_sequence(positions, fps)))


@given(st.floats(0.3, 3), st.floats(-3, 3), st.integers(0, 99))
def test_displacement_and_velocity_tell_neither_size_nor_posture_and_moves_no_facing(
    size: float, angle: float, seed: int
) -> None:
    track = wandering(seed, 25)
    body = np.random.default_rng(seed).normal(size=45)
    ahead = Track(track.joints, track.velocity, np.tile([1.0, 0.0], (25, 1)))
    other = Track(track.joints * size + body, track.velocity * size, ahead.facing)
    np.testing.assert_allclose(other.moves()[:, :90], ahead.moves()[:, :90], atol=1e-4)
    np.testing.assert_allclose(other.moves()[:, 93:], ahead.moves()[:, 93:] * size + JOINTS_COUNT * body[3:], atol=1e-4)
    np.testing.assert_allclose(other.moves()[:, 90:93], ahead.moves()[:, 90:93] * size, atol=1e-4)
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])
    turned = Track.of((track.joints.reshape(-1, 15, 3) @ turn).reshape(-1, 45))
    np.testing.assert_allclose(turned.moves(), track.turned().moves(), atol=1e-4)


def test_velocity_counts_more_than_displacement_and_both_alike_in_every_clip() -> None:
    displacement, velocity = np.split(wandering(3, 40).moves()[:, :90], 2, axis=1)
    roots = [float(np.sqrt((part.astype(float) ** 2).sum(axis=1).mean())) for part in (displacement, velocity)]
    np.testing.assert_allclose(roots, [DISPLACEMENT_COUNT, 1.0], rtol=1e-5)
    assert DISPLACEMENT_COUNT < 1


def test_what_stands_still_or_is_long_has_moves() -> None:
    still = Track.of(np.ones((LEAST, 45))).moves()
    assert not still[:, :93].any()
    np.testing.assert_allclose(still[:, 93:], JOINTS_COUNT)
    assert Track.of(np.ones((1, 45))).moves().shape == (1, WIDTH)
    assert wandering(0, MOST + 77).moves().shape == (MOST, WIDTH)
    assert len(at_12(np.zeros((1, 15, 3)))) == LEAST
    assert len(at_12(np.zeros((300, 15, 3)))) == 10 * FPS


@given(st.integers(0, 99), st.integers(LEAST, 20), st.integers(LEAST, 20), st.integers(0, 30))
def test_windows_have_moves_of_their_own(seed: int, length: int, width: int, more: int) -> None:
    query, track = wandering(seed + 1, length).moves(), wandering(seed, width + more)
    starts = np.arange(more + 1)
    found = windows_distances(query, track, starts, width)
    expected = [naive(query, track.cut(start, start + width).moves()) for start in starts.tolist()]
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=3e-3)


@given(st.integers(0, 99), st.integers(LEAST, 40), st.integers(0, 60), st.integers(0, 60))
@example(9, 37, 40, 2)  # the nearest window at first is a third too long
def test_a_piece_is_found_where_it_was_cut_out(seed: int, length: int, before: int, after: int) -> None:
    track = wandering(seed, before + length + after)
    piece = track.cut(before, before + length).moves()
    found = nearest_place(piece, track)
    assert found is not None
    assert found.distance <= 0.1
    assert abs(found.start - before) <= max(1, length // 6)
    elsewhere = nearest_place(piece, track, (before, before + length))
    if elsewhere is not None:
        assert elsewhere.stop <= before or elsewhere.start >= before + length
        assert elsewhere.distance >= found.distance


def test_a_walk_is_nearer_to_a_walk_than_to_wandering() -> None:
    slow, quick = (Track.of(walking(frames)) for frames in (40, 32))
    away = min(moves_distance(slow.moves(), wandering(seed, 36).moves()) for seed in range(20))
    assert moves_distance(slow.moves(), quick.moves()) < away / 3
