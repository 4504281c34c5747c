"""Retrieval across a split and the error after DTW, counted by hand and against loops."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from motionlake.evaluation.dtw import dtw_path, joint_error
from motionlake.evaluation.ranking import Questions, area, first_hits, leave_one_out, others, score_split
from motionlake.motion.dtw import clip_dtw, dtw_cross, dtw_matrix, squared_distances


def test_a_split_is_scored_by_hand() -> None:
    distances = np.array([[0.1, 0.2, 0.3, 0.4], [0.4, 0.3, 0.2, 0.1], [0.0, 0.0, 0.0, 0.0]])
    questions = Questions.of(["a", "a", "elsewhere"], ["a", "b", "a", "b"])
    found = score_split(distances, questions)
    assert found.n == 2  # no clip of the third query's class can be found
    assert found.top1 == 1 / 2
    assert found.top10 == pytest.approx(1 / 2)  # all four hits, two of them right
    first, second = (1 + 2 / 3) / 2, (1 / 2 + 2 / 4) / 2
    assert found.map == pytest.approx((first + second) / 2)
    assert found.pr_area == pytest.approx(area(found.curve))
    assert first_hits(distances, questions) == {0: 0, 1: 3}
    with pytest.raises(ValueError, match="nothing to retrieve"):
        score_split(distances, Questions.of(["x", "y", "z"], ["a", "b", "a", "b"]))
    with pytest.raises(ValueError, match="not fit"):
        score_split(distances[:2], questions)


def test_ten_hits_count_and_no_more() -> None:
    classes = ["a"] * 9 + ["b"] * 30 + ["a"] * 5
    found = score_split(np.arange(44.0)[None], Questions.of(["a"], classes))
    assert (found.top1, found.top10) == (1, 0.9)
    ties = score_split(np.zeros((1, 44)), Questions.of(["b"], classes))
    assert (ties.top1, ties.top10) == (0, 0.1)  # by index


def test_the_area_under_a_curve() -> None:
    assert area({"recall": [0.5, 1.0], "precision": [1.0, 1.0]}) == 1
    assert area({"recall": [0.5, 1.0], "precision": [1.0, 0.5]}) == pytest.approx(0.5 + 0.375)
    perfect = score_split(np.array([[0.0, 1.0, 2.0]]), Questions.of(["a"], ["a", "a", "b"]))
    assert perfect.pr_area == 1


@settings(max_examples=30, deadline=None)
@given(st.integers(3, 12), st.integers(1, 3), st.integers(0, 10_000))
def test_without_a_split_it_is_leave_one_out(n: int, classes: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    distances = random.integers(0, 5, (n, n)).astype(float)
    labels = ["x", "x", *(str(c) for c in random.integers(0, classes, n - 2))]
    expected = leave_one_out(distances, labels)
    questions = Questions.of(labels, labels, others(n))
    found = score_split(distances, questions)
    assert (found.map, found.top1, found.n) == pytest.approx((expected.map, expected.nn, expected.n))
    assert all(query != hit for query, hit in first_hits(distances, questions).items())


def naive_path(a: np.ndarray, b: np.ndarray) -> list[tuple[int, int]]:
    """Of equal steps the diagonal, then (1, 0), then (0, 1); roots have single precision, so that ties are the same."""
    cost = np.full((len(a) + 1, len(b) + 1), np.inf)
    cost[0, 0] = 0
    for i in range(len(a)):
        for j in range(len(b)):
            step = min(cost[i, j], cost[i, j + 1], cost[i + 1, j])
            cost[i + 1, j + 1] = step + np.sqrt(np.float32(((a[i] - b[j]) ** 2).sum()))
    i, j = len(a), len(b)
    found = []
    while i and j:
        found.append((i - 1, j - 1))
        before = [(cost[i - 1, j - 1], i - 1, j - 1), (cost[i - 1, j], i - 1, j), (cost[i, j - 1], i, j - 1)]
        _, i, j = min(before, key=lambda step: step[0])
    return found[::-1]


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 9), st.integers(1, 9), st.integers(1, 3), st.integers(1, 3), st.integers(0, 10_000))
@example(3, 5, 1, 3, 117)
def test_the_path_and_the_error_along_it(n: int, m: int, joints: int, values: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    # Few whole numbers: their squares are exact, and there are ties.
    a, b = (random.integers(0, values, (length, 3 * joints)).astype(np.float32) for length in (n, m))
    path = naive_path(a.astype(float), b.astype(float))
    assert dtw_path(a, b).tolist() == [list(step) for step in path]
    apart = [np.linalg.norm(a[i, 3 * k : 3 * k + 3] - b[j, 3 * k : 3 * k + 3]) for i, j in path for k in range(joints)]
    assert joint_error(a, b) == pytest.approx(np.mean(apart), abs=1e-6)
    along = sum(float(np.sqrt(squared_distances(a, b)[i, j])) for i, j in path)
    assert clip_dtw(a, b) == pytest.approx(along / (n + m), abs=1e-4)  # the baseline's own path
    assert joint_error(a, np.repeat(a, 2, axis=0)) == 0  # half the speed


def test_clips_without_frames_are_refused() -> None:
    clip = np.zeros((3, 6), dtype=np.float32)
    for call in (lambda: joint_error(clip, clip[:0]), lambda: dtw_cross([clip], [clip[:0]])):
        with pytest.raises(ValueError, match="without frames"):
            call()


def test_dtw_across_two_sets_is_a_part_of_dtw_of_all() -> None:
    random = np.random.default_rng(0)
    clips = [random.standard_normal((n, 6)).astype(np.float32) for n in (5, 12, 8, 1)]
    np.testing.assert_allclose(dtw_cross(clips[:2], clips[2:]), dtw_matrix(clips)[:2, 2:], rtol=1e-6)
