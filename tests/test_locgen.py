"""LocGen: from sparse poses to dense motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.glogen.config import LocGenRecipe, locgen_recipe
from motionlake.glogen.inbetweening import (
    DenseDecoder,
    Inbetweener,
    _examples,
    between,
    dense_motions,
    interpolated_motion,
    locgen_network,
    poses_between,
    train_locgen,
)
from motionlake.glogen.sparse import DURATION, HEIGHT, STEP, TURN, TrainingPiece, pieces
from motionlake.glogen.trajectories import FPS, body_motion

from tests.test_trajectories import swinging

FRAMES = LocGenRecipe(embedding=16, state=16, epochs=3, steps=0)
BETWEEN = LocGenRecipe(architecture="between", between=5, embedding=16, state=32, dropout=0, epochs=150, batch=4)


@pytest.fixture(scope="module")
def walks() -> list[TrainingPiece]:
    return pieces([body_motion(swinging(80 + 5 * i, i), 30.0) for i in range(12)], [0] * 12)


@settings(max_examples=50, deadline=None)
@given(st.integers(1, 20), st.integers(0, 2**32 - 1))
def test_equation_4_3_runs_from_a_pose_to_the_next(count: int, seed: int) -> None:
    first, second = np.random.default_rng(seed).standard_normal((2, 7))
    poses = between(first, second, count)
    expected = np.array(
        [[a + (b - a) * j / count for a, b in zip(first, second, strict=True)] for j in range(1, count + 1)]
    )
    np.testing.assert_allclose(poses, expected, atol=1e-12)
    np.testing.assert_allclose(poses[-1], second)
    away = np.linalg.norm(poses - first, axis=1)
    assert (np.diff(away) > 0).all()  # as printed, the poses would come back to X_i


def test_interpolated_motion_passes_the_sparse_poses_and_keeps_the_way(walks: list[TrainingPiece]) -> None:
    rows, places = walks[0].sparse.rows, walks[0].sparse.places
    times = places / FPS
    np.testing.assert_allclose(np.cumsum(np.exp(rows[1:, DURATION])), times[1:], atol=1e-6)
    found = interpolated_motion(rows, times, times)
    np.testing.assert_allclose(found[:, : HEIGHT + 1], rows[:, : HEIGHT + 1], atol=1e-9)
    # Fine steps from one pose to the next lead as far as the row of the next says.
    for i in (0, 7, 18):
        at = np.linspace(times[i], times[i + 1], 2001)[:-1]
        fine = interpolated_motion(rows, times, at)
        step = (times[i + 1] - times[i]) / 2000
        turned = np.concatenate([[0], np.cumsum(fine[:-1, HEIGHT + 3] * step)])
        left, forward = fine[:, HEIGHT + 1], fine[:, HEIGHT + 2]
        way = np.stack(
            [left * np.cos(turned) + forward * np.sin(turned), forward * np.cos(turned) - left * np.sin(turned)], axis=1
        )
        np.testing.assert_allclose(way.sum(axis=0) * step, rows[i + 1, STEP], atol=1e-3)
        assert turned[-1] == pytest.approx(rows[i + 1, TURN], abs=1e-3)


@pytest.mark.parametrize("recipe", [FRAMES, BETWEEN], ids=["frames", "between"])
def test_dense_motion_follows_real_motion(walks: list[TrainingPiece], recipe: LocGenRecipe) -> None:
    network, losses = train_locgen(walks, recipe, 0)
    assert losses[-1] < losses[0]
    asked = walks[3]
    frames = len(asked.motion) - 1
    made = dense_motions(network, [asked.sparse.rows], [asked.sparse.places / FPS], frames)[0]
    assert len(made) == frames
    apart = np.linalg.norm(made.joints - asked.motion.joints[1:], axis=2).mean()
    still = np.linalg.norm(asked.motion.joints[:1] - asked.motion.joints[1:], axis=2).mean()
    assert apart < 0.25 * still
    assert np.abs(made.velocity - asked.motion.velocity[1:]).mean() < 0.1


def test_a_motion_does_not_depend_on_those_beside_it(walks: list[TrainingPiece]) -> None:
    network, _ = train_locgen(walks, FRAMES, 0)
    rows, times = [w.sparse.rows for w in walks], [w.sparse.places / FPS for w in walks]
    together, alone = dense_motions(network, rows, times, 50)[5], dense_motions(network, rows[5:6], times[5:6], 50)[0]
    np.testing.assert_array_equal(together.joints, alone.joints)


def test_the_thesis_reads_five_poses_between_two(walks: list[TrainingPiece]) -> None:
    recipe = locgen_recipe("glogen")
    assert (recipe.between, recipe.embedding, recipe.state, recipe.learning_rate) == (5, 200, 1000, 0.1)
    network = locgen_network(recipe)
    assert isinstance(network, Inbetweener)
    assert network(torch.zeros(2, 5, HEIGHT + 1)).shape == (2, 5, HEIGHT + 1)
    pairs = poses_between(walks[0], 5)
    assert len(pairs) == 19
    for i, (interpolated, real) in enumerate(pairs):
        np.testing.assert_allclose(interpolated[-1], walks[0].sparse.rows[i + 1, : HEIGHT + 1], atol=1e-9)
        np.testing.assert_allclose(real[-1], interpolated[-1], atol=1e-9)


def test_poses_between_are_measured_against_the_real_ones(walks: list[TrainingPiece]) -> None:
    network = locgen_network(BETWEEN).eval()
    assert isinstance(network, Inbetweener)
    pairs = [pair for walk in walks[:2] for pair in poses_between(walk, BETWEEN.between)]
    errors = []
    with torch.no_grad():
        for given_poses, real in pairs:
            made = network(torch.from_numpy(given_poses)[None].float())
            errors.append(float((made - network.scale(torch.from_numpy(real)[None].float())).square().mean()))
        loss, count = _examples(network, walks[:2], np.random.default_rng(0))
        assert count == len(pairs) == 38, "an example is what lies between two poses, as the thesis has batches"
        assert float(loss(np.arange(count))) == pytest.approx(np.mean(errors), rel=1e-5)
        assert float(loss(np.array([7]))) == pytest.approx(errors[7], rel=1e-5)


def test_training_goes_on_from_its_checkpoint(walks: list[TrainingPiece], tmp_path: Path) -> None:
    recipe = LocGenRecipe(embedding=8, state=8, epochs=8, steps=0)
    whole, _ = train_locgen(walks, recipe, 1)
    file = tmp_path / "locgen.safetensors"

    def stop(done: int, _epochs: int, _loss: float) -> None:
        if done == 6:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_locgen(walks, recipe, 1, checkpoint=file, progress=stop)
    assert file.is_file()
    resumed, _ = train_locgen(walks, recipe, 1, checkpoint=file)
    for name, value in whole.state_dict().items():
        torch.testing.assert_close(resumed.state_dict()[name], value)


def test_frames_start_from_the_interpolated_poses(walks: list[TrainingPiece]) -> None:
    network = locgen_network(FRAMES).eval()
    assert isinstance(network, DenseDecoder)
    rows = torch.from_numpy(
        interpolated_motion(walks[0].sparse.rows, walks[0].sparse.places / FPS, np.arange(40) / FPS)
    )
    with torch.inference_mode():
        made = network(rows.float()[None])[0, :, :HEIGHT]
    torch.testing.assert_close(made, network.scale(rows.float())[:, :HEIGHT])
