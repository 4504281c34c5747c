"""The kernels of the default way to find, each against its definition."""

from __future__ import annotations

from itertools import pairwise
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import Float64Array
from motionlake.deep_motifs import word_sets
from motionlake.deep_motifs.end_to_end import Stretches, end_to_end, nearest_end_to_end
from motionlake.deep_motifs.query_by_example import bags_of
from motionlake.deep_motifs.word_sets import BLOCK, MOST, set_distances, set_matrix, spread
from motionlake.motion.diffusion import JOINED, RESTART
from motionlake.motion.moves import LEAST, Track
from motionlake.motion.moves_windows import TEMPI, distances_about, windows_distances
from motionlake.retrieval.fused_ranges import _least
from motionlake.retrieval.window_graph import along_windows


def naive_sets(one: np.ndarray, other: np.ndarray) -> float:
    between = np.linalg.norm(one[:, None].astype(float) - other[None].astype(float), axis=2)
    return float((between.min(axis=0).mean() + between.min(axis=1).mean()) / 2)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 999), st.integers(1, 6), st.integers(1, 9), st.integers(1, 6))
def test_runs_of_words_are_compared_as_sets(seed: int, words: int, count: int, length: int) -> None:
    rng = np.random.default_rng(seed)
    query, every = rng.normal(size=(words, 4)).astype(np.float32), rng.normal(size=(12, 4)).astype(np.float32)
    every[0] = query[0]
    runs = rng.integers(0, 12, (count, length))
    expected = [naive_sets(query, every[run]) for run in runs]
    np.testing.assert_allclose(set_distances(query, every, runs), expected, rtol=1e-4, atol=1e-5)
    matrix = [[naive_sets(every[one], every[other]) for other in runs] for one in runs]
    for block in (2, BLOCK):
        with mock.patch.object(word_sets, "BLOCK", block):
            np.testing.assert_allclose(set_matrix(every, runs), matrix, rtol=1e-4, atol=1e-5)
    assert (set_distances(every[runs[0]], every, runs[:1]) == 0).all()


@given(st.integers(1, 200))
def test_a_long_run_is_compared_by_words_all_over_it(count: int) -> None:
    chosen = spread(count).tolist()
    assert chosen[0] == 0
    assert chosen[-1] == count - 1
    assert len(chosen) == min(count, MOST)
    assert {b - a for a, b in pairwise(chosen)} <= {(count - 1) // (MOST - 1) + i for i in (-1, 0, 1)} or count <= MOST


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 99), st.integers(1, 5))
def test_bags_of_words(seed: int, words: int) -> None:
    rng = np.random.default_rng(seed)
    motifs = rng.integers(0, 5, 20).astype(np.int32)
    first, count = rng.integers(0, 15, 6), rng.integers(1, words + 1, 6)
    longest = int(count.max())
    expected = [
        [-1] * (longest - n) + sorted(motifs[a : a + n].tolist()) for a, n in zip(first, count.tolist(), strict=True)
    ]
    assert bags_of(motifs, first, count).tolist() == expected


def by_definition(
    windows: list[tuple[float, int, int, int]], lengths: list[int], barred: tuple[int, int, int] | None
) -> list[tuple[float, int, int, int]]:
    """Windows (distance, clip, start, stop), frame by frame."""
    owner: dict[tuple[int, int], int | None] = {}
    if barred:
        owner = {(barred[0], frame): None for frame in range(barred[1], barred[2])}
    answers: list[list[float]] = []
    for distance, clip, start, stop in sorted(windows, key=lambda w: (w[0], w[1], w[2])):
        frames = [(clip, frame) for frame in range(start, stop)]
        if not any(frame in owner for frame in frames):
            owner |= dict.fromkeys(frames, len(answers))
            answers.append([distance, clip, start, stop])
    more: list[list[float]] = []
    for clip, length in enumerate(lengths):
        free = [frame for frame in range(length) if (clip, frame) not in owner]
        starts = [frame for frame in free if frame - 1 not in free]
        for start in starts:
            stop = next(frame for frame in range(start, length + 1) if frame not in free)
            middle, widest = (start + stop) // 2, max((w[3] - w[2] for w in windows if w[1] == clip), default=0)
            over = [w[0] for w in windows if w[1] == clip and w[2] <= middle < w[3]]
            sides = [owner.get((clip, start - 1)), owner.get((clip, stop))]
            known = [(answers[side][0], -at, side, at) for at, side in enumerate(sides) if side is not None]
            if stop - start >= (widest + 3) // 4 and over:
                more.append([float(np.mean(over)), clip, start, stop])
            elif known:
                _, _, side, at = max(known)
                answers[side][3 - at] = stop if at == 0 else start
    return sorted((d, int(c), int(a), int(b)) for d, c, a, b in [*answers, *more])


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 9999), st.integers(1, 3), st.integers(1, 8), st.booleans())
def test_answers_lie_end_to_end(seed: int, clips: int, width: int, bar: bool) -> None:
    rng = np.random.default_rng(seed)
    lengths = rng.integers(1, 40, clips)
    barred = None
    if bar:
        start = int(rng.integers(0, lengths[0]))
        barred = (0, start, int(rng.integers(start, lengths[0])) + 1)
    windows = [
        (float(rng.integers(0, 6)) / 4, clip, start, min(start + width, length))
        for clip, length in enumerate(lengths.tolist())
        for start in range(0, max(1, length - width + 1), int(rng.integers(1, 4)))
        if not (barred and clip == 0 and start < barred[2] and min(start + width, length) > barred[1])
    ]
    columns = [np.array([window[i] for window in windows], dtype=np.int64) for i in (1, 2, 3)]
    asked = Stretches(columns[0], columns[1], columns[2], np.array([window[0] for window in windows]))
    found = end_to_end(asked, lengths, barred)
    rows = list(zip(*(v.tolist() for v in (found.distance, found.clip, found.start, found.stop)), strict=True))
    expected = by_definition(windows, lengths.tolist(), barred)
    assert [row[1:] for row in rows] == [row[1:] for row in expected]
    assert [row[0] for row in rows] == pytest.approx([row[0] for row in expected])
    for k in (1, 2, len(rows), 99):
        some = nearest_end_to_end(asked, lengths, k, barred)
        assert [v.tolist() for v in vars(some).values()] == [v[:k].tolist() for v in vars(found).values()]
    if windows and not barred:  # nothing is left out but clips without windows
        assert sum(stop - start for _, _, start, stop in rows) == lengths.sum()


