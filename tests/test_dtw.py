"""Word distances against naive dynamic time warping."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from motionlake.arrays import Float32Array, Float64Array
from motionlake.deep_motifs.words.dtw import LANES, word_distances
from motionlake.motion import dtw
from motionlake.motion.dtw import (
    Metric,
    clip_dtw,
    clip_dtws,
    clip_path,
    dtw_cross,
    dtw_matrix,
    frame_distances,
    nearest_stretch,
    squared_distances,
)


def naive_frame_distance(a: Float32Array, b: Float32Array, metric: Metric) -> float:
    x, y = a.astype(np.float64), b.astype(np.float64)
    if metric == "euclidean":
        return float(np.sum((x - y) ** 2))
    dots = np.abs(np.sum(x.reshape(-1, 4) * y.reshape(-1, 4), axis=1))
    return float(np.sum(np.arccos(np.minimum(dots, 1.0)) ** 2))


def naive_align(frames: Float32Array, average: bool) -> float:
    """Ties come from the diagonal, then from above, then from the left."""
    best: dict[tuple[int, ...], tuple[Any, int]] = {(-1, -1): (np.float32(0), 0)}
    nowhere = (np.float32(np.inf), 0)
    for i, j in np.ndindex(*frames.shape):
        before = [best.get(cell, nowhere) for cell in ((i - 1, j - 1), (i - 1, j), (i, j - 1))]
        cost, steps = min(before, key=lambda found: found[0])
        best[i, j] = (cost + frames[i, j], steps + 1)
    cost, steps = best[frames.shape[0] - 1, frames.shape[1] - 1]
    return float(cost / steps) if average else float(cost)


def random_words(n: int, length: int, width: int, metric: Metric, seed: int) -> Float32Array:
    words = np.random.default_rng(seed).standard_normal((n, length, width))
    if metric == "geodesic":
        quaternions = words.reshape(n, length, -1, 4)
        words = (quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True)).reshape(words.shape)
    return words.astype(np.float32)


@pytest.mark.parametrize("metric", ["euclidean", "geodesic"])
def test_frame_distances_match_their_definition(metric: Metric) -> None:
    a, b = random_words(1, 40, 64, metric, 1)[0], random_words(1, 70, 64, metric, 2)[0]
    b[:3] = a[:3]
    b[3] = -a[3]
    expected = np.array([[naive_frame_distance(x, y, metric) for y in b] for x in a])
    np.testing.assert_allclose(frame_distances(a, b, metric), expected, rtol=2e-6, atol=5e-5)
    assert frame_distances(a, b, metric).min() >= 0


def test_a_quaternion_and_its_negative_are_one_rotation() -> None:
    a = random_words(1, 16, 64, "geodesic", 3)
    np.testing.assert_allclose(word_distances(a, -a, "geodesic"), 0, atol=1e-5)


@pytest.mark.parametrize("average", [True, False])
@pytest.mark.parametrize("metric", ["euclidean", "geodesic"])
@pytest.mark.parametrize(("n", "m", "length_a", "length_b"), [(3, LANES + 5, 16, 16), (19, 2, 5, 9), (1, 1, 1, 4)])
def test_word_distances_match_naive(
    n: int, m: int, length_a: int, length_b: int, metric: Metric, average: bool
) -> None:
    a, b = random_words(n, length_a, 12, metric, 4), random_words(m, length_b, 12, metric, 5)
    expected = np.array([[naive_align(frame_distances(x, y, metric), average) for y in b] for x in a])
    np.testing.assert_allclose(word_distances(a, b, metric, average=average), expected, rtol=1e-5, atol=1e-5)


small_words = arrays(np.float32, (2, 6, 2), elements=st.integers(-2, 2).map(float))


@settings(max_examples=60, deadline=None)
@given(small_words, small_words)
def test_ties_come_from_the_diagonal_then_above_then_left(a: Float32Array, b: Float32Array) -> None:
    # a and its negative average to the origin: centring keeps small integers exact, hence ties exact
    a = np.concatenate([a, -a])
    frames = np.sum((a[:, None, :, None] - b[None, :, None, :]) ** 2, axis=-1)
    expected = [[naive_align(between, True) for between in row] for row in frames]
    np.testing.assert_array_equal(word_distances(a, b), np.array(expected, dtype=np.float32))


def test_averaging_divides_by_the_length_of_the_path() -> None:
    a = np.array([[[0], [0], [1]]], dtype=np.float32)
    b = np.array([[[1], [3], [3]]], dtype=np.float32)
    # 0-1, 0-1, 1-1, 1-3, 1-3 costs as much as 0-1, 0-1, 1-3, 1-3, whose last but one step is diagonal
    assert word_distances(a, b, average=False).item() == pytest.approx(10)
    assert word_distances(a, b).item() == pytest.approx(10 / 4)


def test_a_time_warped_word_is_close() -> None:
    time = np.linspace(0, 1, 16)
    curve: Callable[[Float64Array], Float64Array] = lambda t: np.column_stack([np.sin(6 * t), np.cos(6 * t)])  # noqa: E731
    word, warped = curve(time)[None].astype(np.float32), curve(time**1.4)[None].astype(np.float32)
    plain = np.mean(np.sum((word - warped) ** 2, axis=2))
    assert word_distances(word, warped).item() < 0.2 * plain
    assert word_distances(word, word).item() == pytest.approx(0, abs=1e-6)


def test_shapes_that_do_not_fit_are_refused() -> None:
    words = random_words(2, 16, 8, "euclidean", 8)
    with pytest.raises(ValueError, match="cannot be compared"):
        word_distances(words, words[:, :, :4])
    with pytest.raises(ValueError, match="no whole number of quaternions"):
        word_distances(words[:, :, :6], words[:, :, :6], "geodesic")
    assert word_distances(words[:0], words).shape == (0, 2)


whole_numbers = st.integers(1, 7).flatmap(
    lambda n: arrays(np.float32, (n, 2), elements=st.sampled_from([0.0, 0.0, 0.25, 0.5, 3.0]))
)


@settings(max_examples=150, deadline=None)
@given(whole_numbers, whole_numbers)
def test_a_path_prefers_the_diagonal_then_the_first_clip(a: Float32Array, b: Float32Array) -> None:
    """Read from the end; frames that are the same or hardly apart give many equal paths."""
    costs = np.sqrt(np.maximum(squared_distances(a, b), 0)).astype(np.float64)
    best = np.full((len(a) + 1, len(b) + 1), np.inf)
    best[0, 0] = 0
    for i, j in np.ndindex(*costs.shape):
        best[i + 1, j + 1] = costs[i, j] + min(best[i, j], best[i, j + 1], best[i + 1, j])
    i, j = costs.shape
    path = []
    while i and j:
        path.append([i - 1, j - 1])
        steps = [(i - 1, j - 1), (i - 1, j), (i, j - 1)]
        i, j = min(steps, key=lambda step: best[step])
    assert clip_path(a, b).tolist() == path[::-1]
    assert clip_dtw(a, b) == pytest.approx(best[-1, -1] / (len(a) + len(b)), abs=1e-4)
    found = np.array([dtw_cross([a, b], [b, a, b]), dtw_matrix([a, b, b])[[0, 1]][:, [1, 0, 2]]])
    straight, own = clip_dtw(a, b), [clip_dtw(a, a), clip_dtw(b, b)]
    np.testing.assert_allclose(found[0], [[straight, own[0], straight], [own[1], straight, own[1]]], atol=1e-6)
    np.testing.assert_allclose(found[1], [[straight, 0, straight], [0, straight, own[1]]], atol=1e-6)


@pytest.mark.parametrize("away", [0.0, 1000.0])
def test_frames_far_from_the_origin_are_told_apart(away: float) -> None:
    a, b = (random_words(1, 9, 5, "euclidean", seed)[0] + np.float32(away) for seed in (1, 2))
    expected = np.array([[naive_frame_distance(x, y, "euclidean") for y in b] for x in a])
    np.testing.assert_allclose(frame_distances(a, b), expected, rtol=1e-3, atol=1e-3)
    assert frame_distances(a[:0], b).shape == (0, 9)


def test_edges_of_a_query_are_left_out_as_far_as_three_frames_stay() -> None:
    sequence = np.arange(20, dtype=np.float32)[:, None]
    for length, edge, left in [(5, 1, 1), (5, 2, 1), (6, 9, 1), (7, 9, 2), (9, 2, 2), (4, 3, 0), (3, 1, 0), (9, 0, 0)]:
        query = sequence[8 : 8 + length].copy()
        query[:left] = query[length - left :] = 50
        found = nearest_stretch(query, sequence, edge)
        assert (found.start, found.stop) == (8, 8 + length)
        assert found.cost == pytest.approx(0, abs=1e-3)
        if edge > left:  # one frame more is not left out
            query[left] = 50
            assert nearest_stretch(query, sequence, edge).cost > 1
    first = nearest_stretch(np.ones((2, 1), dtype=np.float32), np.ones((6, 1), dtype=np.float32))
    assert first.stop == 1


def test_a_query_is_aligned_with_many_clips_some_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(4)
    query, *clips = (random.normal(size=(n, 3)).astype(np.float32) for n in (6, 9, 1, 4, 12, 7))
    monkeypatch.setattr(dtw, "_CELLS", 2 * 6 * 12)  # two clips
    expected = [clip_dtw(query, clip) for clip in clips]
    for plainly in (True, False):
        monkeypatch.setattr(dtw, "few", lambda cells, plainly=plainly: plainly)
        np.testing.assert_allclose(clip_dtws(query, clips), expected, rtol=1e-5)
