"""The least of many values, of which bounds are known: those of working all out."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from motionlake.arrays import Int64Array
from motionlake.refined import refined


@given(st.integers(0, 10_000), st.integers(0, 60), st.integers(0, 12), st.booleans())
def test_the_least_are_exact(seed: int, n: int, count: int, equal: bool) -> None:
    rng = np.random.default_rng(seed)
    values = rng.integers(0, 9, n).astype(float) if equal else rng.normal(3, 1, n)
    bounds = values - rng.integers(0, 3, n) * rng.random()
    values[rng.random(n) < 0.2] = np.inf
    bounds[np.isinf(values)] = np.inf
    asked: list[int] = []

    def exact(rows: Int64Array) -> np.ndarray:
        asked.extend(rows.tolist())
        return values[rows]

    found = refined(bounds, count, exact)
    assert len(set(asked)) == len(asked), "each is worked out once"
    assert (found <= values).all()
    least = np.argsort(values, kind="stable")[:count]
    np.testing.assert_array_equal(np.argsort(found, kind="stable")[:count], least)
    np.testing.assert_array_equal(found[least], values[least])


def test_few_of_many_are_worked_out() -> None:
    values = np.arange(1000.0)
    asked: list[int] = []

    def exact(rows: Int64Array) -> np.ndarray:
        asked.extend(rows.tolist())
        return values[rows]

    refined(values - 5, 10, exact)
    assert sorted(asked) == list(range(21))
