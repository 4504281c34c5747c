"""Earth Mover's Distance against a linear programme."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.deep_motifs.emd import emd, emd_deep_motifs, emd_many, emd_matrix, emd_partial, ground_distances
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.spatial.distance import cdist


def naive_emd(p: NDArray[np.float64], q: NDArray[np.float64], matrix: NDArray[np.float64]) -> float:
    k = len(p)
    rows = np.kron(np.eye(k), np.ones(k))
    columns = np.kron(np.ones(k), np.eye(k))
    solved = linprog(matrix.ravel(), A_eq=np.vstack([rows, columns]), b_eq=np.concatenate([p / p.sum(), q / q.sum()]))
    return float(solved.fun)


def naive_partial(p: NDArray[np.float64], q: NDArray[np.float64], matrix: NDArray[np.float64]) -> float:
    """Section 4.3 as printed: flows within the weights, the smaller sum in all, the work over the flow."""
    k = len(p)
    within = np.vstack([np.kron(np.eye(k), np.ones(k)), np.kron(np.ones(k), np.eye(k))])
    flow = min(p.sum(), q.sum())
    solved = linprog(
        matrix.ravel(),
        A_ub=within,
        b_ub=np.concatenate([p, q]) / flow,
        A_eq=np.ones((1, k * k)),
        b_eq=[1.0],
    )
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


@settings(max_examples=40, deadline=None)
@given(st.integers(2, 7), st.integers(0, 10_000), st.sampled_from([1e-6, 0.3, 1.0, 5.0]))
def test_the_papers_variant_is_the_optimum_of_its_linear_programme(k: int, seed: int, scale: float) -> None:
    p, q = random_signatures(2, k, seed)
    q *= scale
    strength = np.random.default_rng(seed).random(k) + 0.1
    ground = ground_distances(np.random.default_rng(seed).standard_normal((k, 3)))
    expected = naive_partial(p * strength, q * strength, ground)
    assert emd_deep_motifs(p, q, strength, ground) == pytest.approx(expected, abs=1e-7)
    assert emd_deep_motifs(p, q, strength, ground) == emd_deep_motifs(q, p, strength, ground)
    assert emd_deep_motifs(p, p.copy(), strength, ground) == 0.0
    assert emd_partial(p / p.sum(), q / q.sum(), ground) == pytest.approx(emd(p, q, ground), abs=1e-9)


def test_partial_flow_leaves_what_the_lighter_side_has_no_room_for() -> None:
    ground = ground_distances(np.array([[0.0, 0], [3, 4], [0, 1]]))
    assert emd_partial([2.0, 0, 0], [0, 7.0, 0], ground) == pytest.approx(5)
    assert emd_partial([1.0, 0, 0], [1.0, 9.0, 0], ground) == 0.0
    assert emd_partial([2.0, 0, 0], [0, 9.0, 1.0], ground) == pytest.approx((1 + 5) / 2)
    assert emd_deep_motifs([0.5, 0.5, 0], [0, 0.5, 0.5], np.array([1.0, 1, 3]), ground) == pytest.approx(0.5)


def test_moving_all_mass_costs_the_ground_distance() -> None:
    ground = ground_distances(np.array([[0.0, 0], [3, 4], [0, 1]]))
    assert emd(np.array([2.0, 0, 0]), np.array([0, 7.0, 0]), ground) == pytest.approx(5)
    assert emd(np.array([1.0, 0, 1]), np.array([0, 0, 1.0]), ground) == pytest.approx(0.5)


@pytest.mark.parametrize("weights", [[0.0, 0, 0], [1.0, -1, 1], [1.0, 1], [np.nan, 1, 1]])
def test_a_signature_without_meaning_is_refused(weights: list[float]) -> None:
    ground = ground_distances(np.eye(3))
    for distance in (emd, emd_partial):
        with pytest.raises(ValueError, match="signature"):
            distance(np.array(weights), np.ones(3), ground)
        with pytest.raises(ValueError, match="signature"):
            distance(np.ones(3), np.array(weights), ground)


@pytest.mark.parametrize("k", [1, 12, 100])
def test_ground_distances_are_those_of_scipy(k: int) -> None:
    centroids = np.random.default_rng(k).standard_normal((k, 48)).astype(np.float32)
    expected = cdist(centroids.astype(np.float64), centroids.astype(np.float64))
    np.testing.assert_allclose(ground_distances(centroids), expected, rtol=1e-15)


@pytest.mark.parametrize("before", ["", "import ot"], ids=["without POT", "with POT"])
def test_only_the_solver_of_pot_is_imported_and_a_pot_that_is_there_stays(before: str) -> None:
    code = f"""
import sys
{before}
from motionlake.deep_motifs.emd import emd, ground_distances
known = sys.modules.get("ot")
import numpy as np
assert emd([1.0, 0], [0, 1.0], ground_distances(np.array([[0.0], [3]]))) == 3
assert sys.modules.get("ot") is known
assert ("ot.bregman" in sys.modules) == (known is not None), "the rest of POT takes long"
"""
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
