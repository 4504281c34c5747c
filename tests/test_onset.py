"""How motion goes on from recorded frames: as bodies did that stood and moved so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from motionlake.glogen.config import OnsetRecipe
from motionlake.glogen.onset import LEARNED, LINEAR, MOST, SOFT, Onset, fit_onset, played, with_onset
from motionlake.glogen.onset_examples import (
    EARLIEST,
    FEATURES,
    KNOTS,
    LATEST,
    LEVELS,
    ROOT,
    SCALES,
    examples_of,
    one_sided,
    played_at,
    state_at,
)
from motionlake.glogen.onset_network import train_onset_network
from motionlake.glogen.trajectories import FPS, BodyMotion, body_motion, mirrored
from motionlake.motion.skeleton import INDEX

from tests.test_trajectories import swinging

FRAMES = LEVELS[-1]
QUICK = OnsetRecipe(width=64, epochs=16)


@pytest.fixture(scope="module")
def walks() -> list[BodyMotion]:
    return [body_motion(swinging(150, i), 30.0) for i in range(8)]


@pytest.fixture(scope="module")
def onset(walks: list[BodyMotion]) -> Onset:
    return fit_onset(walks[:6], [1] * 6, [True, True, True], recipe=QUICK)[0]


def waving(frames: int, seed: int) -> BodyMotion:
    """A body that holds its right arm up, and walks."""
    joints = swinging(frames, seed)
    for joint in ("right_elbow", "right_wrist"):
        joints[:, INDEX[joint]] = joints[:, INDEX["right_shoulder"]] + [0, 0.2 if joint == "right_elbow" else 0.4, 0]
    return body_motion(joints, 30.0)


def test_kernels_say_what_those_of_all_examples_do(walks: list[BodyMotion]) -> None:
    """Beside the mean of a Gaussian process, example by example, either side for the other too."""
    some = [walks[0].cut(0, 90), walks[1].cut(0, 90)]
    onset = fit_onset(some, [0, 0], [True], recipe=QUICK)[0]
    states, futures, goes_on = [], [], []
    for motion in (some[0], some[1], mirrored(some[0]), mirrored(some[1])):
        for place in range(EARLIEST, len(motion) - LEVELS[0]):
            states.append(state_at(motion, np.array([float(place)]))[0])
            later = [place + knot for knot in KNOTS]
            futures.append(motion.rows[np.minimum(later, len(motion) - 1)] - states[-1][:ROOT])
            goes_on.append(len(motion) - 1 - place)
    n = len(states)
    apart = np.array([[np.linalg.norm((a - b) / SCALES) for a in states] for b in states])
    width = np.median([apart[i, j] for i in range(n) for j in range(i)])

    def alike(a: np.ndarray, b: np.ndarray) -> float:
        far = np.sqrt(3) * np.linalg.norm((a - b) / SCALES) / width
        return float((1 + far) * np.exp(-far) + LINEAR * np.sum(a / SCALES * (b / SCALES)) / width**2)

    asked = state_at(walks[0], np.array([20.4]))[0]
    found = onset.by_kernel(asked, 0)
    for knot, made in zip(KNOTS, found, strict=True):
        # What is so far ahead is known of the examples that go on for so many frames, by steps of `LEVELS`.
        level = next(level for level in LEVELS if knot <= level)
        own = [i for i in range(n) if goes_on[i] >= level]
        kernel = np.array([[alike(states[a], states[b]) for a in own] for b in own])
        wanted = np.array([futures[i][KNOTS.index(knot)] for i in own])
        weights = np.linalg.solve(kernel + SOFT * np.eye(len(own)), np.array([alike(asked, states[i]) for i in own]))
        np.testing.assert_allclose(made, wanted.mean(axis=0) + weights @ (wanted - wanted.mean(axis=0)), atol=2e-4)


def test_both_are_nearer_to_what_follows_than_the_last_frame_is(walks: list[BodyMotion], onset: Onset) -> None:
    for motion in walks[6:]:
        for place in (20.0, 41.7, 77.3):
            state = state_at(motion, np.array([place]))[0]
            ahead = onset.ahead(state, 1)
            assert ahead is not None
            assert ahead.shape == (FRAMES, ROOT)
            true = motion.rows[round(place) + np.arange(1, FRAMES + 1)]
            held = np.abs(state[:ROOT] - true)[:, :60].mean()
            kernel, network = (played(state, by(state, 1), FRAMES) for by in (onset.by_kernel, onset.by_network))
            for made in (ahead, kernel, network):
                assert np.abs(made - true)[:, :60].mean() < 0.4 * held
            np.testing.assert_allclose(ahead[[k - 1 for k in KNOTS]], (kernel + network)[[k - 1 for k in KNOTS]] / 2)


def test_the_network_learns_and_is_the_same_again(walks: list[BodyMotion], onset: Onset) -> None:
    again, losses = fit_onset(walks[:6], [1] * 6, [True, True, True], recipe=QUICK)
    assert len(losses) == QUICK.epochs
    assert losses[-1] < 0.5 * losses[0]
    other, _ = fit_onset(walks[:6], [1] * 6, [True, True, True], recipe=QUICK, seed=1)
    for name, value in onset.state_dict().items():
        assert torch.equal(value, again.state_dict()[name])
    assert any(not torch.equal(value, other.state_dict()[name]) for name, value in onset.state_dict().items())


def test_training_goes_on_where_it_was_interrupted(walks: list[BodyMotion], tmp_path: Path) -> None:
    recipe, file, told = OnsetRecipe(width=16, epoch=5, epochs=25), tmp_path / "kept.safetensors", []

    def stop(done: int, epochs: int, loss: float) -> None:
        told.append(done)
        if done == 12:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fit_onset(walks[:3], [0] * 3, [True], recipe=recipe, checkpoint=file, progress=stop)
    told.clear()
    resumed, losses = fit_onset(
        walks[:3], [0] * 3, [True], recipe=recipe, checkpoint=file, progress=lambda done, *_: told.append(done)
    )
    whole, all_losses = fit_onset(walks[:3], [0] * 3, [True], recipe=recipe)
    assert told == list(range(11, 26))
    assert losses == pytest.approx(all_losses)
    for name, value in whole.state_dict().items():
        assert torch.equal(value, resumed.state_dict()[name])


def test_a_class_has_its_own_future(walks: list[BodyMotion]) -> None:
    """Of the same states, one class goes on as recorded, the other the opposite way."""
    one = examples_of(walks[:4], True, 10_000)
    network, _ = train_onset_network([one, replace(one, futures=-one.futures)], replace(QUICK, epochs=20), 0)
    state, true = one.states[60], one.futures[60].reshape(len(KNOTS), ROOT)
    for target, sign in ((0, 1), (1, -1)):
        made = network.follow(state, target)
        assert np.linalg.norm(made[5:, :60] - sign * true[5:, :60]) < 0.3 * np.linalg.norm(true[5:, :60])


def test_a_state_knows_nothing_of_what_follows(walks: list[BodyMotion]) -> None:
    motion, at = walks[0], np.array([30.0])
    other = replace(motion, joints=motion.joints.copy(), height=motion.height.copy(), turn=motion.turn.copy())
    other.joints[31:], other.height[31:] = 9.0, 9.0
    other.turn[30:] = 9.0  # towards frame 31
    assert state_at(motion, at).shape == (1, FEATURES)
    np.testing.assert_array_equal(state_at(other, at), state_at(motion, at))


def test_of_an_action_it_is_known_when_it_began(walks: list[BodyMotion]) -> None:
    places = np.array([0.0, 12.0, 45.5, 140.0])
    assert state_at(walks[0], places, cyclic=False)[:, -1].tolist() == [0.0, 0.4, 45.5 / FPS, LATEST / FPS]
    assert not state_at(walks[0], places)[:, -1].any()


def test_nothing_is_said_of_what_was_not_seen(walks: list[BodyMotion], onset: Onset) -> None:
    state = state_at(walks[6], np.array([40.0]))[0]
    assert onset.ahead(state, 1) is not None
    assert onset.ahead(state, 0) is None  # no clips
    assert onset.ahead(state + 20 * SCALES, 1) is None
    short = [motion.cut(0, LEVELS[0]) for motion in walks[:3]]
    assert fit_onset(short, [0] * 3, [True], recipe=QUICK)[0].ahead(state, 0) is None
    assert fit_onset([], [], [True], recipe=QUICK)[0].ahead(state, 0) is None


@pytest.mark.parametrize(("length", "frames"), [(28, 20), (40, 30), (90, 45)])
def test_as_many_frames_are_predicted_as_most_clips_go_on_for(
    walks: list[BodyMotion], length: int, frames: int
) -> None:
    onset = fit_onset([m.cut(0, length) for m in walks], [0] * 8, [True], recipe=QUICK)[0]
    state = state_at(walks[6], np.array([4.0]))[0]
    ahead = onset.ahead(state, 0)
    assert ahead is not None
    assert len(ahead) == frames
    assert np.abs(ahead - walks[6].rows[5 : 5 + frames])[:, :60].mean() < 0.02
    examples = examples_of([walks[0].cut(0, length)], True, 100)
    assert examples.lasting.max() == frames
    futures = examples.futures.reshape(len(examples), len(KNOTS), ROOT)
    assert not futures[np.array(KNOTS) > examples.lasting[:, None]].any()
    assert futures[np.array(KNOTS) <= examples.lasting[:, None]].any(axis=1).all()


def test_examples_are_bounded(walks: list[BodyMotion]) -> None:
    many = [walks[i % 8] for i in range(60)]
    onset = fit_onset(many, [i % 2 for i in range(60)], [True, True], recipe=replace(QUICK, epochs=1))[0]
    assert MOST / 2 < len(onset.classes) <= MOST < LEARNED
    assert set(onset.classes.tolist()) == {0, 1}
    few = fit_onset(walks[:6], [0] * 6, [True], examples=120, recipe=replace(QUICK, epochs=1))[0]
    assert 60 < len(few.classes) <= 120


def test_clips_of_both_sides_are_one_clip(walks: list[BodyMotion]) -> None:
    one, both = (examples_of(walks[:3], True, 10_000, both=both) for both in (False, True))
    assert len(both) == 2 * len(one)
    assert sorted(set(both.clips.tolist())) == [0, 1, 2]
    np.testing.assert_array_equal(both.clips, np.concatenate([one.clips, one.clips]))
    np.testing.assert_array_equal(both.states[: len(one)], one.states)


def test_what_is_done_with_one_side_is_not_mirrored(walks: list[BodyMotion]) -> None:
    waves = [waving(100, seed) for seed in range(4)]
    assert one_sided(waves, True)
    assert not one_sided(walks[:4], True)
    assert not one_sided(waves[:1], True)  # of one clip nobody knows
    counts = [
        len(fit_onset(some, [0] * 4, [True], mirroring=[mirroring], recipe=replace(QUICK, epochs=1))[0].classes)
        for some, mirroring in ((waves, True), (walks[:4], False), (walks[:4], True))
    ]
    assert counts == [4 * (100 - 23), 4 * (150 - 23), 8 * (150 - 23)]


def test_clips_played_faster_go_on_faster(walks: list[BodyMotion]) -> None:
    fast = played_at(walks[0], 1.25)
    assert len(fast) == 120
    np.testing.assert_allclose(fast.rows[8, :61], walks[0].rows[10, :61])
    np.testing.assert_allclose(fast.rows[8, 61:], 1.25 * walks[0].rows[10, 61:])
    assert played_at(walks[0], 1.0) is walks[0]


@pytest.mark.parametrize("pace", [0.5, 1.0, 2.0])
def test_it_is_led_over_to_the_generated_motion(walks: list[BodyMotion], onset: Onset, pace: float) -> None:
    state = state_at(walks[6], np.array([40.0]))[0]
    ahead, plain = onset.ahead(state, 1, pace), onset.ahead(state, 1)
    assert ahead is not None
    assert plain is not None
    assert len(ahead) == round(FRAMES / pace)
    step = round(2 * pace) if pace >= 1 else 1
    np.testing.assert_allclose(ahead[round(step / pace) - 1, :60], plain[step - 1, :60], atol=1e-9)
    np.testing.assert_allclose(ahead[round(step / pace) - 1, 61:], pace * plain[step - 1, 61:], atol=1e-9)
    made = with_onset(walks[7], ahead)
    rows, before = made.rows, walks[7].rows
    np.testing.assert_array_equal(rows[: len(ahead) // 2], ahead[: len(ahead) // 2])
    np.testing.assert_array_equal(rows[len(ahead) :], before[len(ahead) :])
    np.testing.assert_array_equal(made.stands, walks[7].stands)
    steps = np.linalg.norm(np.diff(rows[:, :60], axis=0), axis=1)
    assert steps.max() < 3 * np.linalg.norm(np.diff(before[:, :60], axis=0), axis=1).max()
    assert with_onset(walks[7], None) is walks[7]
    assert len(with_onset(walks[7].cut(0, 5), ahead)) == 5
