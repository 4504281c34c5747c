"""Paths on the ground: their length and course by closed forms, and what makes none."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.motion.paths import STEP, ground_path, shape_path


@pytest.mark.parametrize("radius", [1.0, 3.0])
def test_a_circle_goes_to_the_left_and_an_eight_to_both_sides(radius: float) -> None:
    circle, eight = shape_path("circle", radius), shape_path("eight", radius)
    assert circle.length == pytest.approx(2 * math.pi * radius, rel=0.002)
    assert eight.length == pytest.approx(4 * math.pi * radius, rel=0.002)
    centre = np.array([radius, 0.0])
    np.testing.assert_allclose(np.linalg.norm(circle.points - centre, axis=1), radius, atol=0.001)
    assert circle.heading(0.0) == pytest.approx(0.0, abs=0.02)
    assert circle.heading(circle.length / 4) == pytest.approx(math.pi / 2, abs=0.02)
    assert eight.at(eight.length * 0.25)[0] == pytest.approx(2 * radius, abs=0.02)
    assert eight.at(eight.length * 0.75)[0] == pytest.approx(-2 * radius, abs=0.02)
    np.testing.assert_allclose(eight.at(3.5 * eight.length), eight.at(0.5 * eight.length), atol=0.02)


@settings(max_examples=30, deadline=None)
@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(0, 6.28), st.integers(0, 99))
def test_a_path_begins_at_the_origin_and_goes_ahead(x: float, z: float, turn: float, seed: int) -> None:
    legs = np.random.default_rng(seed).uniform(1, 4, 4)
    points = np.array([[0, 0], [0, legs[0]], [legs[1], legs[0]], [legs[1], legs[0] + legs[2]]])
    cos, sin = math.cos(turn), math.sin(turn)
    moved = np.stack([points[:, 0] * cos + points[:, 1] * sin + x, points[:, 1] * cos - points[:, 0] * sin + z], axis=1)
    path = ground_path(moved)
    assert not path.closed
    np.testing.assert_allclose(path.points[0], 0, atol=1e-9)
    np.testing.assert_allclose(path.points, ground_path(points).points, atol=0.02)
    steps = np.linalg.norm(np.diff(path.points, axis=0), axis=1)
    assert steps.max() < 1.5 * STEP
    assert path.length == pytest.approx(legs[:3].sum(), rel=0.12)  # corners are rounded
    end, beyond = np.array(path.at(path.length)), np.array(path.at(path.length + 1.0))
    assert np.linalg.norm(beyond - end) == pytest.approx(1.0, rel=0.02)


def test_the_nearest_way_is_that_of_a_loop() -> None:
    path, rng = shape_path("eight", 2.0).placed(np.array([1.0, -2.0]), 0.7, 1.2), np.random.default_rng(0)
    for _ in range(20):
        place, start = rng.normal(size=2) * 2, float(rng.uniform(0, path.length))
        ways = [start + path.step * i for i in range(60)]
        naive = min(ways, key=lambda way: math.dist(path.at(way), place))
        assert path.nearest(place, start, 60 * path.step) == pytest.approx(naive, abs=2 * path.step)


def test_a_path_that_comes_back_is_closed() -> None:
    square = ground_path([(0, 0), (0, 3), (3, 3), (3, 0), (0, 0)])
    assert square.closed
    assert square.length == pytest.approx(12, rel=0.08)


@pytest.mark.parametrize("points", [[], [(1, 2)], [(1, 2), (1, 2)], [(0, 0), (float("nan"), 1)]])
def test_what_is_no_path(points: list[tuple[float, float]]) -> None:
    with pytest.raises(ValueError, match=r"one point|not finite"):
        ground_path(points)
