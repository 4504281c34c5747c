"""Strings in a query: bounds of the costs, and queries of many lengths side by side, against one at a time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.pesta import scan
from motionlake.pesta.bounds import bounds_of_strings
from motionlake.pesta.config import AlignmentConfig
from motionlake.pesta.strings import Repository, SymbolDistances

from tests.naive_alignment import gapped_weights, weights

M = 9
CONFIGS = [
    AlignmentConfig(),
    AlignmentConfig(stride=1),
    AlignmentConfig(stride=3),
    AlignmentConfig(stride=5),
    AlignmentConfig(gaps=True),
    AlignmentConfig(method="dtw"),
]
WITH_LOCAL = [*CONFIGS, AlignmentConfig(method="sw")]


def drawn(seed: int, lengths: list[int]) -> tuple[np.ndarray, Repository, SymbolDistances]:
    """A query, strings of so many symbols, and distances that need not be the same both ways."""
    rng = np.random.default_rng(seed)
    distances = rng.uniform(0, 1, (M, M)).astype(np.float32)
    np.fill_diagonal(distances, 0)
    strings = [rng.integers(0, M, length).astype(np.int32) for length in lengths]
    query = rng.integers(0, M, int(rng.integers(1, 9))).astype(np.int32)
    return query, Repository.of(strings), SymbolDistances(distances)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    lengths=st.lists(st.integers(0, 12), min_size=1, max_size=5),
    config=st.sampled_from(CONFIGS),
    threads=st.sampled_from([1, 2]),
)
def test_no_bound_is_above_the_cost(seed: int, lengths: list[int], config: AlignmentConfig, threads: int) -> None:
    query, strings, ground = drawn(seed, lengths)
    bounds = bounds_of_strings(query, strings, ground, config, threads=threads)
    for at, length in enumerate(lengths):
        if not length:
            assert np.isinf(bounds[at])
            continue
        own = strings.string(at)
        if config.gaps:
            costs = gapped_weights(own, query, ground.matrix, config.reach, *ground.scores(config))
        else:
            costs = weights(own, query, ground.matrix, config.reach)
        assert bounds[at] <= costs[-1].min() / length + 1e-6
        if config.reach == 1 and not config.gaps:
            definition = ground.matrix[own][:, query].min(axis=1).mean()
            assert bounds[at] == pytest.approx(definition, rel=1e-3, abs=1e-6)


def test_bounds_by_definition() -> None:
    ground = SymbolDistances(np.abs(np.subtract.outer(np.arange(9), np.arange(9))).astype(np.float32))
    strings = Repository.of([[5, 8, 2, 4]])
    for stride, expected in ((1, (1 + 4 + 0 + 0) / 4), (2, (1 + 0 + 0 + 0) / 4), (3, 0.0)):
        (found,) = bounds_of_strings([2, 4], strings, ground, AlignmentConfig(stride=stride))
        assert found == pytest.approx(expected, rel=1e-3)


def test_nothing_is_known_of_smith_waterman() -> None:
    query, strings, ground = drawn(0, [3, 4])
    assert np.isneginf(bounds_of_strings(query, strings, ground, AlignmentConfig(method="sw"))).all()


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    lengths=st.lists(st.integers(1, 40), min_size=1, max_size=40),
    config=st.sampled_from(WITH_LOCAL),
    alike=st.sampled_from([16, 32]),
)
def test_queries_of_many_lengths_side_by_side(
    seed: int, lengths: list[int], config: AlignmentConfig, alike: int
) -> None:
    """Costs are those of one query at a time, to the last bit."""
    text, queries, ground = drawn(seed, lengths)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(scan, "ALIKE", alike)
        patched.setattr(scan, "few", lambda cells: False)
        found = scan.least_in_one(queries, text, ground, config, 1)
    strings = [queries.string(at) for at in range(len(lengths))]
    expected = scan.pairwise(strings, Repository.of([text]), ground, config)[:, 0]
    assert found.tolist() == expected.tolist()
