"""Flights of made motion are as long and as high as recorded ones at most."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from motionlake.arrays import Float64Array
from motionlake.matching.flights import LEVELS, longest_flights, too_long
from motionlake.motion.runs import runs

heights = arrays(np.float64, st.integers(1, 40), elements=st.floats(-0.25, 0.5, width=16))


def naive_longest(high: Float64Array) -> list[float]:
    """A walk over the frames, of every level by itself; a flight ends where a foot is near the ground."""
    longest = [0.0] * len(LEVELS)
    for start, stop in runs(high > 0):
        for i, level in enumerate(LEVELS):
            inside = [t for t in range(start, stop) if high[t] - level > 0]
            if not inside:
                continue
            first, last = float(inside[0]), float(inside[-1])
            for t, beyond, sign in ((inside[0], inside[0] - 1, -1), (inside[-1], inside[-1] + 1, 1)):
                if 0 <= beyond < len(high):
                    share = (high[t] - level) / (high[t] - high[beyond])
                    first, last = (first - share, last) if sign < 0 else (first, last + share)
            longest[i] = max(longest[i], last - first)
    return longest


@given(heights)
def test_flights_are_as_long_as_a_walk_over_the_frames_finds(high: Float64Array) -> None:
    np.testing.assert_allclose(longest_flights(high), naive_longest(high), atol=1e-9)


@given(heights, heights)
def test_lowered_flights_are_no_longer_than_recorded_ones(high: Float64Array, recorded: Float64Array) -> None:
    most = longest_flights(recorded)
    lowered = too_long(high, np.tile(most, (len(high), 1)))
    assert (longest_flights(high - lowered) <= most + 1e-9).all()
    assert (lowered[high <= 0] == 0).all()


@given(heights)
def test_flights_as_recorded_stay(high: Float64Array) -> None:
    assert not too_long(high, np.tile(longest_flights(high), (len(high), 1))).any()


def test_a_flight_is_lowered_no_further_than_it_must_be() -> None:
    """One of eight frames, where five are recorded; the other stays."""
    arc = np.array([0.02 * math.sin(math.pi * t / 8) for t in range(9)]) - 1e-6
    short = np.array([0.02 * math.sin(math.pi * t / 5) for t in range(6)]) - 1e-6
    high, most = np.concatenate([arc, short, arc[:1]]), longest_flights(np.concatenate([short, short[:1]]))
    lowered = too_long(high, np.tile(most, (len(high), 1)))
    assert not lowered[9:].any()
    enough = float(lowered.max())
    assert longest_flights(high - lowered)[0] == pytest.approx(most[0], abs=0.05)
    assert (longest_flights(arc - 0.98 * enough) > most).any()


def test_a_flight_between_two_classes_may_be_as_long_as_the_longer_of_both() -> None:
    high = np.array([-0.1, 0.03, 0.03, 0.03, 0.03, -0.1])
    none, long = np.zeros(len(LEVELS)), longest_flights(high)
    each = np.array([none, none, long, long, long, long])
    assert not too_long(high, each).any()
    assert too_long(high, np.tile(none, (6, 1)))[1:5].min() == pytest.approx(0.03, rel=1e-3)
