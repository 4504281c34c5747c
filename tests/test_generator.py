"""A generator as a whole: from clips of classes to motion that can be put to use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from motionlake.glogen.config import GloGenRecipe, LocGenRecipe, OnsetRecipe, SynthesisConfig
from motionlake.glogen.generator import (
    METADATA_KEY,
    TrainedGenerator,
    TrainingMotion,
    load_generator,
    start_state,
)
from motionlake.glogen.generator_training import fit_generator, train_generator
from motionlake.glogen.rollout import FASTEST, Rollout
from motionlake.glogen.sparse import DURATION, WIDTH
from motionlake.glogen.training import groups
from motionlake.glogen.trajectories import STANDARD, body_motion
from motionlake.motion.generation import GeneratedMotion, MotionRequest, SeedClip
from motionlake.motion.kinematics import forward_kinematics
from motionlake.motion.skeleton import JOINTS
from motionlake.training import save_network

from tests.test_trajectories import swinging

SMALL = GloGenRecipe(embedding=16, state=16, layers=1, latent=4, epochs=20, steps=0, going_steps=0)
DENSE = LocGenRecipe(embedding=16, state=16, epochs=2, steps=0)
ONSET = OnsetRecipe(width=16, epochs=4)
BODY = 1.3 * STANDARD


def clips(count: int = 8) -> tuple[list[np.ndarray], list[str]]:
    """Walks, and the same walked backwards."""
    walks = [swinging(70 + 3 * i, i) for i in range(count)]
    return [*walks, *[walk[::-1] for walk in walks]], ["walk"] * count + ["back"] * count


@pytest.fixture(scope="module", params=["default", "glogen"])
def generator(request: pytest.FixtureRequest) -> TrainedGenerator:
    motions, labels = clips()
    blocks = request.param == "glogen"
    glogen = replace(SMALL, architecture="blocks", latent=0) if blocks else SMALL
    locgen = replace(DENSE, architecture="between", between=5, dropout=0) if blocks else DENSE
    read = [body_motion(motion, 30.0) for motion in motions]
    return fit_generator(read, labels, SynthesisConfig(recipe=request.param), glogen=glogen, locgen=locgen, onset=ONSET)


def wish(*classes: str, seconds: float = 3.0, seed: int = 0, **more: Any) -> MotionRequest:
    return MotionRequest(classes or ("walk",), seconds, seed, SeedClip("clip", swinging(60, 99), 30.0, BODY), **more)


def test_motions_are_those_of_a_body(generator: TrainedGenerator) -> None:
    made = generator.generate([wish(seconds=4.0)])[0]
    assert made.positions.shape == (120, 21, 3)
    assert made.fps == 30.0
    rebuilt = forward_kinematics(made.positions[:, 0], made.rotations, made.rest_offsets)
    np.testing.assert_allclose(rebuilt, made.positions, atol=1e-9)
    np.testing.assert_array_equal(made.rest_offsets, BODY)
    steps = np.linalg.norm(np.diff(made.positions, axis=0), axis=2)
    assert 0 < steps.mean() < 0.2
    assert (made.seed_start, made.class_starts) == (0, (0,))
    assert 0 < made.seed_stop < 60


def test_a_motion_begins_where_the_clip_is(generator: TrainedGenerator) -> None:
    asked = wish()
    made = generator.generate([asked])[0]
    there = asked.start.positions[made.seed_stop - 1]
    assert np.linalg.norm(made.positions[0, 0] - there[0]) < 0.15


def test_the_same_wish_gives_the_same_motion_whatever_is_beside_it(generator: TrainedGenerator) -> None:
    wishes = [wish(seed=i, seconds=2.0 + i % 3) for i in range(7)]
    together = generator.generate(wishes)
    for request, made in zip(wishes, together, strict=True):
        alone = generator.generate([request])[0]
        np.testing.assert_array_equal(alone.positions, made.positions)


def test_the_seed_and_the_temperature_say_what_chance_does(generator: TrainedGenerator) -> None:
    if not generator.glogen.recipe.latent:
        pytest.skip("the thesis's network has no latent variables")
    one, other = generator.generate([wish(seed=1), wish(seed=2)])
    assert np.abs(one.positions - other.positions).max() > 1e-3
    cold = generator.generate([wish(seed=1, temperature=0.0), wish(seed=2, temperature=0.0)])
    np.testing.assert_array_equal(cold[0].positions, cold[1].positions)


def test_classes_follow_each_other_in_equal_shares(generator: TrainedGenerator) -> None:
    made = generator.generate([wish("walk", "back", "walk", seconds=9.0)])[0]
    assert len(made.positions) == 270
    np.testing.assert_allclose(made.class_starts, [0, 90, 180], atol=20)
    assert not np.allclose(made.positions, generator.generate([wish(seconds=9.0)])[0].positions)


def test_whole_actions_fill_the_time() -> None:
    """Rows of .1 s each: an action of 1.5 s is made once in 2 s, slower; twice in 2.6 s, faster; cut off in .6 s."""
    block = np.zeros((15, WIDTH))
    block[:, DURATION] = np.log(0.1)
    for seconds, times, slower in ((2.0, 1, 4 / 3), (2.6, 2, 2.6 / 3), (0.6, 1, FASTEST)):
        course = Rollout(block[:5], [0], np.zeros((1, 4)), seconds, 1.0, [True])
        blocks = 0
        while not course.done:
            assert course.anew == (blocks > 0)
            course.take(block)
            blocks += 1
        assert blocks == times
        assert course.slowed == pytest.approx(slower, rel=1e-4)
        np.testing.assert_allclose(np.diff(course.times()), 0.1 * slower, rtol=1e-4)
        assert course.times()[-1] == pytest.approx(seconds, abs=0.1 * slower)
    course = Rollout(block[:5], [0, 1], np.zeros((2, 4)), 4.0, 1.0, [False, True])
    course.take(block)
    assert not course.anew
    course.take(block)
    assert course.slowed == 1.0
    assert course.target == 1
    assert course.anew
    np.testing.assert_allclose(np.diff(course.times()), 0.1, rtol=1e-9)


def test_an_action_goes_on_as_recorded_ones_did() -> None:
    """Bodies that come to rest; what is made is nearer to the rest of an unseen one than its last given pose."""
    eased = np.round(89 * (1 - np.cos(np.pi * np.linspace(0, 1, 80))) / 2).astype(int)
    actions = [
        np.concatenate([swinging(90, seed)[eased], np.repeat(swinging(90, seed)[89:], 10, axis=0)]) for seed in range(7)
    ]
    read = [body_motion(motion, 30.0) for motion in actions[:6]]
    recipe = replace(ONSET, width=64, epochs=12)
    made = fit_generator(read, ["bow"] * 6, SynthesisConfig(), glogen=SMALL, locgen=DENSE, onset=recipe)
    assert made.cyclic == [False]
    request = MotionRequest(("bow",), 1.0, 0, SeedClip("clip", actions[6], 30.0, BODY), temperature=0.0)
    start = start_state(request.start, 0, 20)
    assert 0 < start.state[-1] < 1.5
    true = body_motion(actions[6], 30.0).rows[start.last : start.last + 10, :60]
    ahead = made.onset.ahead(start.state, 0)
    assert ahead is not None
    held = np.linalg.norm(start.state[:60] - true, axis=1).mean()
    assert np.linalg.norm(ahead[:10, :60] - true, axis=1).mean() < 0.4 * held
    (one,) = made.generate([request])
    led = body_motion(one.positions, 30.0).rows[:10, :60]
    assert np.linalg.norm(led - true, axis=1).mean() < 0.8 * held


def test_of_a_class_no_more_poses_are_kept_than_its_motions_have() -> None:
    block = np.arange(15.0)[:, None] * np.ones(WIDTH)
    block[:, DURATION] = np.log(0.1)
    course = Rollout(block[:5], [0, 1], np.zeros((2, 4)), 2.0, 1.0, taken=[3, 15])
    for _ in range(4):
        course.take(block)
    assert [row[0] for row in course.rows] == [4, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0]
    assert course.target == 1
    course.take(block)
    assert [row[0] for row in course.rows[11:]] == list(range(10))


def test_pace_changes_the_tempo() -> None:
    motions, labels = clips()
    read = [body_motion(motion, 30.0) for motion in motions]
    fitted = fit_generator(read, labels, SynthesisConfig(), glogen=replace(SMALL, epochs=60), locgen=DENSE, onset=ONSET)
    slow, even, fast = fitted.generate([wish(seconds=4.0, temperature=0.0, pace=pace) for pace in (0.5, 1.0, 2.0)])

    def speed(made: GeneratedMotion, part: slice) -> float:
        return float(np.linalg.norm(np.diff(made.positions[part, 8] - made.positions[part, 0], axis=0), axis=1).mean())

    # While it goes on as recorded bodies did, and when that is over.
    for part in (slice(0, 15), slice(90, 120)):
        assert speed(slow, part) < 0.75 * speed(even, part)
        assert speed(fast, part) > 1.4 * speed(even, part)


def test_a_generator_is_kept_in_one_file(generator: TrainedGenerator, tmp_path: Path) -> None:
    file = tmp_path / "generator.safetensors"
    generator.save(file)
    again = load_generator(file)
    assert (again.classes, again.config, dict(again.metrics)) == (
        generator.classes, generator.config, dict(generator.metrics),
    )  # fmt: skip
    np.testing.assert_array_equal(again.generate([wish()])[0].positions, generator.generate([wish()])[0].positions)


def test_other_files_are_refused(generator: TrainedGenerator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from motionlake.deephums.config import PRETRAINED_DESCRIPTORS

    with pytest.raises(ValueError, match="holds no motion generator"):
        load_generator(PRETRAINED_DESCRIPTORS.file)
    (tmp_path / "damaged.safetensors").write_bytes(PRETRAINED_DESCRIPTORS.file.read_bytes()[:5000])
    with pytest.raises(ValueError, match=r"damaged.safetensors is damaged"):
        load_generator(tmp_path / "damaged.safetensors")
    monkeypatch.setattr("motionlake.glogen.generator.JOINTS", ("hips", "tail"))
    generator.save(tmp_path / "other.safetensors")
    monkeypatch.undo()
    with pytest.raises(ValueError, match="another skeleton: hips, tail"):
        load_generator(tmp_path / "other.safetensors")
    old = {"joints": list(JOINTS), "classes": ["walk"], "going": [False], "figures": {}}
    save_network(tmp_path / "old.safetensors", generator.locgen, METADATA_KEY, old)
    with pytest.raises(ValueError, match="earlier version; train one anew"):
        load_generator(tmp_path / "old.safetensors")


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (wish("fly"), "'fly'"),
        (replace(wish(), classes=()), "no class"),
        (wish(seconds=0.0), "0.0 seconds"),
        (wish(seconds=float("nan")), "nan seconds"),
        (wish(seconds=float("inf")), "inf seconds"),
        (wish(pace=0.0), "pace 0.0"),
        (wish(temperature=-1.0), "temperature -1.0"),
        (replace(wish(), start=SeedClip("short", swinging(5), 30.0, BODY)), "short lasts 0.17 s; .* needs 0.80 s"),
        (replace(wish(), start=SeedClip("hand", np.zeros((50, 9, 3)), 30.0, BODY)), "hand is of another skeleton"),
    ],
)
def test_what_cannot_be_made_is_said(generator: TrainedGenerator, asked: MotionRequest, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        generator.generate([asked])


def test_long_motion_neither_freezes_nor_runs_away(generator: TrainedGenerator) -> None:
    made = generator.generate([wish(seconds=20.0)])[0]
    body = made.positions - made.positions[:, :1]
    seconds = np.linalg.norm(np.diff(body, axis=0), axis=2).mean(axis=1)[:590].reshape(-1, 59).mean(axis=1)
    assert np.isfinite(made.positions).all()
    assert seconds.max() < 0.1


def test_training_is_the_same_again_and_tells_its_progress() -> None:
    motions, labels = clips(3)
    told: list[tuple[int, int]] = []
    material: Sequence[TrainingMotion] = [TrainingMotion(*one) for one in zip(motions, [30.0] * 6, labels, strict=True)]
    config = SynthesisConfig(seed=5, epochs=2)
    one = train_generator(material, config, progress=lambda done, all_, _: told.append((done, all_)))
    other = train_generator(material, config)
    # Both classes go on: two networks of GloGen, one of LocGen, one of the onset.
    assert told == [(epoch, 8) for epoch in range(1, 9)]
    assert (one.metrics["clips"], one.metrics["classes"], one.classes) == (6, 2, ["back", "walk"])
    np.testing.assert_array_equal(one.generate([wish()])[0].positions, other.generate([wish()])[0].positions)
    with pytest.raises(ValueError, match="no clips"):
        train_generator([], config)


def test_training_goes_on_at_the_network_it_was_interrupted_at(tmp_path: Path) -> None:
    motions, labels = clips(3)
    material = [TrainingMotion(*one) for one in zip(motions, [30.0] * 6, labels, strict=True)]
    config = SynthesisConfig(seed=5, epochs=2)
    told: list[int] = []

    def stop(done: int, _all: int, _loss: float) -> None:
        told.append(done)
        if told == [1, 2, 3]:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_generator(material, config, checkpoint=tmp_path / "training.safetensors", progress=stop)
    resumed = train_generator(material, config, checkpoint=tmp_path / "training.safetensors", progress=stop)
    assert told == [1, 2, 3, 3, 4, 5, 6, 7, 8]
    assert list(tmp_path.iterdir()) == []
    again = train_generator(material, config)
    np.testing.assert_array_equal(resumed.generate([wish()])[0].positions, again.generate([wish()])[0].positions)


def test_a_class_that_goes_on_learns_from_its_own_motions_alone() -> None:
    motions, labels = clips()
    read = [body_motion(motion, 30.0) for motion in motions]
    both = fit_generator(read, labels, SynthesisConfig(), glogen=SMALL, locgen=DENSE, onset=ONSET)
    alone = fit_generator(read[:8], labels[:8], SynthesisConfig(), glogen=SMALL, locgen=DENSE, onset=ONSET)
    assert (both.classes, both.cyclic, both.glogen.of) == (["back", "walk"], [True, True], [[0], [1]])
    for name, value in alone.glogen.network(0).state_dict().items():
        torch.testing.assert_close(both.glogen.network(1).state_dict()[name], value, rtol=0, atol=0)


def test_networks_know_every_class_once() -> None:
    assert groups([False, False], [True, True]) == [[0, 1]]
    assert groups([True, False, True, False], [True] * 4) == [[1, 3], [0], [2]]
    assert groups([True, True], [True, True]) == [[0], [1]]
    assert groups([True, True, False], [True, False, True]) == [[1, 2], [0]]
    # Nothing to learn the others from: they join one that can be learned.
    assert groups([True, True, False], [True, False, False]) == [[0, 1, 2]]
