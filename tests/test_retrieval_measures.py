"""Leave-one-out measures on cases counted by hand."""

from __future__ import annotations

import numpy as np
import pytest
from motionlake.arrays import Float64Array
from motionlake.evaluation.ranking import average_precision, leave_one_out


def on_a_line(places: list[float]) -> np.ndarray:
    x = np.array(places)
    apart: Float64Array = np.abs(x[:, None] - x[None])
    return apart


def test_perfect_classes() -> None:
    scores = leave_one_out(on_a_line([0, 1, 2, 10, 11.5, 13]), list("aaabbb"))
    assert (scores.nn, scores.first_tier, scores.second_tier, scores.map) == (1, 1, 1, 1)
    assert scores.top5 == pytest.approx(2 / 5)
    assert scores.n == 6


def test_one_intruder_by_hand() -> None:
    # queries a0: b1 a3 b8 | b1: a0 a3 b8 | a3: b1 a0 b8 | b8: a3 b1 a0
    scores = leave_one_out(on_a_line([0, 1, 3, 8]), ["a", "b", "a", "b"])
    assert scores.nn == 0
    assert scores.first_tier == 0
    assert scores.second_tier == pytest.approx((1 + 0 + 1 + 1) / 4)
    assert scores.map == pytest.approx((1 / 2 + 1 / 3 + 1 / 2 + 1 / 2) / 4)


def test_a_clip_without_relatives_is_no_query_but_stays_a_hit() -> None:
    scores = leave_one_out(on_a_line([0, 1, 1.5]), ["a", "lonely", "a"])
    assert scores.n == 2
    assert scores.nn == 0
    with pytest.raises(ValueError, match="nothing to retrieve"):
        leave_one_out(on_a_line([0, 1]), ["a", "b"])


def test_cross_subject_leaves_the_own_subject_out() -> None:
    places, labels = [0, 0.1, 5, 4.9], ["a", "a", "a", "b"]
    scores = leave_one_out(on_a_line(places), labels, ["s", "s", "t", "t"])
    # a0 and a1 rank b4.9 before a5; a5 ranks a0.1 first, both others being relatives; b has none elsewhere
    assert scores.cross_subject_nn == pytest.approx(1 / 3)
    assert scores.nn == pytest.approx(2 / 3)
    assert leave_one_out(on_a_line(places), labels).cross_subject_nn is None
    assert leave_one_out(on_a_line(places), labels, ["s"] * 4).cross_subject_nn is None


def test_ties_rank_by_index_and_the_diagonal_does_not_count() -> None:
    flat = np.zeros((3, 3))
    np.fill_diagonal(flat, -1)
    assert leave_one_out(flat, ["a", "a", "b"]).map == pytest.approx((1 + 1) / 2)
    assert leave_one_out(flat, ["b", "a", "a"]).map == pytest.approx(1 / 2)


def test_average_precision() -> None:
    assert average_precision(np.array([True, False, True, False])) == pytest.approx((1 + 2 / 3) / 2)
