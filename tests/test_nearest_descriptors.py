"""The k nearest descriptors: ways to the answer of a naive scan."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from motionlake.arrays import Float32Array
from motionlake.deephums.exact import FEW, ExactScan, Neighbours
from motionlake.deephums.nearest import DescriptorScan, QuickIndex
from motionlake.deephums.scans import QUERIES, SOME, PatientScan, scan_of

Search = Callable[[Float32Array, Float32Array, int], Neighbours]


def by_scan(rows: Float32Array, query: Float32Array, k: int) -> Neighbours:
    return DescriptorScan(rows).nearest(query, k)


def exactly(rows: Float32Array, query: Float32Array, k: int) -> Neighbours:
    return ExactScan(rows).nearest(query, k)


def by_quick_index(rows: Float32Array, query: Float32Array, k: int) -> Neighbours:
    return QuickIndex.build(rows).nearest(query, k)


def by_blocks(rows: Float32Array, query: Float32Array, k: int) -> Neighbours:
    return QuickIndex.build(rows, cuts=(1, 3)).nearest(query, k)


def patiently(rows: Float32Array, query: Float32Array, k: int) -> Neighbours:
    scan = PatientScan(rows)
    few = [scan.nearest(query, k) for _ in range(QUERIES // max(1, len(query)))]
    many = scan.nearest(query, k)
    for each in few:
        np.testing.assert_array_equal(each.indices, many.indices)
        np.testing.assert_array_equal(each.distances, many.distances)
    return many


SEARCHES = pytest.mark.parametrize("search", [exactly, by_scan, patiently, by_quick_index, by_blocks])


def naive(rows: Float32Array, query: Float32Array, k: int) -> list[tuple[float, int]]:
    """(squared distance, index) of the k nearest; exact where values are small integers."""
    found = [
        (sum((float(a) - float(b)) ** 2 for a, b in zip(row, query, strict=True)), i) for i, row in enumerate(rows)
    ]
    return sorted(found)[:k]


SIZES = st.tuples(st.integers(-(2**20), 2**20), st.integers(-30, 20)).map(lambda v: float(v[0] * 2.0 ** v[1]))


def integers(n: st.SearchStrategy[int], d: int) -> st.SearchStrategy[Float32Array]:
    return n.flatmap(lambda count: arrays(np.float32, (count, d), elements=st.integers(-3, 3).map(float)))


@SEARCHES
@settings(deadline=None)
@given(rows=integers(st.integers(0, 90), 5), query=integers(st.just(1), 5), k=st.integers(1, 100))
@example(rows=np.zeros((80, 5), np.float32), query=np.zeros((1, 5), np.float32), k=3)
@example(rows=np.zeros((0, 5), np.float32), query=np.ones((1, 5), np.float32), k=3)
def test_ties_duplicates_zeros_and_any_k(search: Search, rows: Float32Array, query: Float32Array, k: int) -> None:
    expected = naive(rows, query[0], k)
    found = search(rows, query, k)
    assert found.indices.shape == (1, min(k, len(rows)))
    assert found.indices[0].tolist() == [i for _, i in expected]
    np.testing.assert_array_equal(found.distances[0], np.sqrt([square for square, _ in expected]))


@settings(deadline=None)
@given(
    rows=arrays(np.float32, (60, 4), elements=SIZES),
    query=arrays(np.float32, (1, 4), elements=SIZES),
    scale=st.sampled_from([1.0, 1e-25, 1e-40]),
)
def test_both_ways_agree_on_any_numbers(rows: Float32Array, query: Float32Array, scale: float) -> None:
    """Values of very different size, where rounding is worst, denormal ones among them."""
    rows, query = (rows * np.float32(scale)).astype(np.float32), (query * np.float32(scale)).astype(np.float32)
    scan = by_scan(rows, query, 5)
    expected = naive(rows, query[0], 5)
    np.testing.assert_allclose(scan.distances[0], np.sqrt([square for square, _ in expected]), rtol=1e-12)
    for search in (by_quick_index, by_blocks):
        found = search(rows, query, 5)
        np.testing.assert_array_equal(found.indices, scan.indices)
        np.testing.assert_array_equal(found.distances, scan.distances)


def clustered(count: int, rng: np.random.Generator, spread: float) -> Float32Array:
    """Unit vectors of 512 values about 12 centres in 20 dimensions; many are almost alike."""
    centres = rng.standard_normal((12, 20))[rng.integers(0, 12, count)]
    found = (centres + spread * rng.standard_normal((count, 20))) @ rng.standard_normal((20, 512))
    found += 0.01 * rng.standard_normal((count, 512))
    unit: Float32Array = (found / np.linalg.norm(found, axis=1, keepdims=True)).astype(np.float32)
    return unit


@pytest.mark.parametrize("spread", [0.3, 1e-7, 0.0])
def test_many_descriptors(spread: float) -> None:
    """Spread 0: what sets rows apart is less than what a scan in float32 can tell."""
    rng = np.random.default_rng(5)
    rows = clustered(3000, rng, spread)
    if spread < 0.1:
        rows = (rows[:1] + 1e-6 * rows).astype(np.float32)
    rows[100:140] = rows[7]
    queries = np.concatenate([rows[:6], rows[7:8], clustered(6, rng, spread)])
    index, scan = QuickIndex.build(rows), DescriptorScan(rows)
    together = scan.nearest(queries, 20)
    for at, query in enumerate(queries):
        squares = np.square(rows.astype(np.float64) - query).sum(axis=1)
        order = np.lexsort((np.arange(len(rows)), squares))[:20]
        np.testing.assert_array_equal(together.indices[at], order)
        np.testing.assert_array_equal(together.distances[at], np.sqrt(squares[order]))
        for found in (index.nearest(query, 20), scan.nearest(query, 20)):
            np.testing.assert_array_equal(found.indices[0], order)
            np.testing.assert_array_equal(found.distances[0], np.sqrt(squares[order]))


def test_batches_larger_than_a_scan_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    rows = clustered(300, rng, 0.3)
    whole = DescriptorScan(rows).nearest(rows, 4)
    monkeypatch.setattr("motionlake.deephums.nearest.SCANNED", 2000)
    for mine, other in zip(whole, DescriptorScan(rows).nearest(rows, 4), strict=True):
        np.testing.assert_array_equal(mine, other)
    assert whole.indices[:, 0].tolist() == list(range(300))


def test_a_training_that_asked_for_less_precision_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bound on rounding is that of float32; few processors multiply in less, so the setting is looked at."""
    seen, product = [], torch.addmm

    def watched(*arguments: Any, **options: Any) -> torch.Tensor:
        seen.append(torch.get_float32_matmul_precision())
        return product(*arguments, **options)

    monkeypatch.setattr(torch, "addmm", watched)
    rows = np.eye(9, dtype=np.float32)
    before = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision("medium")
    try:
        assert DescriptorScan(rows).nearest(rows, 1).indices[:, 0].tolist() == list(range(9))
        assert seen == ["highest"]
        assert torch.get_float32_matmul_precision() == "medium"
    finally:
        torch.set_float32_matmul_precision(before)


