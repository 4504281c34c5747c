"""Training material and word networks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
import torch
from motionlake.arrays import Float32Array, Float64Array
from motionlake.deep_motifs.config import NetworkConfig
from motionlake.deep_motifs.words import training
from motionlake.deep_motifs.words.dtw import word_distances
from motionlake.deep_motifs.words.linear import LinearConfig, linear_embedding, nearest_elsewhere
from motionlake.deep_motifs.words.network import MovesBody, TrainedNetwork, load_network, moves
from motionlake.deep_motifs.words.training import Recipe, _triplet_loss, train_words
from motionlake.deep_motifs.words.triplets import TripletConfig, time_reversed, time_warped, training_words
from motionlake.glogen.config import Schedule
from motionlake.motion.dtw import frame_distances
from motionlake.motion.features import WordConfig, word_features, word_windows
from motionlake.training import optimiser_of, rate_of
from safetensors.numpy import save_file
from threadpoolctl import threadpool_limits

CONFIG = WordConfig(length=16, stride=4, root_weight=0.0, velocity_weight=0.0, smoothing=0.0)
FEW = Recipe(batch=16, pool=32)  # words a step
QUICK = Recipe(TripletConfig(anchors=60), batch=8, pool=16)


def clips(n: int, seed: int = 0) -> list[Float32Array]:
    """Smooth features: a few slow waves seen through 42 numbers, at each clip's own speed."""
    mix = np.random.default_rng(99).standard_normal((6, CONFIG.dimension)) * 0.1
    rng = np.random.default_rng(seed)
    made = []
    for _ in range(n):
        time = np.arange(rng.integers(10, 90))[:, None] * rng.uniform(0.7, 1.4)
        made.append((np.sin(time * [0.1, 0.17, 0.2, 0.23, 0.31, 0.4] + rng.uniform(0, 6, 6)) @ mix).astype(np.float32))
    return made


def spread(words: Float32Array) -> np.ndarray:
    flat = words.reshape(len(words), -1).astype(np.float64)
    apart: Float64Array = np.linalg.norm(flat[:, None] - flat[None], axis=2)
    return apart


def correlation(network: TrainedNetwork, words: Float32Array) -> float:
    upper = np.triu_indices(len(words), 1)
    truth = np.sqrt(word_distances(words, words))
    return float(np.corrcoef(spread(network.embed(words)[:, None])[upper], truth[upper])[0, 1])


@pytest.fixture(scope="module")
def trained() -> TrainedNetwork:
    return train_words(clips(40), CONFIG, NetworkConfig("conv", steps=60, seed=3), recipe=QUICK)


def test_positives_and_distances_are_what_they_claim() -> None:
    config = TripletConfig(anchors=25, elastic=1)
    found = training_words(clips(12), CONFIG, config, LinearConfig(), max_words=70, seed=1)
    assert len(found.words) == 70
    truth = np.sqrt(word_distances(found.words[found.anchors], found.words))
    np.testing.assert_allclose(found.distances, truth / np.median(truth), atol=1e-5)
    assert np.median(found.distances) == pytest.approx(1)
    for row, anchor in enumerate(found.anchors):
        other = np.flatnonzero(found.clips != found.clips[anchor])
        reach = np.sort(found.distances[row, other])[: config.nearest]
        np.testing.assert_allclose(found.distances[row, found.nearest[row]], reach)
        assert not np.any(found.clips[found.nearest[row]] == found.clips[anchor])
        assert anchor not in found.neighbours[row]


def test_a_lone_clip_has_no_nearest_words_in_others() -> None:
    found = training_words(clips(1), CONFIG, TripletConfig(), LinearConfig(), max_words=100, seed=0)
    np.testing.assert_array_equal(found.nearest, np.repeat(found.anchors[:, None], 5, axis=1))
    with pytest.raises(ValueError, match="too few"):
        training_words([clips(1)[0][:4]], CONFIG, TripletConfig(), LinearConfig(), max_words=100, seed=0)


def test_time_warped_copies_keep_their_ends_and_stay_close() -> None:
    words = np.concatenate([word_windows(c, CONFIG) for c in clips(10)])
    warped = time_warped(words, np.random.default_rng(0))
    np.testing.assert_allclose(warped[:, [0, -1]], words[:, [0, -1]], atol=1e-5)
    own = np.array([word_distances(w[None], c[None]).item() for w, c in zip(words, warped, strict=True)])
    assert np.median(own) < 0.05 * np.median(word_distances(words, words))
    assert np.median(np.abs(warped - words).max(axis=(1, 2))) > 1e-3
    line = np.repeat(np.arange(16, dtype=np.float32)[None, :, None], 50, axis=0)
    assert np.all(np.diff(time_warped(line, np.random.default_rng(1))[:, :, 0]) > 0)


