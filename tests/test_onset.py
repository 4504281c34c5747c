"""How motion goes on from recorded frames: as bodies did that stood and moved so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from motionlake.glogen.onset import (
    FEATURES,
    FRAMES,
    KNOTS,
    LINEAR,
    MOST,
    ROOT,
    SCALES,
    SOFT,
    Onset,
    fit_onset,
    state_at,
    with_onset,
)
from motionlake.glogen.trajectories import BodyMotion, body_motion, mirrored

from tests.test_trajectories import swinging


@pytest.fixture(scope="module")
def walks() -> list[BodyMotion]:
    return [body_motion(swinging(150, i), 30.0) for i in range(8)]


@pytest.fixture(scope="module")
def lead(walks: list[BodyMotion]) -> Onset:
    return fit_onset(walks[:6], [1] * 6, [False, True, True])


def test_it_goes_on_as_the_kernels_of_all_examples_say(walks: list[BodyMotion]) -> None:
    """Beside the mean of a Gaussian process, example by example, either side for the other too."""
    some = [walks[0].cut(0, 90), walks[1].cut(0, 90)]
    lead = fit_onset(some, [0, 0], [True])
    states, futures = [], []
    for motion in (some[0], mirrored(some[0]), some[1], mirrored(some[1])):
        for place in range(3, len(motion) - FRAMES):
            states.append(state_at(motion, np.array([float(place)]))[0])
            futures.append(motion.rows[[place + knot for knot in KNOTS]] - states[-1][:ROOT])
    n = len(states)
    apart = np.array([[np.linalg.norm((a - b) / SCALES) for a in states] for b in states])
    width = np.median([apart[i, j] for i in range(n) for j in range(i)])

    def alike(a: np.ndarray, b: np.ndarray) -> float:
        far = np.sqrt(3) * np.linalg.norm((a - b) / SCALES) / width
        return float((1 + far) * np.exp(-far) + LINEAR * np.sum(a / SCALES * (b / SCALES)) / width**2)

    kernel = np.array([[alike(a, b) for a in states] for b in states])
    mean = np.mean(futures, axis=0)
    asked = state_at(walks[0], np.array([20.4]))[0]
    near = np.array([alike(asked, s) for s in states])
    weights = np.linalg.solve(kernel + SOFT * np.eye(n), near)
    wanted = asked[:ROOT] + mean + sum(w * (f - mean) for w, f in zip(weights, futures, strict=True))
    found = lead.ahead(asked, 0)
    assert found is not None
    np.testing.assert_allclose(found[[knot - 1 for knot in KNOTS]], wanted, atol=2e-4)


def test_it_is_nearer_to_what_follows_than_the_last_frame_is(walks: list[BodyMotion], lead: Onset) -> None:
    for motion in walks[6:]:
        for place in (20.0, 41.7, 77.3):
            state = state_at(motion, np.array([place]))[0]
            ahead = lead.ahead(state, 1)
            assert ahead is not None
            assert ahead.shape == (FRAMES, ROOT)
            rows = motion.rows
            true = rows[round(place) + np.arange(1, FRAMES + 1)]
            error, held = (np.abs(made - true)[:, :60].mean() for made in (ahead, state[:ROOT]))
            assert error < 0.4 * held


def test_a_state_knows_nothing_of_what_follows(walks: list[BodyMotion]) -> None:
    motion, at = walks[0], np.array([30.0])
    other = replace(motion, joints=motion.joints.copy(), height=motion.height.copy(), turn=motion.turn.copy())
    other.joints[31:], other.height[31:] = 9.0, 9.0
    other.turn[30:] = 9.0  # towards frame 31
    assert state_at(motion, at).shape == (1, FEATURES)
    np.testing.assert_array_equal(state_at(other, at), state_at(motion, at))


def test_nothing_is_said_of_what_was_not_seen(walks: list[BodyMotion], lead: Onset) -> None:
    state = state_at(walks[6], np.array([40.0]))[0]
    assert lead.ahead(state, 1) is not None
    assert lead.ahead(state, 0) is None  # comes to its end
    assert lead.ahead(state, 2) is None  # no clips
    assert lead.ahead(state + 20 * SCALES, 1) is None
    short = [motion.cut(0, FRAMES) for motion in walks[:3]]
    assert fit_onset(short, [0] * 3, [True]).ahead(state, 0) is None


def test_examples_are_bounded(walks: list[BodyMotion]) -> None:
    many = fit_onset([walks[i % 8] for i in range(60)], [i % 2 for i in range(60)], [True, True])
    assert MOST / 2 < len(many.classes) <= MOST
    assert set(many.classes.tolist()) == {0, 1}
    assert 60 < len(fit_onset(walks[:6], [0] * 6, [True], 120).classes) <= 120


@pytest.mark.parametrize("pace", [0.5, 1.0, 2.0])
def test_it_is_led_over_to_the_generated_motion(walks: list[BodyMotion], lead: Onset, pace: float) -> None:
    state = state_at(walks[6], np.array([40.0]))[0]
    ahead, plain = lead.ahead(state, 1, pace), lead.ahead(state, 1)
    assert ahead is not None
    assert plain is not None
    assert len(ahead) == round(FRAMES / pace)
    step = round(2 * pace) if pace >= 1 else 1
    np.testing.assert_allclose(ahead[round(step / pace) - 1, :60], plain[step - 1, :60], atol=1e-9)
    np.testing.assert_allclose(ahead[round(step / pace) - 1, 61:], pace * plain[step - 1, 61:], atol=1e-9)
    made = with_onset(walks[7], ahead)
    rows, before = made.rows, walks[7].rows
    np.testing.assert_allclose(rows[0], ahead[0], atol=0.05)
    np.testing.assert_array_equal(rows[len(ahead) :], before[len(ahead) :])
    np.testing.assert_array_equal(made.stands, walks[7].stands)
    steps = np.linalg.norm(np.diff(rows[:, :60], axis=0), axis=1)
    assert steps.max() < 3 * np.linalg.norm(np.diff(before[:, :60], axis=0), axis=1).max()
    assert with_onset(walks[7], None) is walks[7]
    assert len(with_onset(walks[7].cut(0, 5), ahead)) == 5