def naive_graph(apart: Float64Array, near: Float64Array) -> Float64Array:
    count = len(near)
    k = min(JOINED, count - 1)
    weights = np.zeros((count, count))
    order = [sorted((j for j in range(count) if j != i), key=lambda j: apart[i, j])[:k] for i in range(count)]
    tenth = [max(apart[i, j] for j in order[i]) for i in range(count)]
    for i in range(count):
        for j in order[i]:
            weights[i, j] = weights[j, i] = np.exp(-(apart[i, j] ** 2) / (tenth[i] * tenth[j]))
    degrees = weights.sum(axis=1)
    start = np.where(near >= sorted(near)[-k], near, 0)
    spread = np.linalg.solve(np.eye(count) - (1 - RESTART) * weights / np.sqrt(np.outer(degrees, degrees)), start)
    return np.asarray(spread / spread.max())


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 999), st.integers(2, 40))
def test_near_along_the_graph_by_definition(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3))
    apart, near = np.linalg.norm(points[:, None] - points[None], axis=2), rng.uniform(0.1, 1, count)
    np.testing.assert_allclose(along_windows(apart, near), naive_graph(apart, near), atol=2e-3)


def test_a_chain_is_followed_and_what_is_apart_is_not() -> None:
    """Two rings of points: what lies on the query's ring is nearer along the graph, also where it is farther off."""
    turn = np.linspace(0, 2 * np.pi, 120, endpoint=False)
    ring = np.column_stack([np.cos(turn), np.sin(turn)])
    points = np.concatenate([ring, 1.8 * ring])
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    near = 1 / (1 + apart[0])
    assert near[60] < near[120]
    along = along_windows(np.where(apart > 0, apart, 0), near)
    assert along[:120].min() > along[120:].max()
    closed = np.full((3, 3), np.inf)
    assert along_windows(closed, np.array([0.5, 1.0, 0.2])).argmax() == 1
    assert along_windows(np.zeros((1, 1)), np.ones(1)).tolist() == [1.0]
    assert along_windows(np.zeros((0, 0)), np.zeros(0)).tolist() == []


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 99), st.integers(LEAST, 20), st.integers(LEAST, 30))
def test_windows_about_frames_are_of_every_tempo(seed: int, length: int, frames: int) -> None:
    steps = np.random.default_rng(seed).normal(size=(length + frames, 45))
    track = Track.of(np.cumsum(steps, axis=0) / 20)
    query, other = track.cut(0, length).turned().moves(), track.cut(length, length + frames)
    middles = np.arange(frames)
    expected = np.full(frames, np.inf)
    for tempo in TEMPI:
        width = min(frames, max(LEAST, round(length * tempo)))
        for middle in middles.tolist():
            start = min(max(middle - width // 2, 0), frames - width)
            expected[middle] = min(expected[middle], windows_distances(query, other, np.array([start]), width)[0])
    np.testing.assert_allclose(distances_about(query, other, middles), expected, atol=1e-4)


@given(st.lists(st.integers(0, 5), min_size=1, max_size=30), st.integers(1, 32))
def test_the_least_of_many(values: list[int], count: int) -> None:
    expected = np.sort(np.argsort(values, kind="stable")[:count])
    np.testing.assert_array_equal(_least(np.array(values, dtype=np.float64), count), expected)
