"""Which windows of a track are looked at for a piece of motion, and how alignments of many clips are stacked."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import Float32Array
from motionlake.motion import moves_index, stacks
from motionlake.motion.moves import Track
from motionlake.motion.moves_index import MovesIndex, floored, moves_distance
from motionlake.motion.moves_windows import Place, distances_about, nearest_place, nearest_places, windows_distances
from motionlake.motion.stacks import Stack, aligned

from tests.test_moves import wandering


def naive_window(query: Float32Array, track: Track, start: int, width: int) -> float:
    return moves_distance(query, track.cut(start, start + width).moves())


def lengths(length: int, factors: tuple[float, ...], frames: int) -> list[int]:
    return sorted({width for f in factors if (width := max(4, round(length * f))) <= frames})


def naive_place(
    distance: Callable[[int, int], float], length: int, frames: int, barred: tuple[int, int] | None
) -> Place | None:
    """As the docstring of `nearest_place` has it, window by window; `distance` of the window of a start and width."""
    step = max(1, length // 6)

    def nearest(windows: set[tuple[int, int]]) -> Place | None:
        free = (w for w in windows if barred is None or sum(w) <= barred[0] or w[0] >= barred[1])
        return min((Place(distance(s, w), s, s + w) for s, w in free), default=None)

    coarse = {
        (s, w)
        for w in lengths(length, (0.75, 1.0, 4 / 3), frames)
        for s in [*range(0, frames - w + 1, step), frames - w]
    }
    best = nearest(coarse)
    while best is not None:
        _, start, stop = best
        widths = lengths(stop - start, (0.87, 0.93, 1.0, 1.07, 1.15), frames)
        windows = {
            (s, w)
            for w in widths
            for s in range(max(0, (start + stop - w) // 2 - step), min(frames - w, (start + stop - w) // 2 + step) + 1)
        }
        finer = min(place for place in (best, nearest(windows)) if place is not None)
        if finer == best or finer.stop - finer.start not in (widths[0], widths[-1]):
            return finer
        best = finer
    return None


barriers = st.none() | st.tuples(st.integers(0, 50), st.integers(0, 50))


def tracks(seed: int, frames: int, kind: str) -> Track:
    """One that wanders, one that comes back to the same places again and again, or one that stands still."""
    if kind == "wandering":
        return wandering(seed, frames)
    joints = np.random.default_rng(seed).normal(size=(1 if kind == "still" else 7, 45))
    return Track.of(np.resize(joints, (frames, 45)))


kinds = st.sampled_from(["wandering", "repeating", "still"])


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 9999), st.integers(4, 40), st.integers(3, 60), barriers, kinds)
def test_windows_are_looked_at_as_written(
    seed: int, length: int, frames: int, between: tuple[int, int] | None, kind: str
) -> None:
    """Of windows that are equally near, of which a track that repeats has many, the first one counts."""
    barred = (min(between), max(between) + 1) if between else None
    query, track = wandering(seed, length).moves(), tracks(seed + 1, frames, kind)

    def distance(start: int, width: int) -> float:
        return float(windows_distances(query, track, np.array([start]), width)[0])

    assert nearest_place(query, track, barred) == naive_place(distance, length, frames, barred)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 9999), st.integers(4, 40), st.lists(st.tuples(st.integers(1, 60), kinds, barriers), max_size=12))
def test_places_in_many_clips_are_those_in_each(
    seed: int, length: int, asked: list[tuple[int, str, tuple[int, int] | None]]
) -> None:
    query = wandering(seed, length).moves()
    joints = [tracks(seed + i, frames, kind).joints.astype(np.float32) for i, (frames, kind, _) in enumerate(asked)]
    barred = [(min(between), max(between) + 1) if between else None for _, _, between in asked]
    alone = [nearest_place(query, Track.of(each), none) for each, none in zip(joints, barred, strict=True)]
    for threads in (1, 3):
        together = nearest_places(query, joints, barred, threads)
        assert [place is None for place in together] == [place is None for place in alone]
        for one, other in zip(together, alone, strict=True):
            if one is not None and other is not None:
                assert one.distance == pytest.approx(other.distance, rel=1e-4, abs=1e-4)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 999), st.integers(4, 16), st.integers(3, 40), barriers)
def test_the_nearest_place_is_that_of_windows_one_by_one(
    seed: int, length: int, frames: int, between: tuple[int, int] | None
) -> None:
    query, track = wandering(seed, length).moves(), wandering(seed + 1, frames)
    barred = (min(between), max(between) + 1) if between else None
    expected = naive_place(lambda start, width: naive_window(query, track, start, width), length, frames, barred)
    found = nearest_place(query, track, barred)
    assert (found is None) == (expected is None)
    if found is None or expected is None:
        return
    assert found.distance == pytest.approx(expected.distance, rel=2e-3)
    assert (found.start, found.stop) == (expected.start, expected.stop)


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 99), st.integers(4, 24), st.integers(1, 45), st.lists(st.integers(-9, 60), min_size=1, max_size=9)
)
def test_about_a_frame_the_nearest_of_three_tempi_counts(seed: int, length: int, more: int, middles: list[int]) -> None:
    frames = 3 + more
    query, track = wandering(seed, length).moves(), wandering(seed + 1, frames)
    expected = []
    for middle in middles:
        widths = [min(frames, max(4, round(length * tempo))) for tempo in (0.75, 1.0, 4 / 3)]
        starts = [min(max(0, middle - width // 2), frames - width) for width in widths]
        expected.append(min(naive_window(query, track, s, w) for s, w in zip(starts, widths, strict=True)))
    np.testing.assert_allclose(distances_about(query, track, np.array(middles)), expected, rtol=2e-3, atol=3e-3)


def test_what_stands_still_is_a_window_like_any() -> None:
    """Where nothing moves, neither displacement nor velocity is blown up."""
    still = Track.of(np.tile(np.random.default_rng(0).normal(size=45), (20, 1)))
    query = wandering(0, 8).moves()
    starts = np.arange(12)
    expected = [naive_window(query, still, start, 8) for start in starts.tolist()]
    np.testing.assert_allclose(windows_distances(query, still, starts, 8), expected, rtol=1e-3)


def test_a_long_query_is_refused() -> None:
    track = wandering(0, 200)
    assert nearest_place(np.zeros((160, 135), dtype=np.float32), track) is not None
    long = np.zeros((161, 135), dtype=np.float32)
    with pytest.raises(ValueError, match="at most 160"):
        nearest_place(long, track)
    with pytest.raises(ValueError, match="at most 160"):
        nearest_places(long, [track.joints.astype(np.float32)], [None])


@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(1, 12), max_size=40), st.integers(1, 9), st.integers(0, 99))
def test_clips_of_about_one_length_stand_side_by_side(sizes: list[int], width: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    clips = [rng.normal(size=(size, width)).astype(np.float32) for size in sizes]
    stack = Stack.of(clips)
    order = sorted(range(len(clips)), key=lambda clip: len(clips[clip]))
    groups = [order[i : i + 8] for i in range(0, len(order), 8)]
    assert stack.clips.tolist() == [[*group, *[-1] * (8 - len(group))] for group in groups]
    assert stack.lengths.tolist() == [[*(sizes[c] for c in group), *[0] * (8 - len(group))] for group in groups]
    longest = [max(sizes[clip] for clip in group) for group in groups]
    assert stack.starts.tolist() == [8 * sum(longest[:i]) for i in range(len(groups) + 1)]
    for group, first in zip(groups, stack.starts, strict=False):
        for lane, clip in enumerate(group):
            for frame in range(sizes[clip]):
                row = stack.frames[first + 8 * frame + lane]
                np.testing.assert_array_equal(row[:-2], clips[clip][frame])
                assert row[-2:] == pytest.approx([1, clips[clip][frame] @ clips[clip][frame]], rel=1e-5)
    assert stack.spread(stack.clips.astype(np.float64)).tolist() == list(range(len(clips)))


@pytest.mark.parametrize("cells", [1, 700, 1_500, 1 << 20])
def test_alignments_are_the_same_however_many_at_a_time(cells: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stacks, "_CELLS", cells)
    clips = [wandering(seed, 4 + seed % 13).moves() for seed in range(41)]
    found = Stack.of(clips).spread(aligned(clips[3], Stack.of(clips)))
    np.testing.assert_allclose(found, [moves_distance(clips[3], clip) for clip in clips], rtol=1e-4, atol=2e-3)


def test_memory_for_alignments_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """As many groups at a time as have so many pairs of frames, one at least, and no fewer."""
    sizes: list[int] = []
    align = stacks._align

    def seen(costs: Float32Array, *rest: Any) -> None:
        sizes.append(costs.size)
        align(costs, *rest)

    monkeypatch.setattr(stacks, "_align", seen)
    monkeypatch.setattr(stacks, "few", lambda cells: False)
    clips = [np.zeros((10, 4), dtype=np.float32)] * 80
    for cells, at_a_time in ((1, 1), (3 * 80 * 5 - 1, 2), (3 * 80 * 5, 3), (10**9, 10)):
        sizes.clear()
        monkeypatch.setattr(stacks, "_CELLS", cells)
        aligned(clips[0][:5], Stack.of(clips))
        assert sizes[0] == at_a_time * 80 * 5
        assert sum(sizes) == 10 * 80 * 5


@pytest.mark.parametrize("count", [1, 3, 30])
def test_bounds_are_distances_in_the_directions_in_which_frames_differ_most(count: int) -> None:
    clips = [wandering(i, 4 + i).moves() for i in range(count)]
    index, query = MovesIndex(clips), wandering(50, 9).moves()
    bounds = index._bounds_from(query)
    assert (bounds <= [moves_distance(query, clip) for clip in clips]).all()
    projected = [index._projected(clip) for clip in (query, *clips)]
    expected = [0.9999 * moves_distance(projected[0], clip) for clip in projected[1:]]
    np.testing.assert_allclose(bounds, expected, rtol=1e-5)
    every, inside = np.concatenate(clips), np.concatenate(projected[1:])
    assert inside.shape == (len(every), 33)
    np.testing.assert_allclose(np.linalg.norm(inside, axis=1), np.linalg.norm(every, axis=1), rtol=1e-4)
    held = np.square(np.linalg.svd(every.astype(np.float64), compute_uv=False)[:32]).sum()
    assert np.square(inside[:, :32].astype(np.float64)).sum() == pytest.approx(held, rel=1e-4)


def test_directions_are_fitted_to_so_many_frames_evenly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(moves_index, "_SAMPLE", 20)
    clips = [wandering(seed, 25).moves() for seed in range(4)]
    some = np.concatenate(clips)[::5].astype(np.float64)
    held = np.square(np.linalg.svd(some, compute_uv=False)[:32]).sum()
    inside = some @ MovesIndex(clips)._directions
    assert np.square(inside).sum() == pytest.approx(held, rel=1e-4)


def test_distances_that_are_rounding_are_zero() -> None:
    clip = wandering(0, 30).moves()
    assert moves_distance(clip, clip) == 0
    assert floored(np.array([0.0, 0.001, 0.0011, -0.5, 3.0])).tolist() == [0, 0, 0.0011, 0, 3.0]
    other = clip.copy()
    other[:, 0] += 0.01
    assert moves_distance(clip, other) == pytest.approx(0.005, rel=0.1)
