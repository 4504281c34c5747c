"""Earth Mover's Distance against a linear programme."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import linprog

from pipeline.emd import emd, emd_many, emd_matrix, ground_distances


def naive_emd(p: NDArray[np.float64], q: NDArray[np.float64], matrix: NDArray[np.float64]) -> float:
    k = len(p)
    rows = np.kron(np.eye(k), np.ones(k))
    columns = np.kron(np.ones(k), np.eye(k))
    solved = linprog(matrix.ravel(), A_eq=np.vstack([rows, columns]), b_eq=np.concatenate([p / p.sum(), q / q.sum()]))
    return float(solved.fun)


def random_signatures(n: int, k: int, seed: int) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    weights = rng.random((n, k)) * (rng.random((n, k)) < 0.5)
    weights[:, 0] += 0.01
    return weights


@settings(max_examples=40, deadline=None)
@given(st.integers(2, 7), st.integers(0, 10_000))
def test_emd_is_the_optimum_of_the_linear_programme(k: int, seed: int) -> None:
    p, q = random_signatures(2, k, seed)
    ground = ground_distances(np.random.default_rng(seed).standard_normal((k, 3)))
    assert emd(p, q, ground) == pytest.approx(naive_emd(p, q, ground), abs=1e-9)


def test_emd_is_exact_at_zero_and_symmetric() -> None:
    signatures = random_signatures(12, 40, 1).astype(np.float32)
    ground = ground_distances(np.random.default_rng(2).standard_normal((40, 5)))
    assert emd(signatures[0], signatures[0].copy(), ground) == 0.0
    assert emd(signatures[0], signatures[1], ground) == emd(signatures[1], signatures[0], ground)
    matrix = emd_matrix(signatures, ground)
    np.testing.assert_array_equal(matrix, matrix.T)
    np.testing.assert_array_equal(np.diag(matrix), 0)
    np.testing.assert_array_equal(emd_many(signatures[3], signatures, ground), matrix[3])
    assert np.all(matrix[:, None] <= matrix[:, :, None] + matrix[None] + 1e-12)


def test_moving_all_mass_costs_the_ground_distance() -> None:
    ground = ground_distances(np.array([[0.0, 0], [3, 4], [0, 1]]))
    assert emd(np.array([2.0, 0, 0]), np.array([0, 7.0, 0]), ground) == pytest.approx(5)
    assert emd(np.array([1.0, 0, 1]), np.array([0, 0, 1.0]), ground) == pytest.approx(0.5)


@pytest.mark.parametrize("weights", [[0.0, 0, 0], [1.0, -1, 1], [1.0, 1], [np.nan, 1, 1]])
def test_a_signature_without_meaning_is_refused(weights: list[float]) -> None:
    ground = ground_distances(np.eye(3))
    with pytest.raises(ValueError, match="signature"):
        emd(np.array(weights), np.ones(3), ground)
