"""What gravity and the size of a body say about a clip's frame rate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motionlake.motion.quality import check
from motionlake.motion.quality.clock import SLOW, USUAL, centre_of_mass, evidence, judged
from motionlake.motion.skeleton import INDEX

from tests.test_quality import CONFIG, FPS, standing

FRAMES = 54
HEIGHT = 0.9  # metres, of the centre of mass over the foot


@given(st.dictionaries(st.sampled_from(sorted(USUAL)), st.floats(-3, 3), max_size=5))
def test_evidence_is_joined_by_its_spread(found: dict[str, float]) -> None:
    """Against the sums of log likelihoods, kind by kind, of an octave off and of none."""
    rate = judged(found)
    if not found:
        assert (rate.factor, rate.odds) == (1.0, 1.0)
        return
    apart = {kind: value - USUAL[kind].value for kind, value in found.items()}
    spread = {kind: USUAL[kind].spread * (SLOW if kind == "tempo" and apart[kind] < 0 else 1) for kind in found}
    total = sum(spread[kind] ** -2 for kind in found)
    mean = sum(apart[kind] / spread[kind] ** 2 for kind in found) / total
    assert rate.factor == pytest.approx(2**mean)
    octave = 1.0 if mean >= 0 else -1.0
    off, none = (-sum((apart[k] - at) ** 2 / spread[k] ** 2 for k in found) / 2 for at in (octave, 0.0))
    contradiction = sum((apart[k] - mean) ** 2 / spread[k] ** 2 for k in found) / max(len(found) - 1, 1)
    told = np.log(rate.odds)
    if abs(off - none) < 50:
        assert told == pytest.approx((off - none) / max(contradiction, 1.0), abs=1e-6)


@pytest.mark.parametrize("factor", [0.25, 0.5, 1.0, 2.0, 4.0])
def test_a_body_that_topples_about_a_foot_tells_the_frame_rate(factor: float) -> None:
    """A pendulum upside down: the centre of mass leaves the standing foot as x'' = g x / h."""
    body = standing(FRAMES).recording
    positions = np.repeat(body.positions[:1], FRAMES, axis=0)
    right = [INDEX[f"right_{part}"] for part in ("knee", "ankle", "toe")]
    positions[:, right, 1] += 0.2
    foot = [INDEX["left_ankle"], INDEX["left_toe"]]
    held = positions[:, foot].copy()
    time = (np.arange(FRAMES) - FRAMES / 2) / FPS
    topples = 0.04 * np.cosh(time * np.sqrt(9.81 / HEIGHT))
    for _ in range(20):  # until the centre of mass, of which the foot is a part, goes as it should
        centre = centre_of_mass(replace(body, positions=positions))
        positions[..., 0] += (topples - (centre - held.mean(axis=1))[:, 0])[:, None]
        positions[:, foot] = held
    found = evidence(replace(body, positions=positions, fps=FPS * factor))
    height = (centre - held.mean(axis=1))[:, 1].mean() + 0.04
    assert 2 ** found["balance_aside"] == pytest.approx(factor * np.sqrt(height / HEIGHT), rel=0.05)


def test_what_moves_too_little_is_not_known() -> None:
    quality = check(standing().recording, CONFIG)
    assert (quality.measures["fps_known"], quality.measures["fps_doubt"]) == (0.0, 1.0)


def test_a_clip_that_is_too_short_has_no_evidence() -> None:
    assert evidence(standing(19).recording) == {}


def test_motion_that_is_four_times_too_quick_is_told() -> None:
    """A trunk that sways and arms that swing at 0.5 Hz: no person shakes at 8."""
    body = standing().recording
    wild = check(replace(body, fps=16 * FPS), CONFIG)
    assert [fault.kind for fault in wild.faults if fault.kind == "fps"] == ["fps"]
    assert wild.verdict == "bad"