def test_training_depends_on_input_and_seed_alone(trained: TrainedNetwork) -> None:
    words = word_windows(clips(40)[7], CONFIG)
    torch.manual_seed(999)
    before = torch.get_num_threads(), torch.initial_seed()
    again = train_words(clips(40), CONFIG, NetworkConfig("conv", steps=60, seed=3), recipe=QUICK)
    assert (torch.get_num_threads(), torch.initial_seed()) == before
    np.testing.assert_array_equal(again.embed(words), trained.embed(words))
    other = train_words(clips(40), CONFIG, NetworkConfig("conv", steps=60, seed=4), recipe=QUICK)
    assert not np.array_equal(other.embed(words), trained.embed(words))


def test_the_metric_term_makes_the_embedding_follow_the_word_distance() -> None:
    words = np.concatenate([word_windows(c, CONFIG) for c in clips(8, seed=50)])
    start = train_words(clips(40), CONFIG, NetworkConfig("conv", steps=0))
    recipe = replace(FEW, triplets=TripletConfig(elastic=1.0), triplet_weight=0.0)
    followed = train_words(clips(40), CONFIG, NetworkConfig("conv", steps=80), recipe=recipe)
    assert correlation(followed, words) > correlation(start, words) + 0.01


def test_the_triplet_loss_brings_positives_closer_than_negatives() -> None:
    config = NetworkConfig("conv", steps=100)
    triplets, linear = TripletConfig(elastic=1.0), LinearConfig.principal()
    recipe = replace(FEW, triplets=triplets, linear=linear, margin=1.0, metric_weight=0.0)
    material = training_words(clips(40), CONFIG, recipe.triplets, recipe.linear, config.max_words, config.seed)

    def violations(network: TrainedNetwork) -> float:
        places = network.embed(material.words).astype(np.float64)
        own = places[material.anchors]
        near = np.square(own[:, None] - places[material.nearest]).sum(axis=2)
        far = np.square(own[:, None] - places[None]).sum(axis=2)
        hinge = np.maximum(near[:, :, None] - far[:, None] + recipe.margin, 0)
        return float(hinge[np.repeat(material.distances[:, None] > recipe.triplets.far, 5, axis=1)].mean())

    start = train_words(clips(40), CONFIG, NetworkConfig("conv", steps=0), recipe=recipe)
    trained = train_words(clips(40), CONFIG, config, recipe=recipe)
    assert violations(trained) < 0.7 * violations(start)


def test_the_triplet_loss_is_that_of_every_triplet() -> None:
    random = torch.Generator().manual_seed(3)
    positives, squared = torch.rand(3, 5, generator=random), torch.rand(5, 7, generator=random)
    negative = torch.rand(5, 7, generator=random) > 0.4
    expected = [
        max(float(positives[p, a] - squared[a, n]) + 0.3, 0.0)
        for p in range(3) for a in range(5) for n in range(7) if negative[a, n]
    ]  # fmt: skip
    assert float(_triplet_loss(positives, squared, negative, 0.3)) == pytest.approx(np.mean(expected), rel=1e-5)
    assert float(_triplet_loss(positives, squared, torch.zeros_like(negative), 0.3)) == 0


def test_without_neighbours_the_embedding_is_the_principal_components() -> None:
    recipe = Recipe(linear=LinearConfig.principal())
    start = train_words(clips(40), CONFIG, NetworkConfig("conv", steps=0), recipe=recipe)
    words = np.concatenate([word_windows(c, CONFIG) for c in clips(40)])
    found, truth = spread(start.embed(words[:60])[:, None]), spread(words[:60])
    np.testing.assert_allclose(found * (truth.max() / found.max()), truth, rtol=0.05, atol=0.05)


@pytest.mark.parametrize("architecture", ["linear", "conv"])
def test_linear_paths_start_as_the_linear_embedding(architecture: str) -> None:
    made = train_words(clips(30), CONFIG, NetworkConfig(architecture, steps=0, max_words=10_000))
    cut = [word_windows(c, CONFIG) for c in clips(30)]
    words, owners = np.concatenate(cut), np.repeat(np.arange(30), [len(w) for w in cut])
    matrix = linear_embedding(words, owners, LinearConfig(), seed=0)
    expected = words[:50].reshape(50, -1) @ matrix.T
    np.testing.assert_allclose(spread(made.embed(words[:50])[:, None]), spread(expected[:, None]), atol=1e-3)


