"""What the comparators of `bench.comparators` compute, beside naive ways to compute it."""

from __future__ import annotations

from itertools import combinations, pairwise, permutations, product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motionlake.arrays import Float64Array

from bench.canonical_sets import LabelledSet, read
from bench.comparators import keys, manifold, relational, retrieval, templates, volumes
from bench.comparators.aligned_clusters import aca, alignments, frame_kernel, haca, resegmented
from bench.comparators.seen import AT, WORDS, Seen, seen
from bench.comparators.segmentation import Unit, chosen_by_others, matched

SIZES = st.integers(1, 5)
STANDING = {
    "neck": (0.0, 0.4, 0.0), "head": (0.0, 0.55, 0.0),
    "left_shoulder": (0.15, 0.38, 0.0), "left_elbow": (0.17, 0.18, 0.0), "left_wrist": (0.18, 0.0, 0.02),
    "left_hip": (0.08, 0.0, 0.0), "left_knee": (0.08, -0.3, 0.0), "left_ankle": (0.08, -0.6, 0.0),
}  # fmt: skip


def body(frames: int = 12, **moved: tuple[float, float, float]) -> Seen:
    """A body that stands still but for the joints that are named, which do so elsewhere."""
    rows = np.zeros((frames, WORDS.dimension), dtype=np.float32)
    for name, (x, y, z) in STANDING.items():
        for mine, side in ((name, 1.0), (name.replace("left", "right"), -1.0)):
            place = (side * x, y, z)
            rows[:, 3 * AT[mine] : 3 * AT[mine] + 3] = moved.get(mine, place)
    return Seen(rows)


def bits(rng: np.random.Generator, frames: int, features: int = 6) -> np.ndarray:
    return rng.random((frames, features)) < 0.5


@given(st.lists(st.floats(0, 3), min_size=1, max_size=12))
def test_a_feature_lasts_from_the_strong_to_the_weak_threshold(values: list[float]) -> None:
    found, on = [], False
    for value in values:
        if value > 2:
            on = True
        elif value < 1:
            on = False
        found.append(on)
    assert relational.begun(np.array(values), 2.0, 1.0).tolist() == found


def test_relations_change_where_a_joint_is_moved() -> None:
    still = relational.relational(body())
    assert still.shape == (12, relational.COUNT)
    raised = relational.relational(body(left_wrist=(0.2, 0.7, 0.0)))
    lifted = relational.relational(body(right_ankle=(-0.08, -0.2, 0.2), right_knee=(-0.08, -0.2, 0.3)))
    above, apart = 1, 2 * 6 + 2  # of the left hand above the neck; of the first feature of legs
    assert not still[:, above].any()
    assert raised[:, above].all()
    assert (still == raised)[:, apart : apart + 12].all()
    assert not lifted[:, apart + 1].any()
    assert lifted[:, apart + 5].all()


def naive(costs: Float64Array) -> float:
    """The least sum of a path from the first to the last cell, over all of them."""
    n, m = costs.shape
    if n == 1 and m == 1:
        return float(costs[0, 0])
    before = [costs[: n - i, : m - j] for i, j in ((1, 1), (1, 0), (0, 1)) if n > i and m > j]
    return float(costs[-1, -1]) + min(naive(each) for each in before)


