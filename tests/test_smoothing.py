"""Our Gaussian filter is that of scipy, to the last bit."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from motionlake.motion.smoothing import Ends, smoothed
from scipy.ndimage import gaussian_filter1d


@given(
    st.integers(1, 60), st.sampled_from([0.3, 0.5, 1.0, 1.5, 2.0, 7.25]), st.sampled_from(["reflect", "nearest"]),
    st.integers(0, 2**32),
)  # fmt: skip
def test_frames_are_smoothed_as_by_scipy(frames: int, deviation: float, ends: Ends, seed: int) -> None:
    values = np.random.default_rng(seed).normal(size=(frames, 3, 2)).cumsum(axis=0)
    expected = gaussian_filter1d(values, deviation, axis=0, mode=ends)
    np.testing.assert_array_equal(smoothed(values, deviation, ends), expected)