def naive_moves(word: Float32Array, posture: int) -> Float32Array:
    """The moves [length, 2 P] of a word, frame by frame."""
    held, last = word[:, :posture].astype(np.float64), len(word) - 1
    between = (held[0] + held[min(1, last)] + held[max(0, last - 1)] + held[last]) / 4
    away = np.array([frame - between for frame in held])
    around = [(max(i - 1, 0), min(i + 1, last)) for i in range(last + 1)]
    change = np.array([(held[after] - held[before]) / max(after - before, 1) for before, after in around])
    sizes = [np.sqrt(sum(float(frame @ frame) for frame in part) / len(word)) for part in (away, change)]
    return np.hstack([away / max(sizes[0], 1e-6), change / max(sizes[1], 1e-6)]).astype(np.float32)


@pytest.mark.parametrize("length", [1, 2, 3, 12])
def test_moves_of_words_agree_with_a_naive_count(length: int) -> None:
    words = np.random.default_rng(length).standard_normal((5, length, 7)).astype(np.float32)
    words[3] = words[3, :1]  # a body that stands still has no moves
    found = moves(torch.from_numpy(words), 4).numpy()
    np.testing.assert_allclose(found, [naive_moves(word, 4) for word in words], atol=1e-5)
    assert not found[3].any()


def test_moves_tell_what_is_done_be_it_largely_or_a_little() -> None:
    word = np.random.default_rng(1).standard_normal((12, CONFIG.dimension)).astype(np.float32)
    held = word.mean(axis=0)
    small = held + 0.3 * (word - held)
    one, other = (moves(torch.from_numpy(w[None].astype(np.float32)), CONFIG.posture).numpy() for w in (word, small))
    np.testing.assert_allclose(one, other, atol=1e-5)


def test_words_and_their_moves_count_alike() -> None:
    made = train_words(clips(30), CONFIG, NetworkConfig("moves", max_words=10_000))
    body = made.network.body
    assert isinstance(body, MovesBody)
    words = np.concatenate([word_windows(c, CONFIG) for c in clips(30)])
    with torch.no_grad():
        seen = body.seen((torch.from_numpy(words) - made.network.mean) / made.network.scale)
        counted = (seen * body.weights(seen)).numpy()
    plain = CONFIG.length * CONFIG.dimension
    of_words, of_moves = (part.var(axis=0, ddof=1).sum() for part in (counted[:, :plain], counted[:, plain:]))
    assert of_words == pytest.approx(1.0, rel=1e-3)
    assert of_moves == pytest.approx(1.0, rel=1e-3)
    owners = np.repeat(np.arange(30), [len(word_windows(c, CONFIG)) for c in clips(30)])
    expected = counted[:50] @ linear_embedding(counted, owners, LinearConfig(), seed=0).T
    np.testing.assert_allclose(spread(made.embed(words[:50])[:, None]), spread(expected[:, None]), atol=1e-3)


def test_directions_in_which_neighbours_of_other_clips_differ_are_shrunk() -> None:
    """Two features of equal variance: one tells ten actions apart, the other is the performer's own."""
    rng = np.random.default_rng(0)
    actions, performers = np.arange(10), rng.standard_normal(40)
    words = np.array([[[a - 4.5, 2.9 * p]] for p in performers for a in actions], dtype=np.float32)
    words += 0.02 * rng.standard_normal(words.shape).astype(np.float32)
    owners = np.repeat(np.arange(40), 10)
    matrix = linear_embedding(words, owners, LinearConfig(components=2, whitening=0.0, neighbours=3), seed=0)
    action, performer = np.linalg.norm(matrix, axis=0)
    assert action > 3 * performer


def test_neighbours_are_the_nearest_of_other_clips() -> None:
    rng = np.random.default_rng(3)
    places, owners = rng.standard_normal((60, 4)).astype(np.float32), np.sort(rng.integers(0, 9, 60))
    anchors = np.arange(0, 60, 7)
    found = nearest_elsewhere(places, owners, anchors, 4)
    distances = frame_distances(places, places)
    for row, anchor in enumerate(anchors):
        others = np.flatnonzero(owners != owners[anchor])
        expected = np.sort(distances[anchor, others])[:4]
        np.testing.assert_allclose(np.sort(distances[anchor, found[row]]), expected, atol=1e-5)
    np.testing.assert_array_equal(
        nearest_elsewhere(places, np.zeros(60, int), anchors, 2), anchors[:, None].repeat(2, 1)
    )