@given(SIZES, SIZES, st.integers(0, 100))
def test_paths_cost_the_least(n: int, m: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = bits(rng, n), bits(rng, m)
    costs = templates.differences(a.astype(float), b.astype(float)).astype(np.float64)
    assert costs == pytest.approx((a[:, None] != b[None]).sum(axis=2))
    path = templates.warping(costs.astype(np.float32))
    assert costs[path[:, 0], path[:, 1]].sum() == pytest.approx(naive(costs))
    assert path[[0, -1]].tolist() == [[0, 0], [n - 1, m - 1]]
    assert all(tuple(step) in ((1, 1), (1, 0), (0, 1)) for step in np.diff(path, axis=0))
    apart = templates.apart(relational.packed(a), relational.packed(b), 6)
    assert apart == pytest.approx(naive(costs) / 6 / (n + m))


@given(SIZES, SIZES, st.integers(0, 100))
def test_a_template_costs_what_the_best_piece_of_a_clip_does(n: int, m: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix, clip = rng.choice([0.0, 0.5, 1.0], (n, 6)), bits(rng, m)
    counts = matrix != 0.5
    wrong = ((matrix[:, None] >= 0.5) != clip[None]) & counts[:, None]
    costs = wrong.sum(axis=2) / np.maximum(counts.sum(axis=1), 1)[:, None]
    best = min(naive(costs[:, start:stop]) for start in range(m) for stop in range(start + 1, m + 1)) / n
    template = templates.Template.of(matrix)
    assert templates.fit(template.values, template.counts, relational.packed(clip)) == pytest.approx(best)


def test_a_template_is_what_clips_have_in_common_at_any_speed() -> None:
    steps = np.eye(5, dtype=bool)
    slow, uneven = np.repeat(steps, 2, axis=0), np.repeat(steps, [1, 3, 1, 1, 4], axis=0)
    found = templates.learned([slow, uneven, np.repeat(steps, 2, axis=0)])
    whole = found.counts == 0b11111  # between two steps a column may be of both, which is masked
    assert whole.sum() >= 5
    assert np.unique(found.values[whole]).tolist() == np.unique(relational.packed(steps)).tolist()
    assert (np.diff(found.values.astype(np.int64)) >= 0).all()
    with_own = [np.column_stack([slow, np.full(len(slow), mark)]) for mark in (True, False, True)]
    masked = templates.learned(with_own)
    assert (masked.counts == 0b11111).all(), "a feature that differs from clip to clip counts"


def test_columns_are_merged_and_stretched_to_weigh_the_same() -> None:
    columns = np.array([[0.0], [1.0], [4.0]])
    assert templates.evened(columns, np.array([0.5, 0.5, 2.0])).ravel().tolist() == [0.5, 4.0, 4.0]


def test_no_clip_is_judged_by_what_it_taught() -> None:
    up, down = np.ones((4, 3), dtype=bool), np.zeros((4, 3), dtype=bool)
    classes, costs = templates.fits([up, down, up, up], ["a", "a", "b", "b"])
    assert classes == ["a", "b"]
    assert costs[:, 0].tolist() == [1.0, 1.0, 0.0, 0.0]  # of "a" each has the other; both together mask all
    assert costs[:, 1].tolist() == [0.0, 1.0, 0.0, 0.0]


def test_a_volume_is_taken_apart_into_what_it_is_the_sum_of() -> None:
    times, joints = np.linalg.qr(np.random.default_rng(0).normal(size=(8, 3)))[0].T, np.eye(5)[:3]
    weights = np.array([3.0, 2.0, 1.0])
    tensor = np.einsum("r,ri,rj,rk->ijk", weights, times, times, joints)
    found = volumes.taken_apart(tensor, 3)
    assert found.weights == pytest.approx(weights)
    assert np.abs((found.times * times).sum(axis=1)) == pytest.approx(np.ones(3))
    assert found.joints == pytest.approx(joints, abs=1e-6)


@pytest.mark.parametrize("warped", [False, True])
def test_volumes_are_the_same_however_a_body_is_turned(warped: bool) -> None:
    rng = np.random.default_rng(1)
    rows = rng.normal(size=(20, WORDS.dimension)).cumsum(axis=0).astype(np.float32)
    turned = rows.copy()
    turned[:, : WORDS.posture] = (rows[:, : WORDS.posture].reshape(-1, 3)[:, [2, 1, 0]] * [1, 1, -1]).reshape(20, -1)
    other = rng.normal(size=(30, WORDS.dimension)).cumsum(axis=0).astype(np.float32)
    found = volumes.distances([Seen(rows), Seen(turned), Seen(other)], warped=warped)
    assert found[0, 1] == pytest.approx(0.0, abs=1e-6)
    assert found[0, 2] > 0.01
    assert found == pytest.approx(found.T)


def test_short_values_of_a_key_are_those_before() -> None:
    assert keys.runs(np.array([0, 0, 0, 1, 0, 0, 2, 2, 2, 1])) == (0, 2)
    assert keys.runs(np.array([1])) == (1,)
    assert keys.counted((0, 1, 0)).sum() == 3 + 2 + 1
    assert keys.counted((0, 1, 0))[keys.SEQUENCES.index((0,))] == 2
    assert all(a != b for run in keys.SEQUENCES for a, b in pairwise(run))


def test_clips_with_the_same_keys_are_nearest() -> None:
    rng = np.random.default_rng(2)
    clips = [Seen(rng.normal(size=(40, WORDS.dimension)).cumsum(axis=0).astype(np.float32)) for _ in range(3)]
    found = keys.distances([*clips, clips[0]])
    assert np.diag(found) == pytest.approx(0, abs=1e-9)
    assert found == pytest.approx(found.T)
    assert found[0].argsort(kind="stable")[:2].tolist() == [0, 3]


@pytest.mark.parametrize("frames", [1, 63, 64, 65, 100])
def test_windows_of_the_manifold_hold_every_frame(frames: int) -> None:
    rows = np.arange(frames, dtype=np.float32)[:, None]
    found = manifold.windows(rows)
    assert found.shape[1:] == (1, manifold.LENGTH)
    assert set(found.ravel().tolist()) == set(range(frames))


def path_value(kernel: Float64Array, lengths: Float64Array, a: range, b: range) -> float:
    """The dynamic time alignment kernel by recursion."""

    def best(i: int, j: int) -> float:
        value = kernel[a[i], b[j]]
        both, mine, its = lengths[a[i]] + lengths[b[j]], lengths[a[i]], lengths[b[j]]
        options = []
        if i == 0 and j == 0:
            options.append(both * value)
        if i and j:
            options.append(best(i - 1, j - 1) + both * value)
        if i:
            options.append(best(i - 1, j) + mine * value)
        if j:
            options.append(best(i, j - 1) + its * value)
        return float(max(options))

    return best(len(a) - 1, len(b) - 1) / float(lengths[list(a)].sum() + lengths[list(b)].sum())


@given(st.integers(0, 200))
def test_segments_are_alike_by_their_best_path(seed: int) -> None:
    rng = np.random.default_rng(seed)
    lengths = rng.integers(1, 4, 7).astype(float)
    kernel = frame_kernel(rng.normal(size=(7, 2)), 0.5)
    found = alignments(kernel, lengths, np.array([0, 2, 5, 7]))
    spans = [range(2), range(2, 5), range(5, 7)]
    for i, j in combinations(range(3), 2):
        assert found[i, j] == found[j, i] == pytest.approx(path_value(kernel, lengths, spans[i], spans[j]))


@given(st.integers(0, 200))
def test_borders_are_the_best_of_all(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, most = 6, 3
    lengths, kernel = np.ones(n), frame_kernel(rng.normal(size=(n, 2)), 0.5)
    borders, labels = np.array([0, 2, 4, 6]), np.array([0, 1, 0])
    alike = alignments(kernel, lengths, borders)
    scatter = np.array([alike[np.ix_([0, 2], [0, 2])].mean(), 1.0])
    spans = [range(a, b) for a, b in pairwise(borders.tolist())]

    def cost(span: range, c: int) -> float:
        own = [path_value(kernel, lengths, span, spans[s]) for s in np.flatnonzero(labels == c)]
        return float(1 - 2 * np.mean(own) + scatter[c])

    every = []
    for cuts in product([False, True], repeat=n - 1):
        edges = [0, *(i + 1 for i, cut in enumerate(cuts) if cut), n]
        if max(b - a for a, b in pairwise(edges)) <= most:
            every.append(sum(min(cost(range(a, b), c) for c in (0, 1)) for a, b in pairwise(edges)))
    found = resegmented(kernel, lengths, borders, labels, scatter, most)
    assert found[2] == pytest.approx(min(every))
    again = [cost(range(a, b), c) for (a, b), c in zip(pairwise(found[0].tolist()), found[1], strict=True)]
    assert sum(again) == pytest.approx(found[2])


@pytest.mark.parametrize("method", [aca, haca])
def test_two_movements_in_turn_are_two_clusters(method: object) -> None:
    t = np.arange(160)
    truth = t // 40 % 2
    waves = np.where(truth == 0, np.sin(t / 2), 3 + np.sin(t / 4))
    rows = np.column_stack([waves, np.where(truth == 0, np.cos(t / 2), np.cos(t / 4))])
    assert callable(method)
    groups = method(rows, 2, 20, 0.1, 0)
    assert matched(groups, [str(each) for each in truth]) > 0.95


@given(st.integers(0, 200))
def test_groups_are_given_classes_in_the_best_way(seed: int) -> None:
    rng = np.random.default_rng(seed)
    groups, truth = rng.integers(0, 3, 12), rng.integers(0, 4, 12)
    names = np.array(["", "a", "b", "c"])[truth]
    if not (truth > 0).any():
        return
    best = max(
        sum(int(((groups == g) & (names == name)).sum()) for g, name in enumerate(order))
        for order in permutations(["a", "b", "c"])
    )
    assert matched(groups, names.tolist()) == pytest.approx(best / (truth > 0).sum())


def test_constants_are_those_that_other_takes_choose() -> None:
    def unit(take: str, most: int) -> Unit:
        return (f"set/clips/{take}.amc", "ACA", most, 0.1, 0)

    shares = {unit("a", 24): 0.9, unit("a", 48): 0.5, unit("b", 24): 0.6, unit("b", 48): 0.7}
    found = chosen_by_others(shares)["ACA"]
    assert (found["a"]["most"], found["a"]["matched"]) == (48, 0.5)
    assert (found["b"]["most"], found["b"]["matched"]) == (24, 0.6)
    assert (found["a"]["least"], found["a"]["best"]) == (0.5, 0.9)


@pytest.mark.recordings
def test_each_method_tells_kicks_from_jogs(recordings: Path) -> None:
    left = {"kickLFront1Reps": 4, "jogLeftCircle4StepsRstart": 4}

    def few(row: dict[str, str]) -> bool:
        left[row["label"]] = left.get(row["label"], 0) - 1
        return left[row["label"]] >= 0

    clips = seen(read(LabelledSet("hdm05", "label", few)))
    assert len(clips) == 8
    same = np.array([[a.label == b.label for b in clips] for a in clips])
    for method, (distances, _) in retrieval.METHODS.items():
        for row, (found, _) in distances(clips, 0).items():
            np.fill_diagonal(found, np.inf)
            nearest = found.argmin(axis=1)
            assert same[np.arange(8), nearest].mean() >= 0.75, (method, row)
