"""GloGen: sparse poses of a class from five sparse poses."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
import torch
from motionlake.glogen.config import SEEDS, GloGenRecipe, glogen_recipe
from motionlake.glogen.network import ParallelDecoder, Seq2Seq, StartPoses, glogen_network
from motionlake.glogen.rollout import SPEED, led_over, predict
from motionlake.glogen.sparse import DURATION, HEIGHT, JOINT_COLUMNS, WIDTH
from motionlake.glogen.training import _block_loss, _error, epochs_of, train_glogen, unseen

SMALL = GloGenRecipe(
    embedding=16, state=32, layers=1, latent=4, dropout=0.0, epochs=20, batch=16, steps=0, going_steps=0
)


def toy(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """[n, 20, 65] motions of two classes that begin alike: one then goes up, the other down."""
    rng = np.random.default_rng(seed)
    targets = np.arange(count) % 2
    time = np.linspace(0, 1, 20)
    rows = 0.02 * rng.standard_normal((count, 1, WIDTH)) + np.zeros((count, 20, WIDTH))
    rows += np.where(targets, 1, -1)[:, None, None] * np.maximum(0, time - 0.2)[None, :, None] * 0.5
    rows[..., DURATION] = np.log(0.1)
    return rows.astype(np.float32), targets


def following(network: ParallelDecoder | Seq2Seq, rows: np.ndarray, targets: np.ndarray) -> np.ndarray:
    latent = torch.zeros(len(rows), max(1, network.recipe.latent))
    with torch.inference_mode():
        given = network.scale(torch.from_numpy(rows[:, :SEEDS]))
        return network.scale.back(network(given, torch.from_numpy(targets), latent)).numpy()


@pytest.mark.parametrize(
    "recipe",
    [SMALL, replace(SMALL, architecture="blocks", latent=0, learning_rate=1e-2)],
    ids=["ahead", "blocks"],
)
def test_the_class_says_where_motion_goes(recipe: GloGenRecipe) -> None:
    rows, targets = toy(64)
    asked, wanted = toy(16, seed=1)
    network, losses = train_glogen(list(rows), targets, 2, recipe, 0)
    assert losses[-1] < losses[0]
    made = following(network, asked, wanted)
    assert made.shape == (16, 15, WIDTH)
    error = np.abs(made - asked[:, SEEDS:])[..., :HEIGHT].mean()
    held = np.abs(asked[:, SEEDS - 1 : SEEDS] - asked[:, SEEDS:])[..., :HEIGHT].mean()
    assert error < 0.3 * held
    other = following(network, asked, 1 - wanted)
    assert (np.sign(other[:, -1, :HEIGHT].mean(axis=1)) == -np.sign(made[:, -1, :HEIGHT].mean(axis=1))).all()


def test_the_thesis_network_has_its_sizes_and_iterates_five_poses() -> None:
    recipe = glogen_recipe("glogen")
    assert (recipe.embedding, recipe.state, recipe.batch, recipe.learning_rate) == (200, 1000, 64, 0.1)
    network = glogen_network(recipe, 7).eval()
    assert isinstance(network, Seq2Seq)
    assert network.embed.in_features == WIDTH + 7
    given, targets = torch.randn(2, SEEDS, WIDTH), torch.tensor([3, 6])
    with torch.inference_mode():
        # Section 4.4: the states of five poses, 1,000 numbers each, are all given to the decoder.
        assert network.states(given, targets).shape == (2, SEEDS, 1000)
        made = network(given, targets, torch.zeros(2, 1))
        first = network.block(given, targets)
        second = network.block(first, targets)
        torch.testing.assert_close(made, torch.cat([first, second, network.block(second, targets)], dim=1))
        assert not torch.allclose(made, network(given, torch.tensor([4, 6]), torch.zeros(2, 1)))


def test_the_embedding_of_a_motion_is_that_of_its_fives_one_after_the_other() -> None:
    """Section 4.4: 4,000 numbers of 20 sparse poses, five by five; by class, and without one."""
    rows, targets = torch.randn(3, 20, WIDTH), torch.tensor([0, 1, 1])
    for recipe, width in ((glogen_recipe("glogen"), 1000), (SMALL, SMALL.embedding)):
        network = glogen_network(recipe, 2).eval()
        with torch.inference_mode():
            found = network.embedding(rows, targets)
            assert found.shape == (3, 4 * width)
            third = network.read(rows[:, 10:15], network.prior(targets))
            torch.testing.assert_close(found[:, 2 * width : 3 * width], third)
            torch.testing.assert_close(network.embedding(rows[:1], targets[:1]), found[:1])
            alone = network.embedding(rows)
            assert not torch.allclose(alone, found)
            torch.testing.assert_close(alone - found, (alone - found)[:, :width].repeat(1, 4), atol=1e-4, rtol=1e-4)


@pytest.mark.parametrize("sparse", [16, 24])
def test_other_numbers_of_sparse_poses(sparse: int) -> None:
    network = glogen_network(replace(glogen_recipe("glogen"), sparse=sparse, state=8, embedding=8), 2)
    made = network(torch.zeros(1, SEEDS, WIDTH), torch.tensor([0]), torch.zeros(1, 1))
    assert made.shape == (1, sparse - SEEDS, WIDTH)


def test_latent_numbers_vary_what_is_left_open() -> None:
    rows, targets = toy(64)
    network, _ = train_glogen(list(rows), targets, 2, replace(SMALL, epochs=5), 0)
    given, wanted = network.scale(torch.from_numpy(rows[:1, :SEEDS])), torch.tensor([0])
    with torch.inference_mode():
        made = [network(given, wanted, value * torch.ones(1, 4)) for value in (0.0, 0.0, 2.0)]
    torch.testing.assert_close(made[0], made[1])
    assert (made[0] - made[2]).abs().max() > 1e-4


def test_chance_makes_as_many_kinds_of_motion_as_there_are() -> None:
    """The same given poses go on in two ways, and so do samples."""
    rng = np.random.default_rng(0)
    rows = 0.002 * rng.standard_normal((96, 20, WIDTH)).astype(np.float32)
    rows[::2, SEEDS:, :30] += 0.2
    rows[1::2, SEEDS:, :30] -= 0.2
    network, _ = train_glogen(list(rows), np.zeros(96, dtype=np.int64), 1, replace(SMALL, noise=0.0), 0)
    given = np.repeat(rows[:1, :SEEDS], 200, axis=0)
    made = predict(network, given, np.zeros(200, dtype=np.int64), rng.standard_normal((200, 4)))[:, -1, :30].mean(
        axis=1
    )
    assert 0.25 < (made > 0).mean() < 0.75
    assert np.abs(made).mean() > 0.05


def test_foreign_poses_are_brought_to_where_the_class_begins() -> None:
    """Two classes whose given poses are far apart; one of them goes on, at one of two phases."""
    near, far = torch.zeros(6, SEEDS, WIDTH), torch.ones(6, SEEDS, WIDTH)
    spread = 0.1 * torch.linspace(-1, 1, 6)[:, None, None]
    phases = torch.cat([far + spread, far + 4 + spread])
    beginnings = StartPoses(2, 2)
    beginnings.learn([near + spread, phases], [False, True])
    torch.testing.assert_close(beginnings.poses[0], torch.zeros(2, SEEDS, WIDTH))
    assert sorted(beginnings.poses[1, :, 0, 0].round().tolist()) == [1.0, 5.0]
    given = torch.stack([near[0] + 0.05, far[0] + 0.05, near[0] + 0.05])
    met = beginnings(given, torch.tensor([0, 0, 1]), torch.zeros(3, dtype=torch.bool))
    torch.testing.assert_close(met[0], given[0])
    torch.testing.assert_close(met[1], torch.zeros(SEEDS, WIDTH), atol=1e-6, rtol=0)
    torch.testing.assert_close(met[2], beginnings.poses[1, beginnings.poses[1, :, 0, 0].argmin()])
    again = beginnings(given[:1], torch.tensor([0]), torch.tensor([True]))
    torch.testing.assert_close(again[0], torch.zeros(SEEDS, WIDTH), atol=1e-6, rtol=0)
    alone = StartPoses(1)
    alone.learn([near + spread], [False])
    torch.testing.assert_close(alone(far[:1], torch.tensor([0]), torch.tensor([False])), far[:1])


def test_what_is_made_is_led_over_to_from_foreign_poses() -> None:
    made = torch.zeros(2, 4, WIDTH)
    made[..., DURATION] = math.log(0.1)
    apart = torch.zeros(2, WIDTH)
    apart[1, JOINT_COLUMNS] = 1 / math.sqrt(3)  # one body length a joint
    led = led_over(made, apart)
    torch.testing.assert_close(led[0], made[0])
    torch.testing.assert_close(led[1, 1:], made[1, 1:])
    torch.testing.assert_close(led[1, 0, JOINT_COLUMNS], made[1, 0, JOINT_COLUMNS])
    assert float(led[1, 0, DURATION].exp()) == pytest.approx(1 / SPEED)


@pytest.mark.parametrize("architecture", ["ahead", "blocks"])
def test_a_class_can_be_had_from_poses_of_another(architecture: Literal["ahead", "blocks"]) -> None:
    """Classes that begin far apart; the thesis's network is given the foreign poses as they are."""
    rows, targets = toy(64)
    rows[..., :HEIGHT] += 2 * targets[:, None, None]
    recipe = replace(SMALL, architecture=architecture, latent=4 if architecture == "ahead" else 0)
    network, _ = train_glogen(list(rows), targets, 2, recipe, 0)
    made = predict(network, rows[:8, :SEEDS], 1 - targets[:8], np.zeros((8, 4)))
    assert made.shape == (8, 15, WIDTH)
    if architecture == "ahead":
        wanted = rows[1 - targets[:8], SEEDS:, :HEIGHT]  # row 0 is of class 0, row 1 of class 1
        assert np.abs(made[:, 2:, :HEIGHT] - wanted[:, 2:]).mean() < 0.25


