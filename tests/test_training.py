"""Training material and word networks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.numpy import save_file
from threadpoolctl import threadpool_limits

from pipeline.words.config import NetworkConfig
from pipeline.words.dtw import word_distances
from pipeline.words.features import Float32Array, WordConfig
from pipeline.words.frame_distance import Metric, frame_distances, rigid_distances
from pipeline.words.network import ConvBody
from pipeline.words.training import Recipe, TrainedNetwork, load_network, train_words
from pipeline.words.triplets import TripletConfig, time_warped, training_words
from pipeline.words.windows import word_windows

CONFIG = WordConfig(root_weight=0.0, velocity_weight=0.0)


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
    return np.linalg.norm(flat[:, None] - flat[None], axis=2)


def correlation(network: TrainedNetwork, words: Float32Array) -> float:
    upper = np.triu_indices(len(words), 1)
    truth = np.sqrt(word_distances(words, words))
    return float(np.corrcoef(spread(network.embed(words)[:, None])[upper], truth[upper])[0, 1])


@pytest.fixture(scope="module")
def trained() -> TrainedNetwork:
    return train_words(clips(40), CONFIG, NetworkConfig(steps=60, seed=3))


def test_positives_and_distances_are_what_they_claim() -> None:
    config = TripletConfig(anchors=25, elastic=1)
    found = training_words(clips(12), CONFIG, config, max_words=70, seed=1)
    assert len(found.words) == 70
    truth = np.sqrt(word_distances(found.words[found.anchors], found.words)) / found.scale
    np.testing.assert_allclose(found.distances, truth, atol=1e-5)
    assert np.median(found.distances) == pytest.approx(1)
    for row, anchor in enumerate(found.anchors):
        other = np.flatnonzero(found.clips != found.clips[anchor])
        reach = np.sort(found.distances[row, other])[: config.nearest]
        np.testing.assert_allclose(found.distances[row, found.nearest[row]], reach)
        assert not np.any(found.clips[found.nearest[row]] == found.clips[anchor])
        assert anchor not in found.neighbours[row]
        apart = np.abs(found.starts - found.starts[anchor])
        allowed = np.flatnonzero((found.clips == found.clips[anchor]) & (apart >= CONFIG.length))
        positives = found.temporal[row]
        if len(allowed) == 0:
            assert set(positives) == {anchor}
        else:
            expected = np.sort(apart[allowed])[: config.temporal]
            np.testing.assert_array_equal(np.sort(apart[positives])[: len(expected)][:1], expected[:1])
            assert set(positives) <= set(allowed)


def test_a_lone_clip_has_no_nearest_words_in_others() -> None:
    found = training_words(clips(1), CONFIG, TripletConfig(), max_words=100, seed=0)
    np.testing.assert_array_equal(found.nearest, np.repeat(found.anchors[:, None], 5, axis=1))
    with pytest.raises(ValueError, match="too few"):
        training_words([clips(1)[0][:4]], CONFIG, TripletConfig(), max_words=100, seed=0)


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
    again = train_words(clips(40), CONFIG, NetworkConfig(steps=60, seed=3))
    assert (torch.get_num_threads(), torch.initial_seed()) == before
    np.testing.assert_array_equal(again.embed(words), trained.embed(words))
    other = train_words(clips(40), CONFIG, NetworkConfig(steps=60, seed=4))
    assert not np.array_equal(other.embed(words), trained.embed(words))


def test_the_metric_term_makes_the_embedding_follow_the_word_distance() -> None:
    words = np.concatenate([word_windows(c, CONFIG) for c in clips(8, seed=50)])
    start = train_words(clips(40), CONFIG, NetworkConfig(steps=0))
    recipe = Recipe(triplet_weight=0.0)
    followed = train_words(clips(40), CONFIG, NetworkConfig(steps=150), recipe=recipe)
    assert correlation(followed, words) > correlation(start, words) + 0.01


def test_the_triplet_loss_brings_positives_closer_than_negatives() -> None:
    config = NetworkConfig(steps=100)
    recipe = Recipe(metric_weight=0.0, temporal_weight=0.0)
    material = training_words(clips(40), CONFIG, recipe.triplets, config.max_words, config.seed)

    def violations(network: TrainedNetwork) -> float:
        places = network.embed(material.words).astype(np.float64)
        own = places[material.anchors]
        near = np.square(own[:, None] - places[material.nearest]).sum(axis=2)
        far = np.square(own[:, None] - places[None]).sum(axis=2)
        hinge = np.maximum(near[:, :, None] - far[:, None] + recipe.margin, 0)
        return float(hinge[np.repeat(material.distances[:, None] > recipe.triplets.far, 5, axis=1)].mean())

    start = train_words(clips(40), CONFIG, NetworkConfig(steps=0))
    trained = train_words(clips(40), CONFIG, config, recipe=recipe)
    assert violations(trained) < 0.7 * violations(start)


def test_the_untrained_network_is_the_principal_components() -> None:
    start = train_words(clips(40), CONFIG, NetworkConfig(steps=0))
    assert isinstance(start.network.body, ConvBody)
    words = np.concatenate([word_windows(c, CONFIG) for c in clips(40)])
    scale = start.figures["word_distance_median"] * 16**0.5
    np.testing.assert_allclose(
        spread(start.embed(words[:60])[:, None]) * scale, spread(words[:60]), rtol=0.05, atol=0.02
    )


def test_a_word_is_embedded_alike_in_any_company(trained: TrainedNetwork) -> None:
    words = np.concatenate([word_windows(c, CONFIG) for c in clips(12)])
    together = trained.embed(words)
    assert together.shape == (len(words), 64)
    assert together.dtype == np.float32
    for part in (slice(0, 1), slice(63, 66), slice(5, 90)):
        np.testing.assert_array_equal(trained.embed(words[part]), together[part])
    assert trained.embed(words[:0]).shape == (0, 64)
    with pytest.raises(ValueError, match="shape"):
        trained.embed(words[:, :8])


@pytest.mark.parametrize("architecture", ["conv", "inception736"])
def test_a_saved_network_is_the_same_network(architecture: str, tmp_path: Path) -> None:
    network = train_words(clips(6), CONFIG, NetworkConfig(architecture, steps=1, max_words=70))
    network.save(tmp_path / "network")
    again = load_network(tmp_path / "network")
    words = word_windows(clips(6)[2], CONFIG)
    np.testing.assert_array_equal(again.embed(words), network.embed(words))
    assert (again.architecture, again.words, again.figures) == (architecture, CONFIG, network.figures)
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


def test_progress_is_reported() -> None:
    seen: list[tuple[int, int]] = []
    train_words(
        clips(4),
        CONFIG,
        NetworkConfig(steps=60),
        progress=lambda step, steps, loss: seen.append((step, steps)),
    )
    assert seen == [(50, 60), (60, 60)]


@pytest.mark.parametrize("metric", ["euclidean", "geodesic"])
def test_rigid_distances_match_naive(metric: Metric) -> None:
    rng = np.random.default_rng(7)
    a, b = (rng.standard_normal((n, 5, 8)).astype(np.float32) for n in (3, 4))
    if metric == "geodesic":
        a, b = (x / np.linalg.norm(x.reshape(*x.shape[:2], 2, 4), axis=-1).repeat(4, axis=-1) for x in (a, b))
    expected = [
        [np.mean([frame_distances(x[t : t + 1], y[t : t + 1], metric)[0, 0] for t in range(5)]) for y in b] for x in a
    ]
    np.testing.assert_allclose(rigid_distances(a, b, metric), expected, rtol=1e-4, atol=1e-5)


def test_word_distances_are_half_elastic_half_rigid() -> None:
    found = training_words(clips(12), CONFIG, TripletConfig(anchors=25), max_words=70, seed=1)
    anchors = found.words[found.anchors]
    parts = [np.sqrt(word_distances(anchors, found.words)), np.sqrt(rigid_distances(anchors, found.words))]
    expected = sum(part / np.median(part) for part in parts)
    np.testing.assert_allclose(found.distances, expected / np.median(expected), rtol=1e-4, atol=1e-5)


def test_the_machine_s_threads_do_not_show(tmp_path: Path) -> None:
    saved = []
    for threads in (1, 2):
        with threadpool_limits(threads):
            network = train_words(clips(60, seed=5), CONFIG, NetworkConfig(steps=3))
        network.save(tmp_path / f"{threads}.safetensors")
        saved.append((tmp_path / f"{threads}.safetensors").read_bytes())
    assert saved[0] == saved[1]
