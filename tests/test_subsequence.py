"""Sub-sequence DTW against all alignments there are."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.motion.dtw import STEPS, alignment_ends, nearest_stretch

Path = list[tuple[int, int]]


def paths_to(i: int, j: int, steps: np.ndarray) -> Iterator[Path]:
    """Every alignment of a query's frames 0 to i that ends at frame j of the sequence."""
    if i == 0:
        yield [(0, j)]
        return
    for up, along in steps.tolist():
        if i >= up and j >= along:
            for path in paths_to(i - up, j - along, steps):
                yield [*path, (i, j)]


@settings(max_examples=60, deadline=None)
@given(
    m=st.integers(1, 5),
    n=st.integers(1, 6),
    steps=st.sampled_from(sorted(STEPS)),
    squared=st.booleans(),
    seed=st.integers(0, 10_000),
)
def test_ends_are_those_of_the_cheapest_of_all_alignments(m: int, n: int, steps: str, squared: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    query, sequence = (rng.standard_normal((count, 3)).astype(np.float32) for count in (m, n))
    apart = np.linalg.norm(query[:, None] - sequence[None], axis=2) ** (2 if squared else 1)
    costs, starts = alignment_ends(query, sequence, steps, squared=squared)
    for j in range(n):
        every = [(sum(apart[cell] for cell in path), path) for path in paths_to(m - 1, j, STEPS[steps])]
        # A path may begin anywhere in the first row, and goes on along it only by a step of the query.
        if not every:
            assert np.isinf(costs[j])
            continue
        total, path = min(every)
        assert costs[j] == pytest.approx(total / len(path), rel=1e-4, abs=1e-4)
        assert starts[j] == path[0][1]


@settings(max_examples=40, deadline=None)
@given(start=st.integers(0, 30), length=st.integers(1, 20), edge=st.integers(0, 4), seed=st.integers(0, 1000))
def test_what_was_cut_out_is_found_where_it_was(start: int, length: int, edge: int, seed: int) -> None:
    sequence = np.random.default_rng(seed).standard_normal((50, 5)).astype(np.float32)
    query = sequence[start : start + length].copy()
    if length >= 2 * edge + 3:  # what is unlike at the ends does not matter
        query[:edge] = query[length - edge :] = 9
    else:
        edge = 0
    found = nearest_stretch(query, sequence, edge)
    assert (found.start, found.stop) == (start, start + length)
    assert found.cost == pytest.approx(0, abs=2e-3)


def test_a_stretch_stays_within_its_sequence() -> None:
    sequence = np.random.default_rng(0).standard_normal((6, 5)).astype(np.float32)
    query = np.concatenate([sequence[:1], sequence[:1], sequence, sequence[-1:], sequence[-1:]])
    assert nearest_stretch(query, sequence, 2)[:2] == (0, 6)
    with pytest.raises(ValueError, match="frames on both sides"):
        nearest_stretch(sequence[:0], sequence)