@pytest.mark.parametrize(("architecture", "share"), [("moves", 0.8), ("linear", 0.8), ("conv", 0.9)])
def test_words_played_backwards_are_alike_by_choice(architecture: str, share: float) -> None:
    words = np.concatenate([word_windows(c, CONFIG) for c in clips(8, seed=50)])
    recipe = replace(FEW, triplets=TripletConfig(anchors=200), metric_weight=0.2)

    def apart(reversible: bool) -> float:
        config = NetworkConfig(architecture, steps=60, reversible=reversible)
        made = train_words(clips(40), CONFIG, config, recipe=recipe)
        places = made.embed(words)
        own = np.linalg.norm(places - made.embed(time_reversed(words, CONFIG)), axis=1)
        return float(np.median(own) / np.median(spread(places[:, None])))

    assert apart(True) < share * apart(False)


def test_playing_backwards_turns_velocities_round() -> None:
    config = WordConfig(smoothing=0.0)
    rng = np.random.default_rng(0)
    body = rng.standard_normal((1, 21, 3)) + np.cumsum(0.01 * rng.standard_normal((40, 21, 3)), axis=0)
    forwards, backwards = (word_features(b, np.zeros((0, 21, 4)), 24.0, config) for b in (body, body[::-1]))
    turned = time_reversed(forwards[None, 5:35], config)[0]
    np.testing.assert_allclose(turned, backwards[5:35], atol=1e-4)


class KilledError(Exception):
    """Stands for a kill between two steps."""


