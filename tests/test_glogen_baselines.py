"""The baselines of synthesis learn what is put before them, alike for one seed, fed as their papers say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from bench.fitting import Budget
from bench.glogen.baseline import Baseline, Settings, Shape, with_prior
from bench.glogen.choosing import SPARSE_TRIED, candidates, choose
from bench.glogen.hp_gan import CriticNetwork, HpGan, critic_loss, gradient_penalty
from bench.glogen.methods import DENSE, SPARSE, UNTRAINED, measure_dense, measure_sparse
from bench.glogen.motions import DENSE_TASK, SPARSE_TASK, Motions, hold_out, joint_error, windows_of
from bench.glogen.next_pose import AutoConditioned, NextPose, ScheduledSampling, truth_probability

CLASSES = 3
JOINTS = 4
BONES = ((0, 1), (1, 2), (2, 3))
SETTINGS = Settings(hidden=32, budget=Budget(epochs=50, learning_rate=2e-2))
SHORT = replace(SETTINGS, budget=Budget(epochs=2, learning_rate=1e-2))
METHODS = [("sparse", name) for name in SPARSE] + [("dense", name) for name in DENSE]
WITH_CHANCE = ("vae_seq2seq", "hp_gan")


def toy(kind: str, seed: int, count: int) -> Motions:
    """Motions of three classes: each swings the body along another axis, as far as the first joint is away."""
    random = np.random.default_rng(seed)
    poses = 20 if kind == "sparse" else 60
    classes = np.arange(count) % CLASSES
    made = np.zeros((count, poses, JOINTS, 3))
    made[:, :, 1:, 1] = 1 + np.arange(JOINTS - 1)
    size = random.uniform(0.5, 1.5, count)
    made[:, :, 0, 0] = size[:, None]
    swing = np.sin(np.maximum(np.arange(poses) - 4, 0) / 4) if kind == "sparse" else np.sin(np.arange(poses) / 4)
    made[np.arange(count), :, 1:, classes] += (size[:, None] * swing)[..., None]
    made += 0.01 * random.standard_normal(made.shape)
    groups = tuple(f"g{i // CLASSES % 4}" for i in range(count))
    return Motions(made.reshape(count, poses, -1).astype(np.float32), classes.astype(np.int64), CLASSES, groups, BONES)


def asked(kind: str, data: Motions) -> tuple[np.ndarray, np.ndarray]:
    """What is given of motions, and what follows."""
    poses = np.stack(list(data.poses))
    start, stop = (5, 20) if kind == "sparse" else (25, 45)
    return poses[:, :start], poses[:, start:stop]


def fitted(kind: str, name: str, settings: Settings, seed: int = 0) -> Baseline:
    method: Baseline = {"sparse": SPARSE, "dense": DENSE}[kind][name](settings)
    method.fit(toy(kind, 0, 30 if kind == "sparse" else 15), seed)
    return method


@pytest.mark.parametrize(("kind", "name"), METHODS)
def test_a_method_learns_what_a_class_does(kind: str, name: str) -> None:
    method, test = fitted(kind, name, SETTINGS), toy(kind, 1, 30)
    pasts, truth = asked(kind, test)
    found = method.predict(pasts, test.classes)
    assert found.shape == truth.shape
    assert found.dtype == np.float32
    held = joint_error(np.repeat(pasts[:, -1:], truth.shape[1], axis=1), truth)
    if name == "zero_velocity":
        assert joint_error(found, truth) == held
        return
    # Without squared error among its losses, a critic needs longer than this test takes.
    share = 0.95 if name == "hp_gan" else 0.6
    assert joint_error(found, truth) < share * held
    other = method.predict(pasts, (test.classes + 1) % CLASSES)
    assert joint_error(other, truth) > 1.1 * joint_error(found, truth)


@pytest.mark.parametrize(("kind", "name"), METHODS)
def test_predictions_follow_from_the_seeds(kind: str, name: str) -> None:
    torch.manual_seed(torch.seed() % 2**32)  # whatever the state of the global generator
    first, again = fitted(kind, name, SHORT), fitted(kind, name, SHORT)
    test = toy(kind, 1, 30)
    pasts, _ = asked(kind, test)
    found = first.predict(pasts, test.classes)
    np.testing.assert_array_equal(again.predict(pasts, test.classes), found)
    np.testing.assert_array_equal(first.predict(pasts, test.classes), found)
    few = first.predict([past[-5:] for past in pasts[:3]], test.classes[:3])
    if kind == "sparse":
        np.testing.assert_allclose(few, found[:3], atol=1e-5)
    assert few.shape == (3, *found.shape[1:])
    drawn = [first.predict(pasts, test.classes, np.random.default_rng(seed)) for seed in (0, 0, 1)]
    np.testing.assert_array_equal(drawn[0], drawn[1])
    assert np.array_equal(drawn[0], drawn[2]) == (name not in WITH_CHANCE)
    assert np.array_equal(drawn[0], found) == (name not in WITH_CHANCE)
    if name not in UNTRAINED:
        assert not np.array_equal(fitted(kind, name, SHORT, seed=1).predict(pasts, test.classes), found)


def test_measurements_fit_on_train_and_predict_what_follows_in_test() -> None:
    seen = []

    def watched(poses: Tensor, classes: Tensor) -> Tensor:
        seen.append((tuple(poses.shape), classes.tolist()))
        return poses

    train, test = toy("sparse", 0, 60), toy("sparse", 1, 9)
    found = measure_sparse(train, test, "seq2seq", 0, replace(SHORT, augment=watched))
    assert found.shape == (9, 15, 3 * JOINTS)
    assert [shape for shape, _ in seen] == [(60, 20, 3 * JOINTS)] * 2
    assert sorted(seen[0][1]) == sorted(train.classes.tolist())
    assert seen[0][1] != seen[1][1]  # another order
    np.testing.assert_array_equal(found, measure_sparse(train, test, "seq2seq", 0, SHORT))
    frames, pasts = toy("dense", 0, 60), [motion[: 5 + i] for i, motion in enumerate(toy("dense", 1, 9).poses)]
    assert measure_dense(frames, pasts, test.classes, "aclstm", 0, SHORT).shape == (9, 20, 3 * JOINTS)
    alone = replace(frames, class_count=0)
    assert measure_dense(alone, pasts, test.classes, "seq2seq", 0, SHORT).shape == (9, 20, 3 * JOINTS)
    with pytest.raises(ValueError, match="too short"):
        measure_sparse(replace(train, poses=[motion[:19] for motion in train.poses]), test, "seq2seq", 0, SHORT)


def test_windows_hold_what_was_and_what_follows() -> None:
    data = Motions([np.arange(100.0)[:, None].repeat(3, 1).astype(np.float32)] * 40, np.arange(40), 40)
    windows = windows_of(data, DENSE_TASK, np.random.default_rng(0))
    assert windows.poses.shape == (360, 45, 3)  # a window ends at one of 76 places
    np.testing.assert_array_equal(windows.classes, np.arange(40).repeat(9))
    stops = windows.poses[:, 25, 0]
    assert stops.min() < 25 < 75 < stops.max() <= 80
    for poses, stop in zip(windows.poses[:, :, 0], stops, strict=True):
        np.testing.assert_array_equal(poses, np.maximum(np.arange(stop - 25, stop + 20), 0))


def test_the_nearest_real_motion_is_of_the_class() -> None:
    train, test = toy("sparse", 0, 60), toy("sparse", 1, 9)
    found = measure_sparse(train, test, "nearest_real", 0)
    for poses, label, predicted in zip(test.poses, test.classes, found, strict=True):
        rows = np.flatnonzero(train.classes == label)
        apart = [np.linalg.norm(train.poses[int(row)][:5] - poses[:5]) for row in rows]
        np.testing.assert_array_equal(predicted, train.poses[int(rows[np.argmin(apart)])][5:])


def shape(hidden: int = 8, residual: bool | None = None) -> Shape:
    return Shape(3, 2, 5, 15, Settings(hidden=hidden, residual=residual), ((0, 0),), torch.zeros(3))


def test_auto_conditioning_alternates_five_true_and_five_own_poses() -> None:
    network = AutoConditioned(shape())
    assert network.lstm.num_layers == 3
    pattern = network.truths(2, 19, 5, 0.7)
    assert pattern.tolist() == [[True] * 5 + [False] * 5 + [True] * 5 + [False] * 4] * 2


def test_scheduled_sampling_is_true_less_and_less_often() -> None:
    torch.manual_seed(0)
    k = 50
    iterations = 2 * k * np.log(k)
    for done in (0.0, 0.25, 0.5, 0.75, 1.0):
        assert truth_probability(done) == pytest.approx(k / (k + np.exp(done * iterations / k)))
    assert truth_probability(0.5) == pytest.approx(0.5)
    network = ScheduledSampling(shape())
    assert network.lstm.num_layers == 1
    for done in (0.0, 0.5, 1.0):
        truths = network.truths(2000, 19, 5, done)
        assert truths[:, :5].all()
        assert truths[:, 5:].float().mean().item() == pytest.approx(truth_probability(done), abs=0.02)
        assert truths[:, 5:].float().std(dim=0).min() > 0  # tossed for each example


@pytest.mark.parametrize("residual", [None, True])
def test_unrolling_is_that_of_one_step_after_the_other(residual: bool | None) -> None:
    torch.manual_seed(1)
    network: NextPose = AutoConditioned(shape(residual=residual))
    poses, prior, truths = torch.randn(4, 19, 3), torch.eye(2)[[0, 1, 1, 0]], torch.rand(4, 19) < 0.5
    truths[:, 7:12] = True
    with torch.no_grad():
        found = network.unroll(poses, prior, truths)
        state, last = None, poses[:, 0]
        for step in range(19):
            fed = torch.stack([poses[i, step] if step == 0 or truths[i, step] else last[i] for i in range(4)])
            out, state = network.lstm(with_prior(fed[:, None], prior), state)
            last = network.out(out[:, 0]) + (fed if residual else 0)
            torch.testing.assert_close(found[:, step], last)
        extended = network.extend(poses[:, :5], prior, None)
        own = network.unroll(poses, prior, torch.arange(19).expand(4, -1) < 5)
    torch.testing.assert_close(extended, own[:, 4:])


def test_the_penalty_draws_the_slope_of_the_critic_to_one() -> None:
    torch.manual_seed(0)
    real, false = torch.randn(16, 6) + 2, torch.randn(16, 6)
    for length in (0.25, 1.0, 3.0):
        slope = torch.full((6,), length / 6**0.5, requires_grad=True)
        penalty = gradient_penalty(lambda rows, slope=slope: rows @ slope, real, false)  # type: ignore[misc]
        assert penalty.item() == pytest.approx((length - 1) ** 2, abs=1e-5)
        (pull,) = torch.autograd.grad(penalty, slope)
        assert np.sign(pull.sum().item()).round() == np.sign(length - 1) or length == 1.0
    critic = CriticNetwork(6, 32)
    optimiser = torch.optim.Adam(critic.parameters(), 1e-2)
    for _ in range(60):
        optimiser.zero_grad()
        critic_loss(critic, real, false).backward()  # type: ignore[no-untyped-call]
        optimiser.step()
    assert critic(real).mean() > critic(false).mean() + 1  # greater is more real
    assert gradient_penalty(critic, real, false) < 0.2


def test_the_generator_of_hp_gan_trains_its_own_weights_only() -> None:
    torch.manual_seed(0)
    network = HpGan(Shape(12, 2, 5, 15, Settings(hidden=8), BONES, torch.arange(12.0)))
    assert not any(isinstance(part, CriticNetwork) for part in network.modules())
    poses = torch.zeros(2, 3, 12)
    joints = torch.arange(12.0).reshape(4, 3)
    torch.testing.assert_close(network.bone_lengths(poses)[0, 0], torch.linalg.vector_norm(joints.diff(dim=0), dim=1))
    before = nn.utils.parameters_to_vector(network.parameters()).clone()
    loss = network.loss(torch.randn(4, 5, 12), torch.randn(4, 15, 12), torch.eye(2)[[0, 1, 0, 1]], 0.0)
    torch.testing.assert_close(nn.utils.parameters_to_vector(network.parameters()), before, rtol=0, atol=0)
    loss.backward()  # type: ignore[no-untyped-call]
    assert all(parameter.grad is not None for parameter in network.parameters())


def test_settings_are_chosen_by_motions_held_out() -> None:
    data = toy("sparse", 0, 60)
    known, held = hold_out(data)
    assert set(held.groups) == {"g3"}
    assert len(known.poses) + len(held.poses) == 60
    few = replace(SETTINGS, budget=Budget(epochs=8))
    tried = [replace(few, hidden=16, budget=replace(few.budget, learning_rate=rate)) for rate in (1e-5, 1e-2)]
    found = choose(SPARSE_TASK, "seq2seq", data, tried, groups=("g0", "g1"))
    assert [each.settings.budget.learning_rate for each in found] == [1e-2, 1e-5]
    assert found[0].error < found[1].error
    assert len(choose(SPARSE_TASK, "zero_velocity", data, tried)) == 1
    assert len(candidates(SPARSE_TRIED)) == len(set(candidates(SPARSE_TRIED))) == 4
    with pytest.raises(ValueError, match="cannot be held out"):
        hold_out(data, "nobody")
