"""The nearest signatures are those of a scan, bit by bit; bounds stay below; fewer transports are solved."""

from __future__ import annotations

from pathlib import Path
from unittest import mock

import duckdb
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import Float64Array
from motionlake.deep_motifs import emd_search as nearest_module
from motionlake.deep_motifs.emd import check_model, emd, emd_many, ground_distances
from motionlake.deep_motifs.emd_search import SignatureIndex
from motionlake.errors import UserError
from motionlake.lake.layout import open_lake
from motionlake.retrieval.signature import SignatureSearcher
from motionlake.retrieval.sql_functions import connect
from numpy.typing import NDArray

from tests.lakes import query


def some_signatures(n: int, k: int, seed: int) -> Float64Array:
    """Sparse ones; the last four rows are equal, on one motif, on two that no other shares, and nearly equal."""
    rng = np.random.default_rng(seed)
    weights = rng.random((n, k)) ** 3 * (rng.random((n, k)) < 0.4)
    weights[:, 0] += 0.01
    weights[-4] = weights[0]
    weights[-3] = np.eye(k)[1]
    weights[:-2, -2:] = 0
    weights[-2, :-2], weights[-2, -2:] = 0, 1
    weights[-1] = weights[0] * (1 + 1e-15 * rng.random(k))
    return weights


def some_ground(k: int, seed: int) -> Float64Array:
    return ground_distances(np.random.default_rng(seed).standard_normal((k, 3)))


def scan(
    query: Float64Array, signatures: NDArray[np.floating], ground: Float64Array, k: int
) -> tuple[list[int], list[float]]:
    """The naive oracle: solve every transport and sort."""
    distances = emd_many(query, signatures, ground).tolist()
    order = sorted(range(len(distances)), key=lambda i: (distances[i], i))[:k]
    return order, [distances[i] for i in order]


def nearest_signatures(
    query: Float64Array, signatures: NDArray[np.floating], ground: Float64Array, k: int
) -> tuple[NDArray[np.int64], Float64Array]:
    found = SignatureIndex.build(signatures, ground).nearest(query, k)
    return found.indices, found.distances


@settings(max_examples=60, deadline=None)
@given(st.integers(4, 12), st.integers(0, 10_000), st.floats(1e-6, 1e6))
def test_no_bound_exceeds_the_distance(k: int, seed: int, unit: float) -> None:
    signatures, ground = some_signatures(9, k, seed), some_ground(k, seed) * unit
    index = SignatureIndex.build(signatures, ground)
    everything = np.arange(len(index))
    for i, row in enumerate(signatures):
        exact = emd_many(row, signatures, ground)
        mass = index.mass(i)
        for bounds in (index.cheap_bounds(mass, everything), index.tight_bounds(mass, everything)):
            assert (bounds >= 0).all()
            assert (bounds <= exact).all()


def naive_bound(query: Float64Array, row: Float64Array, ground: Float64Array) -> float:
    """What is over goes, motif by motif, to the nearest that lack some, as if each had its lack to itself; and back."""
    surplus, deficit = np.maximum(query - row, 0), np.maximum(row - query, 0)
    ways = []
    for over, lack in ((surplus, deficit), (deficit, surplus)):
        work = 0.0
        for i in np.flatnonzero(over):
            left = over[i]
            for j in np.argsort(ground[i], kind="stable"):
                moved = min(left, lack[j])
                work, left = work + moved * ground[i, j], left - moved
        ways.append(work)
    return max(ways)


@settings(max_examples=40, deadline=None)
@given(st.integers(4, 12), st.integers(0, 10_000))
def test_the_tight_bound_is_the_dearer_of_two_ways_to_move_by_the_nearest(k: int, seed: int) -> None:
    signatures, ground = some_signatures(9, k, seed), some_ground(k, seed)
    index = SignatureIndex.build(signatures, ground)
    masses = [index.mass(i) for i in range(len(index))]
    for mass in masses:
        expected = [naive_bound(mass, row, ground) for row in masses]
        found = index.tight_bounds(mass, np.arange(len(index)))
        np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-8)


