"""Feet that slide or sink are put where they stand, and nothing jumps by it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from motionlake.motion.quality import Fault, check
from motionlake.motion.quality.footing import Body, pinned, smoothly
from motionlake.motion.quality.mend import mended
from motionlake.motion.skeleton import INDEX

from bench.plants import PLANTS
from tests.test_quality import CONFIG, FPS, FRAMES, kinds, motion_of, standing

LEG = [INDEX["left_hip"], INDEX["left_knee"], INDEX["left_ankle"]]


@pytest.mark.parametrize(("kind", "how"), [("slide", "pinned"), ("penetration", "raised")])
def test_feet_are_put_where_they_stand(kind: str, how: str) -> None:
    subject, tried = standing(), 0
    for seed in range(6):
        made = PLANTS[kind](subject, np.random.default_rng(seed))
        if made is None:
            continue
        broken = motion_of(subject, made.recording)
        copy, done = mended(broken, check(made.recording, CONFIG).faults)
        assert {each.how for each in done} == {how}
        assert kinds(replace(made.recording, positions=copy.positions, rotations=copy.rotations)) == set()
        both = copy.positions, broken.positions
        apart, before = (np.abs(each - subject.recording.positions).max() for each in both)
        assert apart < 0.03 < 0.08 < before
        jerk, rough = (np.abs(np.diff(each, 3, axis=0)).max() for each in both)
        assert jerk <= rough * (1 + 1e-9)
        bones, lengths = (np.linalg.norm(np.diff(each[:, LEG], axis=1), axis=2) for each in both)
        np.testing.assert_allclose(bones, lengths, atol=1e-9)
        tried += 1
    assert tried >= 3


def test_a_change_that_makes_the_body_jump_is_taken_back() -> None:
    subject = standing()
    body = Body(subject.recording.positions[:, 0], subject.recording.rotations, subject.rest_offsets, FPS)
    kept, fault = body.root.copy(), Fault(kind="slide", joint="left_ankle", start=100, stop=200, severity=0.2)

    def leap(body: Body, fault: Fault) -> None:
        body.root = body.root + (np.arange(FRAMES) >= 150)[:, None] * np.array([0.02, 0.0, 0.0])

    assert not smoothly(body, fault, leap)
    assert np.array_equal(body.root, kept)


def test_legs_take_what_feet_still_wander() -> None:
    """The trunk sways by two centimetres, and its feet with it: hip and knee hold them, the trunk sways as before."""
    subject = standing()
    sway = np.zeros((FRAMES, 3))
    sway[100:300, 0] = 0.02 * np.sin(np.linspace(0, 2 * np.pi, 200))
    root = subject.recording.positions[:, 0] + sway
    body = Body(root, subject.recording.rotations, subject.rest_offsets, FPS)
    before = body.places()
    pinned(body, Fault(kind="slide", joint="left_ankle", start=100, stop=300, severity=0.2))
    after = body.places()
    ankles = [INDEX["left_ankle"], INDEX["right_ankle"]]
    np.testing.assert_allclose(after[:, INDEX["head"]], before[:, INDEX["head"]], atol=1e-9)
    assert np.ptp(before[105:295, ankles, 0], axis=0).min() > 0.03
    assert np.ptp(after[105:295, ankles, 0], axis=0).max() < 0.005