def test_the_error_is_that_of_the_poses_there_are_joints_before_the_rest() -> None:
    rng = np.random.default_rng(4)
    made, true = (rng.standard_normal((3, 7, WIDTH)) for _ in range(2))
    there = np.arange(7) < np.array([[7], [3], [0]])
    expected = []
    for motion, pose in zip(*np.nonzero(there), strict=True):
        apart = (made[motion, pose] - true[motion, pose]) ** 2
        expected.append(apart[:HEIGHT].mean() + apart[HEIGHT:].mean() / 4)
    found = _error(*(torch.from_numpy(values) for values in (made, true, there)))
    assert float(found) == pytest.approx(np.mean(expected))
    assert float(_error(torch.ones(1, 2, WIDTH), torch.zeros(1, 2, WIDTH), torch.zeros(1, 2))) == 0, "no pose is there"


def test_blocks_are_measured_from_the_five_poses_before_each() -> None:
    network = glogen_network(replace(glogen_recipe("glogen"), state=8, embedding=8, missing=0.0), 2).eval()
    assert isinstance(network, Seq2Seq)
    scaled, targets = torch.randn(3, 18, WIDTH), torch.tensor([0, 1, 0])
    errors = []
    for start, stop in ((5, 10), (10, 15), (15, 18)):
        made = network.block(scaled[:, start - 5 : start], targets)[:, : stop - start]
        errors.append(float((made - scaled[:, start:stop]).square().mean().detach()))
    found = _block_loss(network, scaled, targets, np.random.default_rng(0))
    assert float(found.detach()) == pytest.approx(np.mean(errors), rel=1e-5)