def test_the_cheap_bound_is_the_largest_difference_of_the_means() -> None:
    signatures, ground = some_signatures(9, 10, 11), some_ground(10, 11)
    index = SignatureIndex.build(signatures, ground)
    means = np.array([index.mass(i) @ ground for i in range(len(index))])
    for i, own in enumerate(means):
        expected = np.abs(means - own).max(axis=1)
        np.testing.assert_allclose(index.cheap_bounds(index.mass(i), np.arange(9)), expected, rtol=1e-4, atol=1e-4)


def test_the_bounds_are_tight_where_one_motif_has_all_mass() -> None:
    signatures, ground = some_signatures(9, 10, 3), some_ground(10, 3)
    index = SignatureIndex.build(signatures, ground)
    exact = emd_many(signatures[-3], signatures, ground)
    bounds = index.tight_bounds(index.mass(len(index) - 3), np.arange(len(index)))
    np.testing.assert_allclose(bounds, exact, rtol=1e-6, atol=1e-9)
    cheap = index.cheap_bounds(index.mass(len(index) - 3), np.arange(len(index)))
    np.testing.assert_allclose(cheap, exact, rtol=1e-4, atol=1e-4)


def test_a_bound_need_not_be_raised_beyond_what_is_enough() -> None:
    signatures, ground = some_signatures(40, 12, 4), some_ground(12, 4)
    index = SignatureIndex.build(signatures, ground)
    mass, everything = index.mass(0), np.arange(len(index))
    full = index.tight_bounds(mass, everything)
    enough = float(np.median(full))
    short = index.tight_bounds(mass, everything, enough)
    np.testing.assert_array_equal(short > enough, full > enough)
    np.testing.assert_array_equal(short[full <= enough], full[full <= enough])


@pytest.mark.parametrize("few", [False, True], ids=["with kernels", "without"])
@settings(max_examples=40, deadline=None)
@given(k=st.integers(1, 40), motifs=st.integers(4, 12), seed=st.integers(0, 10_000))
def test_answers_are_those_of_a_scan(few: bool, k: int, motifs: int, seed: int) -> None:
    signatures, ground = some_signatures(30, motifs, seed), some_ground(motifs, seed)
    with mock.patch.object(nearest_module, "few", return_value=few):
        for row in signatures[[0, 1, -3, -2]]:
            indices, distances = nearest_signatures(row, signatures, ground, k)
            assert (indices.tolist(), distances.tolist()) == scan(row, signatures, ground, k)


def test_few_transports_are_solved(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nearest_module, "few", lambda cells: False)
    signatures, ground = some_signatures(2000, 30, 5).astype(np.float32), some_ground(30, 5)
    index = SignatureIndex.build(signatures, ground)
    for row in some_signatures(8, 30, 6)[:4]:
        found = index.nearest(row, 10)
        assert (found.indices.tolist(), found.distances.tolist()) == scan(row, signatures, ground, 10)
        assert 10 <= found.solved <= 200


def test_ties_are_broken_by_index(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nearest_module, "PROBES", 1)
    ground = some_ground(6, 7)
    signatures = np.tile(np.eye(6)[[2, 1, 1, 3]], (5, 1))
    for k in (1, 3, 10, 12, 20):
        indices, distances = nearest_signatures(np.eye(6)[1], signatures, ground, k)
        assert (indices.tolist(), distances.tolist()) == scan(np.eye(6)[1], signatures, ground, k)


def test_the_choice_may_be_narrowed() -> None:
    signatures, ground = some_signatures(60, 10, 8), some_ground(10, 8)
    index = SignatureIndex.build(signatures, ground)
    among = np.arange(1, 60, 3)
    found = index.nearest(signatures[0], 5, among)
    indices, distances = scan(signatures[0], signatures[among], ground, 5)
    assert (found.indices.tolist(), found.distances.tolist()) == (among[indices].tolist(), distances)
    assert len(index.nearest(signatures[0], 5, among[:0]).indices) == 0


def test_there_may_be_fewer_signatures_than_asked_for() -> None:
    signatures, ground = some_signatures(9, 6, 10), some_ground(6, 10)
    indices, distances = nearest_signatures(signatures[0], signatures, ground, 50)
    assert (indices.tolist(), distances.tolist()) == scan(signatures[0], signatures, ground, 50)
    indices, distances = nearest_signatures(signatures[0], signatures[:0], ground, 3)
    assert len(indices) == len(distances) == 0