@SEARCHES
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e20])
def test_what_is_no_number_is_refused(search: Search, bad: float) -> None:
    rows = np.ones((4, 6), np.float32)
    damaged = rows.copy()
    damaged[2, 3] = bad
    with pytest.raises(ValueError, match="row 2 holds NaN"):
        search(damaged, rows[:1], 1)
    with pytest.raises(ValueError, match="row 0 holds NaN"):
        search(rows, damaged[2:3], 1)


@SEARCHES
def test_what_does_not_compare_is_refused(search: Search) -> None:
    rows = np.ones((4, 6), np.float32)
    with pytest.raises(ValueError, match="do not compare with descriptors of 6 values"):
        search(rows, np.ones((1, 5), np.float32), 1)
    with pytest.raises(ValueError, match="k = 0"):
        search(rows, rows[:1], 0)
    with pytest.raises(ValueError, match="rows"):
        search(np.ones(6, np.float32), rows[:1], 1)


def test_torch_is_imported_for_many_rows_or_queries_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    built = DescriptorScan.__init__

    def counted(self: DescriptorScan, rows: Float32Array) -> None:
        asked.append(len(rows))
        built(self, rows)

    monkeypatch.setattr(DescriptorScan, "__init__", counted)
    rows = np.zeros((FEW + 1, 2), dtype=np.float32)
    assert isinstance(scan_of(rows[:FEW]), ExactScan)
    scan = scan_of(rows)
    for _ in range(QUERIES):
        scan.nearest(rows[:1], 2)
    assert asked == []
    scan.nearest(rows[:1], 2)
    scan.nearest(rows[:1], 2)
    assert asked == [FEW + 1]
    scan_of(rows).nearest(rows[: QUERIES + 1], 2)
    assert asked == [FEW + 1] * 2
    scan_of(np.zeros((SOME + 1, 2), dtype=np.float32)).nearest(rows[:1], 2)
    assert asked == [FEW + 1, FEW + 1, SOME + 1]