def test_joints_that_are_not_seen_stand_at_their_mean() -> None:
    scaled = 1 + torch.rand(200, SEEDS, WIDTH)
    seen = unseen(scaled, 0.2, np.random.default_rng(0))
    gone = (seen[..., :HEIGHT].reshape(200, SEEDS, -1, 3) == 0).all(dim=3)
    assert torch.equal(gone, gone[:, :1].expand_as(gone))  # in all poses of a motion
    assert 0.15 < gone.float().mean() < 0.25
    torch.testing.assert_close(seen[..., HEIGHT:], scaled[..., HEIGHT:])
    assert torch.equal(unseen(scaled, 0.0, np.random.default_rng(0)), scaled)


def test_training_goes_on_from_its_checkpoint(tmp_path: Path) -> None:
    rows, targets = toy(32)
    recipe = replace(SMALL, epochs=14, dropout=0.1, steps=0)
    whole, losses = train_glogen(list(rows), targets, 2, recipe, 3)
    again, _ = train_glogen(list(rows), targets, 2, recipe, 3)
    file = tmp_path / "glogen.safetensors"

    def stop(done: int, _epochs: int, _loss: float) -> None:
        if done == 12:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_glogen(list(rows), targets, 2, recipe, 3, checkpoint=file, progress=stop)
    assert file.is_file()
    resumed, resumed_losses = train_glogen(list(rows), targets, 2, recipe, 3, checkpoint=file)
    assert not file.is_file()
    assert resumed_losses == pytest.approx(losses)
    for name, value in whole.state_dict().items():
        torch.testing.assert_close(resumed.state_dict()[name], value)
        torch.testing.assert_close(again.state_dict()[name], value)


