"""Posture dictionaries: one protocol over all kinds, the autoencoder's training, the self-organising map."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from motionlake.arrays import Float32Array
from motionlake.pesta.config import KINDS, DictionaryKind, PosturesConfig
from motionlake.pesta.dictionary import (
    AutoencoderRecipe,
    PostureAutoencoder,
    PostureDictionary,
    load_dictionary,
    recipe_of,
)
from motionlake.pesta.posture_training import (
    _revive,
    fit_dictionary,
    grid,
    sample_postures,
    self_organising_map,
    train_autoencoder,
)
from safetensors.numpy import save_file

M = 12
SMALL = PosturesConfig(m=M, weights="own", max_postures=600)
QUICK = AutoencoderRecipe(style=6, hidden=24, steps=30, batch=64)


def clips(seed: int = 0) -> list[Float32Array]:
    """Six clips that wander between the same four postures."""
    rng = np.random.default_rng(seed)
    centres = rng.normal(size=(4, SMALL.frames.dimension)) * 2
    visited = [np.repeat(rng.permutation(4), 30) for _ in range(6)]
    return [(centres[v] + 0.3 * rng.normal(size=(len(v), centres.shape[1]))).astype(np.float32) for v in visited]


def autoencoder(recipe: AutoencoderRecipe = QUICK, seed: int = 0, checkpoint: Path | None = None) -> PostureDictionary:
    postures, of = sample_postures(clips(), SMALL)
    return train_autoencoder(
        postures, of, replace(SMALL, seed=seed), recipe=recipe, checkpoint=checkpoint, device="cpu"
    )


def fitted(kind: DictionaryKind) -> PostureDictionary:
    return autoencoder() if kind == "aae" else fit_dictionary(clips(), replace(SMALL, dictionary=kind))


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_codes_postures_and_is_kept(kind: DictionaryKind, tmp_path: Path) -> None:
    dictionary = fitted(kind)
    assert len(dictionary.codes) == len(dictionary.postures) == M
    assert dictionary.postures.shape[1] == SMALL.frames.dimension
    apart = dictionary.distances
    assert apart.dtype == np.float32
    np.testing.assert_allclose(
        apart, [[np.linalg.norm(p - q) for q in dictionary.codes] for p in dictionary.codes], atol=1e-4
    )

    features = clips(1)[0]
    symbols = dictionary.encode(features)
    assert symbols.dtype == np.int32
    assert set(symbols.tolist()) <= set(range(M))
    one_by_one = [dictionary.encode(row[None])[0] for row in features]
    np.testing.assert_array_equal(symbols, one_by_one)

    dictionary.save(tmp_path / "dictionary.safetensors")
    again = load_dictionary(tmp_path / "dictionary.safetensors")
    np.testing.assert_array_equal(again.encode(features), symbols)
    np.testing.assert_array_equal(again.distances, apart)
    assert (again.config, again.metrics) == (dictionary.config, dict(dictionary.metrics))

    with pytest.raises(
        ValueError, match=rf"postures of shape \(5, 3\), but the dictionary codes \[T, {features.shape[1]}\]"
    ):
        dictionary.encode(np.zeros((5, 3), dtype=np.float32))


@pytest.mark.parametrize("kind", ["kmeans", "som"])
def test_a_symbol_is_the_nearest_code(kind: DictionaryKind) -> None:
    dictionary, features = fitted(kind), clips(2)[0]
    naive = [np.argmin([np.linalg.norm(row - code) for code in dictionary.codes]) for row in features]
    np.testing.assert_array_equal(dictionary.encode(features), naive)


@pytest.mark.parametrize("kind", KINDS)
def test_postures_of_one_place_share_their_symbols(kind: DictionaryKind) -> None:
    dictionary, first = fitted(kind), clips()[0]
    symbols = dictionary.encode(first).reshape(4, 30)
    sets = [set(row.tolist()) for row in symbols]
    assert not any(sets[i] & sets[j] for i in range(4) for j in range(i))


def test_training_repeats_and_resumes_to_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = autoencoder()
    np.testing.assert_array_equal(autoencoder().codes, whole.codes)
    assert not np.array_equal(autoencoder(seed=1).codes, whole.codes)

    monkeypatch.setattr("motionlake.pesta.posture_training.CHECKPOINT_EVERY", 10)
    monkeypatch.setattr("motionlake.pesta.posture_training.REPORT_EVERY", 5)
    checkpoint = tmp_path / "training.safetensors"

    class KilledError(Exception):
        pass

    def kill(step: int, steps: int, loss: float) -> None:
        if step == 15:
            raise KilledError

    postures, of = sample_postures(clips(), SMALL)
    with pytest.raises(KilledError):
        train_autoencoder(postures, of, SMALL, recipe=QUICK, checkpoint=checkpoint, device="cpu", progress=kill)
    assert checkpoint.is_file()
    seen: list[int] = []
    resumed = train_autoencoder(
        postures, of, SMALL, recipe=QUICK, checkpoint=checkpoint, device="cpu",
        progress=lambda step, steps, loss: seen.append(step),
    )  # fmt: skip
    assert seen == [15, 20, 25, 30]
    assert not checkpoint.exists()
    np.testing.assert_array_equal(resumed.codes, whole.codes)
    np.testing.assert_array_equal(resumed.postures, whole.postures)


def test_training_lowers_the_error_and_reports_occupancy() -> None:
    before, after = (autoencoder(replace(QUICK, steps=steps, learning_rate=5e-3)) for steps in (1, 150))
    assert after.metrics["validation_error"] < 0.7 * before.metrics["validation_error"]
    features, _ = sample_postures(clips(), SMALL)
    used = np.bincount(after.encode(features), minlength=M)
    assert after.metrics["occupied"] == np.count_nonzero(used)
    assert after.metrics["largest"] == pytest.approx(used.max() / len(features))
    assert 1 <= after.metrics["perplexity"] <= M


def test_typical_postures_are_means_of_their_symbols() -> None:
    postures, of = sample_postures(clips(), SMALL)
    dictionary = train_autoencoder(postures, of, SMALL, recipe=replace(QUICK, validation=0.0), device="cpu")
    symbols = dictionary.encode(postures)
    for symbol in np.unique(symbols):
        np.testing.assert_allclose(dictionary.postures[symbol], postures[symbols == symbol].mean(axis=0), atol=1e-4)


def test_the_papers_recipe_by_name() -> None:
    paper = recipe_of(PosturesConfig.pesta())
    assert (paper.epochs, paper.batch, paper.learning_rate, paper.clip, paper.momentum) == (5000, 64, 1e-4, 5.0, 0.1)
    assert paper.count(640) == 50_000
    assert PosturesConfig.pesta().frames.representation == "rotations"
    short = autoencoder(replace(paper, epochs=2, hidden=24, style=6))
    assert len(short.codes) == M
    assert set(short.encode(clips()[0]).tolist()) <= set(range(M))


def test_dead_heads_are_revived() -> None:
    features = np.concatenate(clips())
    network = PostureAutoencoder(features.shape[1], M, 6, 24, "nearest")
    network.start.normal_()
    network.heads.data[:] = 1e6
    network.heads.data[0] = 0.0
    coded: Callable[[], int] = lambda: len(np.unique(network.symbols(_tensor(features))))  # noqa: E731
    assert coded() == 1
    _revive(network, features, np.random.default_rng(0), "cpu")
    assert coded() > M // 2


def _tensor(features: Float32Array) -> Any:
    import torch

    return torch.from_numpy(features)


def test_a_map_keeps_neighbours_together() -> None:
    assert grid(400) == (20, 20)
    assert grid(12) == (3, 4)
    assert grid(7) == (1, 7)
    rng = np.random.default_rng(0)
    plane = rng.uniform(size=(2000, 2)) @ rng.normal(size=(2, 10))
    nodes = self_organising_map(plane.astype(np.float32), 5, 5, seed=0).reshape(5, 5, 10)
    beside = np.linalg.norm(np.diff(nodes, axis=1), axis=2).mean()
    across = np.linalg.norm(nodes[:, 0] - nodes[:, -1], axis=1).mean()
    assert across > 3 * beside


def test_bad_input(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="10 postures are too few for 12 symbols"):
        fit_dictionary([clips()[0][:10]], SMALL)
    with pytest.raises(ValueError, match="dictionary is 'tree'"):
        PosturesConfig(dictionary="tree")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="m = 1 symbols"):
        PosturesConfig(m=1)
    save_file({"x": np.zeros(1)}, tmp_path / "other.safetensors")
    with pytest.raises(ValueError, match="holds no posture dictionary"):
        load_dictionary(tmp_path / "other.safetensors")
