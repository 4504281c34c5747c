"""The baselines of the DeepHuMS bench learn what is put before them, alike for one seed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import torch
from motionlake.deephums.batches import resampled
from torch import nn

from bench.deephums.autoencoder import DeepAutoencoder
from bench.deephums.baseline import velocities
from bench.deephums.fit import Clips, embed, fit, split_subject
from bench.deephums.hcn import HierarchicalCooccurrence
from bench.deephums.indrnn import IndependentlyRecurrent, _recur
from bench.fitting import Budget, one_cycle

CLASSES = 4
FRAMES = 32


def toy(seed: int = 0, count: int = 40) -> Clips:
    """Clips of four classes: another joint swings, at a random phase and speed, in a slightly noisy posture."""
    random = np.random.default_rng(seed)
    posture = random.standard_normal((15, 3)) / 3
    sequences, labels = [], np.arange(count) % CLASSES
    for label in labels:
        frames = int(random.integers(20, 90))
        clip = posture + 0.02 * random.standard_normal((frames, 15, 3))
        swing = np.sin(np.linspace(0, random.uniform(3, 6), frames) + random.uniform(0, 1))
        clip[:, 3 * label : 3 * label + 3, 1] += 0.5 * swing[:, None]
        sequences.append(clip.astype(np.float32))
    return Clips(
        np.stack([resampled(sequence, FRAMES) for sequence in sequences]),
        labels.astype(np.int64),
        tuple(f"s{i // 8}" for i in range(count)),
    )


NETWORKS: dict[str, tuple[Callable[[], nn.Module], int, int]] = {
    "autoencoder": (lambda: DeepAutoencoder(FRAMES, (96, 64, 48, 32, 16)), 80, 50),
    "hcn": (lambda: HierarchicalCooccurrence(CLASSES, FRAMES, dropout=0.0, base=16), 256, 70),
    "indrnn": (lambda: IndependentlyRecurrent(CLASSES, FRAMES, hidden=64, layers=2, dropout=0.0), 64, 40),
}


@pytest.mark.parametrize("name", NETWORKS)
def test_a_baseline_overfits_forty_clips(name: str) -> None:
    build, width, epochs = NETWORKS[name]
    clips = toy()
    found = fit(build, clips, Budget(epochs=epochs, learning_rate=5e-3), seed=0)
    assert len(found.epochs) == epochs
    embeddings, logits = embed(found.network, clips.x)
    assert embeddings.shape == (40, width)
    assert np.isfinite(embeddings).all()
    if logits is None:
        assert found.epochs[-1].loss < 0.5 * found.epochs[0].loss
    else:
        assert np.mean(logits.argmax(axis=1) == clips.labels) == 1
    apart = np.linalg.norm(embeddings[:, None] - embeddings, axis=2) + 1e9 * np.eye(40)
    assert np.mean(clips.labels[apart.argmin(axis=1)] == clips.labels) > 0.9


def test_training_is_the_same_for_one_seed_and_told_by_epoch() -> None:
    known, held = split_subject(toy())
    assert set(held.subjects) == {"s4"}
    assert len(known.labels) == 32

    def shaken(x: torch.Tensor, _labels: torch.Tensor) -> torch.Tensor:
        return x + 0.05 * torch.randn_like(x)

    def train(seed: int, held_out: Clips | None = held) -> tuple[list[float], np.ndarray, list[float | None]]:
        found = fit(
            NETWORKS["indrnn"][0], known, Budget(epochs=3), seed=seed, held_out=held_out, augment=shaken
        )  # fmt: skip
        told = [value for epoch in found.epochs for value in (epoch.retrieval, epoch.recognition)]
        return [epoch.loss for epoch in found.epochs], embed(found.network, held.x)[0], told

    (losses, embeddings, told), (again, same, _) = train(1), train(1)
    assert losses == again
    np.testing.assert_array_equal(embeddings, same)
    assert all(value is not None and 0 <= value <= 1 for value in told)
    unseen = train(1, None)
    assert unseen[0] == losses  # validation changes nothing
    assert unseen[2] == [None] * 6
    assert train(2)[0] != losses


def test_the_budget_ends_training() -> None:
    found = fit(NETWORKS["autoencoder"][0], toy(), Budget(epochs=1000, seconds=0.2), seed=0)
    assert 1 <= len(found.epochs) < 1000
    assert found.epochs[-1].seconds >= 0.2
    rates = [one_cycle(done) for done in (0.0, 0.15, 0.3, 0.65, 1.0)]
    assert rates == pytest.approx([0.04, 0.52, 1.0, 0.5, 0.0])
    with pytest.raises(ValueError, match="cannot be held out"):
        split_subject(toy(), "nobody")


def test_the_recurrence_is_that_of_the_paper() -> None:
    random = torch.Generator().manual_seed(0)
    entered, weights = torch.randn(7, 2, 5, generator=random), torch.randn(5, generator=random)
    state = np.zeros((2, 5))
    for given, found in zip(entered.numpy(), _recur(entered.unbind(0), weights), strict=True):
        state = np.maximum(given + weights.numpy() * state, 0)
        np.testing.assert_allclose(found.numpy(), state, rtol=1e-5, atol=1e-6)


def test_velocities_are_motion_to_the_next_frame() -> None:
    ramp = torch.linspace(0, 1, 64)[None, :, None, None].repeat(1, 1, 15, 3)
    moved = velocities(ramp)
    assert torch.allclose(moved[0, :-1], torch.tensor(1 / 63), atol=1e-6)
    assert not moved[0, -1].any()