# Steps of a whole training, and those after which a checkpoint is made and the training is killed.
@pytest.mark.parametrize(("architecture", "steps", "every"), [("conv", 26, 20), ("inception736", 4, 2)])
def test_training_resumed_from_a_checkpoint_gives_the_same_weights(
    architecture: str, steps: int, every: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(training, "CHECKPOINT_EVERY", every)
    monkeypatch.setattr(training, "REPORT_EVERY", every)
    config = NetworkConfig(architecture, steps=steps, max_words=150)
    whole = train_words(clips(12), CONFIG, config, recipe=QUICK)

    def killed(step: int, steps: int, loss: float) -> None:
        if step == every:
            raise KilledError

    kept = tmp_path / "checkpoint"
    with pytest.raises(KilledError):
        train_words(clips(12), CONFIG, config, recipe=QUICK, checkpoint=kept, progress=killed)
    assert kept.is_file()
    seen: list[int] = []
    resumed = train_words(
        clips(12), CONFIG, config, recipe=QUICK, checkpoint=kept, progress=lambda step, steps, loss: seen.append(step)
    )
    assert seen[0] > every
    assert not kept.exists()
    resumed.save(tmp_path / "resumed")
    whole.save(tmp_path / "whole")
    assert (tmp_path / "resumed").read_bytes() == (tmp_path / "whole").read_bytes()


def test_a_checkpoint_of_other_training_is_not_used(tmp_path: Path) -> None:
    save_file({"x": np.zeros(2)}, tmp_path / "checkpoint")
    config = NetworkConfig("conv", steps=3, max_words=100)
    found = train_words(clips(6), CONFIG, config, checkpoint=tmp_path / "checkpoint")
    expected = train_words(clips(6), CONFIG, config)
    words = word_windows(clips(6)[2], CONFIG)
    np.testing.assert_array_equal(found.embed(words), expected.embed(words))


@pytest.mark.parametrize("architecture", ["moves", "linear", "conv"])
def test_fine_tuning_goes_on_from_a_network(architecture: str) -> None:
    words = word_windows(clips(6)[2], CONFIG)
    config = NetworkConfig(architecture, steps=5, max_words=300)
    before = train_words(clips(20, seed=1), CONFIG, config)
    tuned = train_words(clips(12), CONFIG, config, start=before)
    fresh = train_words(clips(12), CONFIG, config)
    assert not np.allclose(tuned.embed(words), before.embed(words))
    assert not np.allclose(tuned.embed(words), fresh.embed(words))
    with pytest.raises(ValueError, match="same words and architecture"):
        train_words(clips(12), CONFIG, NetworkConfig("inception736", steps=1), start=before)


def test_a_word_is_embedded_alike_in_any_company(trained: TrainedNetwork) -> None:
    words = np.concatenate([word_windows(c, CONFIG) for c in clips(12)])
    together = trained.embed(words)
    assert together.shape == (len(words), 48)
    assert together.dtype == np.float32
    for part in (slice(0, 1), slice(63, 66), slice(5, 90)):
        np.testing.assert_array_equal(trained.embed(words[part]), together[part])
    assert trained.embed(words[:0]).shape == (0, 48)
    with pytest.raises(ValueError, match="shape"):
        trained.embed(words[:, :8])


@pytest.mark.parametrize("architecture", ["moves", "linear", "conv", "inception736"])
def test_a_saved_network_is_the_same_network(architecture: str, tmp_path: Path) -> None:
    recipe = Recipe(batch=8, pool=16)
    network = train_words(clips(6), CONFIG, NetworkConfig(architecture, steps=1, max_words=70), recipe=recipe)
    network.save(tmp_path / "network")
    again = load_network(tmp_path / "network")
    words = word_windows(clips(6)[2], CONFIG)
    np.testing.assert_array_equal(again.embed(words), network.embed(words))
    assert (again.architecture, again.words, again.metrics) == (architecture, CONFIG, network.metrics)
    again.save(tmp_path / "twice")
    assert (tmp_path / "twice").read_bytes() == (tmp_path / "network").read_bytes()
    if architecture == "inception736":
        np.testing.assert_allclose(np.linalg.norm(again.embed(words), axis=1), 1, rtol=1e-5)
        assert again.embed(words).shape[1] == 736


def test_other_files_and_names_are_refused(tmp_path: Path) -> None:
    save_file({"x": np.zeros(2)}, tmp_path / "other")
    with pytest.raises(ValueError, match="holds no word network"):
        load_network(tmp_path / "other")
    with pytest.raises(ValueError, match="unknown word network"):
        train_words(clips(3), CONFIG, NetworkConfig("transformer", steps=1))


def test_the_learning_rate_rises_and_falls() -> None:
    """In a straight line over a tenth of the steps, then along half a cosine."""
    found = [training._rate(step, 19) for step in range(19)]
    assert found[:2] == pytest.approx([0.5, 1.0])
    falling = [0.5 + 0.5 * np.cos(np.pi * (k + 1 - 2) / 18) for k in range(2, 19)]
    assert found[2:] == pytest.approx(falling)
    assert training._rate(98, 99) == pytest.approx(0.5 - 0.5 * np.cos(np.pi / 90))


def test_a_curve_has_a_mean_of_fifty_steps() -> None:
    assert training._curve([*range(120)]) == [24.5, 74.5, 109.5]
    assert training._curve([0.123456789]) == [0.12346]
    assert training._curve([]) == []


def test_progress_is_reported() -> None:
    seen: list[tuple[int, int]] = []
    train_words(
        clips(4),
        CONFIG,
        NetworkConfig("conv", steps=60),
        recipe=QUICK,
        progress=lambda step, steps, loss: seen.append((step, steps)),
    )
    assert seen == [(50, 60), (60, 60)]


def test_word_distances_are_half_elastic_half_linear() -> None:
    found = training_words(clips(12), CONFIG, TripletConfig(anchors=25), LinearConfig(), max_words=70, seed=1)
    embedded = found.words.reshape(70, -1) @ found.linear.T
    parts = [
        np.sqrt(word_distances(found.words[found.anchors], found.words)),
        np.sqrt(frame_distances(embedded[found.anchors], embedded)),
    ]
    expected = sum(part / np.median(part) for part in parts)
    np.testing.assert_allclose(found.distances, expected / np.median(expected), rtol=1e-4, atol=2e-3)


def test_the_machine_s_threads_do_not_show(tmp_path: Path) -> None:
    saved = []
    for threads in (1, 2):
        with threadpool_limits(threads):
            network = train_words(clips(60, seed=5), CONFIG, NetworkConfig("conv", steps=3))
        network.save(tmp_path / f"{threads}.safetensors")
        saved.append((tmp_path / f"{threads}.safetensors").read_bytes())
    assert saved[0] == saved[1]


@pytest.mark.parametrize(("name", "share"), [("sgd", 0.0), ("momentum", 0.99)])
def test_descent_keeps_going_by_its_momentum(name: Literal["sgd", "momentum"], share: float) -> None:
    """The second step down a slope that stays is longer by as much of the first; the rate stays to the end."""
    schedule = Schedule(optimiser=name, learning_rate=0.1)
    line = torch.nn.Linear(1, 1, bias=False)
    descent, rate = optimiser_of(line, schedule), rate_of(schedule)
    assert rate(0.0) == rate(1.0) == 0.1
    places = [float(line.weight.detach())]
    for _ in range(2):
        descent.zero_grad()
        torch.autograd.backward(line.weight.sum())
        descent.step()
        places.append(float(line.weight.detach()))
    first, second = np.diff(places)
    assert first == pytest.approx(-0.1, rel=1e-5)
    assert second == pytest.approx((1 + share) * first, rel=1e-5)
