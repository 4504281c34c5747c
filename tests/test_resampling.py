"""Turns about the vertical and resampling in time, beside slower ways to the same numbers."""

from __future__ import annotations

import numpy as np
import pytest
from motionlake.motion.resampling import interpolated, resample, sample_count
from motionlake.motion.rotations import from_axis_angle, rotate, turn_about_y

UP = np.array([0.0, 1.0, 0.0])


def test_turning_about_the_vertical_is_the_rotation_by_a_quaternion() -> None:
    rng = np.random.default_rng(0)
    vectors, angles = rng.normal(size=(5, 3, 3)), rng.normal(size=5)
    quaternions = from_axis_angle(UP, np.rad2deg(angles))
    np.testing.assert_allclose(turn_about_y(vectors, angles), rotate(quaternions[:, None], vectors), atol=1e-12)
    one = rotate(from_axis_angle(UP, 90.0), vectors)
    np.testing.assert_allclose(turn_about_y(vectors, np.pi / 2), one, atol=1e-12)


@pytest.mark.parametrize(("fps", "wanted"), [(30.0, 24.0), (24.0, 30.0), (120.0, 30.0), (59.94, 24.0)])
def test_resampling_is_linear_interpolation_at_even_instants(fps: float, wanted: float) -> None:
    frames = np.random.default_rng(1).normal(size=(50, 2, 3))
    instants = np.arange(sample_count(50, fps, wanted)) / wanted
    assert instants[-1] <= 49 / fps + 1e-9 < instants[-1] + 1 / wanted
    flat = frames.reshape(50, -1)
    naive = np.stack([np.interp(instants, np.arange(50) / fps, column) for column in flat.T], axis=1)
    np.testing.assert_allclose(resample(frames, fps, wanted).reshape(len(naive), -1), naive, atol=1e-9)
    np.testing.assert_allclose(interpolated(flat, instants * fps), naive, atol=1e-9)