@pytest.mark.parametrize("k", [0, -1])
def test_none_cannot_be_asked_for(k: int) -> None:
    with pytest.raises(ValueError, match="at least 1"):
        nearest_signatures(np.ones(3), np.ones((2, 3)), some_ground(3, 0), k)


def test_signatures_over_other_motifs_are_refused() -> None:
    index = SignatureIndex.build(np.ones((2, 3)), some_ground(3, 0), "motifs-2")
    for name in ("motifs-2", None):
        check_model(name, index.model)
    with pytest.raises(ValueError, match=r"motifs-1 .* motifs-2"):
        check_model("motifs-1", index.model)
    with pytest.raises(ValueError, match="does not fit 3 motifs"):
        index.nearest(np.ones(4), 1)
    with pytest.raises(ValueError, match="does not fit 3 motifs"):
        SignatureIndex.build(np.ones((2, 4)), some_ground(3, 0))
    with pytest.raises(ValueError, match="weights"):
        SignatureIndex.build(np.array([[1.0, 1, 1], [1, -1, 1]]), some_ground(3, 0))


def test_signatures_of_a_lake(built_lake: Path) -> None:
    names, rows = zip(*query(built_lake, "SELECT clip, signature FROM signatures ORDER BY clip"), strict=True)
    centroids = query(built_lake, "SELECT centroid FROM motifs ORDER BY motif")
    signatures = np.array(rows, dtype=np.float32)
    ground = ground_distances(np.array([row[0] for row in centroids], dtype=np.float32))
    con = connect(built_lake)
    try:
        for i, name in enumerate(names):
            for k in (1, 3, 100):
                indices, distances = nearest_signatures(signatures[i], signatures, ground, k)
                expected = scan(signatures[i].astype(np.float64), signatures, ground, k)
                assert (indices.tolist(), distances.tolist()) == expected
            answers = con.execute(
                "SELECT clip, distance FROM similar_clips($clip, 4, method := 'signature')", {"clip": name}
            ).fetchall()
            found = [(emd(signatures[i], s, ground), n) for n, s in zip(names, signatures, strict=True) if n != name]
            assert answers == [(n, d) for d, n in sorted(found)[:4]]
    finally:
        con.close()


def test_a_lake_refuses_signatures_over_other_motifs(built_lake: Path) -> None:
    ((signature, model),) = query(built_lake, "SELECT signature, model FROM signatures, motifs ORDER BY clip LIMIT 1")
    con = connect(built_lake)
    try:
        searcher = SignatureSearcher(open_lake(built_lake))
        fitting = searcher.like(np.array(signature), 3, model=model)
        assert fitting[0].distance == 0
        for weights, name, said in ((signature, "motifs-7", "motifs-7"), (signature[:-1], None, "does not fit")):
            with pytest.raises(UserError, match=said):
                searcher.like(np.array(weights), 3, model=name)
            with pytest.raises(duckdb.Error, match=said):
                con.execute("FROM clips_like($s, 3, model := $m)", {"s": weights, "m": name}).fetchall()
        asked = con.execute("SELECT clip FROM clips_like($s, 3, model := $m)", {"s": signature, "m": model}).fetchall()
        assert asked == [(hit.clip,) for hit in fitting]
        assert con.execute("FROM clips_like(NULL, 3)").fetchall() == []
    finally:
        con.close()


def test_the_macros_answer_for_every_clip_of_a_table(built_lake: Path) -> None:
    con = connect(built_lake)
    try:
        text = "SELECT c.clip, s.clip, s.distance FROM clips c, similar_clips(c.clip, 2) s ORDER BY c.clip, s.rank"
        rows = con.execute(text).fetchall()
        expected = []
        for (name,) in con.execute("SELECT clip FROM clips ORDER BY clip").fetchall():
            answers = con.execute("SELECT clip, distance FROM similar_clips($clip, 2)", {"clip": name}).fetchall()
            expected += [(name, *answer) for answer in answers]
        assert rows == expected
    finally:
        con.close()