def test_a_class_that_goes_on_is_learned_from_any_pose_on() -> None:
    """Long waves at any phase: what follows is known from the phase, not from the place in the motion."""
    rng = np.random.default_rng(0)

    def waves(count: int, poses: int) -> list[np.ndarray]:
        made = []
        for phase in rng.uniform(0, 2 * np.pi, count):
            wave = np.sin(phase + np.arange(poses)[:, None] * 0.6 + np.linspace(0, 3, WIDTH))
            made.append((0.2 * wave).astype(np.float32))
        return made

    recipe = replace(SMALL, epochs=10, state=64, noise=0.0)
    motions = [*waves(10, 60), *waves(4, 14)]
    network, _ = train_glogen(motions, np.zeros(14, dtype=np.int64), 1, recipe, 0, cyclic=[True])
    asked = np.stack(waves(20, 20))
    made = following(network, asked, np.zeros(20, dtype=np.int64))
    error = np.abs(made - asked[:, SEEDS:]).mean()
    assert error < 0.35 * np.abs(asked[:, SEEDS:]).mean()  # the mean pose is zero


def test_motions_that_overlap_make_epochs_no_longer() -> None:
    rng = np.random.default_rng(0)
    motions = [rng.standard_normal((20, WIDTH)).astype(np.float32) for _ in range(40)]
    targets = np.arange(40) % 2
    recipe = replace(SMALL, epochs=3, batch=4)
    told: list[int] = []
    for share in (1.0, 0.25):
        train_glogen(
            motions, targets, 2, recipe, 0, cyclic=[True, False], share=share,
            progress=lambda done, of, _: told.append(of),
        )  # fmt: skip
        assert told[-1] == epochs_of([20] * 40, targets.tolist(), [True, False], recipe, share)
    # Of the class that goes on three windows a motion, of the other one: 80 in all, or 35.
    least = replace(recipe, epochs=1, steps=20)
    assert epochs_of([20] * 40, targets.tolist(), [True, False], least) == 1
    assert epochs_of([20] * 40, targets.tolist(), [True, False], least, 0.25) == 3
