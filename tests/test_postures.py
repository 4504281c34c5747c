"""Posture dictionaries: one protocol over all kinds, the autoencoder's training, the self-organising map."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import Float32Array, Float64Array
from motionlake.pesta import clustering
from motionlake.pesta.autoencoder import AutoencoderRecipe, ClassTerm, PostureAutoencoder, recipe_of
from motionlake.pesta.autoencoder_training import _step, held_out, train_autoencoder
from motionlake.pesta.clustering import grid, kmeans, moved_by_rank, neural_gas, self_organising_map, whitened
from motionlake.pesta.config import CLUSTERED, DICTIONARY_KEY, KINDS, DictionaryKind, PosturesConfig
from motionlake.pesta.dictionary import PostureDictionary, load_dictionary
from motionlake.pesta.dictionary_fitting import fit_dictionary, sample_postures
from motionlake.pesta.occupancy import IN_USE, line, scatter, use_of
from motionlake.weights import save_tensors
from safetensors.numpy import save_file
from threadpoolctl import threadpool_limits

M = 12
SMALL = PosturesConfig("information", m=M, weights="own", max_postures=600)
QUICK = AutoencoderRecipe(style=6, hidden=24, steps=30, batch=64, every=10)


def clips(seed: int = 0) -> list[Float32Array]:
    """Six clips that wander between the same four postures."""
    rng = np.random.default_rng(seed)
    centres = rng.normal(size=(4, SMALL.frames.dimension)) * 2
    visited = [np.repeat(rng.permutation(4), 30) for _ in range(6)]
    return [(centres[v] + 0.3 * rng.normal(size=(len(v), centres.shape[1]))).astype(np.float32) for v in visited]


def fitted(
    kind: DictionaryKind = "information",
    recipe: AutoencoderRecipe = QUICK,
    seed: int = 0,
    features: list[Float32Array] | None = None,
    **changes: Any,
) -> PostureDictionary:
    config = replace(SMALL, dictionary=kind, seed=seed, **changes)
    recipe = replace(recipe, classes=recipe_of(kind).classes)
    return fit_dictionary(features or clips(), config, recipe=recipe, device="cpu")


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


@pytest.mark.parametrize("kind", CLUSTERED)
@pytest.mark.parametrize("is_whitened", [True, False])
def test_a_symbol_is_the_nearest_code(kind: DictionaryKind, is_whitened: bool) -> None:
    dictionary, features = fitted(kind, whitened=is_whitened), clips(2)[0]
    postures, of = sample_postures(clips(), SMALL)
    points = features @ whitened(postures, of, 0).T if is_whitened else features
    naive = [np.argmin([np.linalg.norm(row - code) for code in dictionary.codes]) for row in points]
    np.testing.assert_array_equal(dictionary.encode(features), naive)


@pytest.mark.parametrize("kind", ["kmeans", "neural_gas"])
def test_a_dictionary_is_the_same_for_any_number_of_threads(kind: DictionaryKind) -> None:
    rng = np.random.default_rng(3)
    features = [rng.normal(size=(400, 66)).astype(np.float32) for _ in range(12)]

    def codes(threads: int) -> bytes:
        with threadpool_limits(limits=threads):
            return fit_dictionary(features, PosturesConfig(dictionary=kind, m=20)).codes.tobytes()

    assert codes(1) == codes(2) == codes(4)


@pytest.mark.parametrize("kind", [*CLUSTERED, "information"])
def test_postures_of_one_place_share_their_symbols(kind: DictionaryKind) -> None:
    dictionary, first = fitted(kind, replace(QUICK, steps=600, learning_rate=3e-3)), clips()[0]
    symbols = dictionary.encode(first).reshape(4, 30)
    sets = [set(row.tolist()) for row in symbols]
    assert not any(sets[i] & sets[j] for i in range(4) for j in range(i))


def test_soft_heads_are_weighted_means() -> None:
    points = np.random.default_rng(0).normal(size=(200, 3)).astype(np.float32)
    hard, soft = (kmeans(points, 5, softness, seed=0).astype(np.float64) for softness in (0.0, 0.8))
    apart = np.array([[np.sum((point - head) ** 2) for head in hard] for point in points.astype(np.float64)])
    near = np.exp(-apart / (2 * 0.8 * apart.min(axis=1).mean()))
    near /= near.sum(axis=1)[:, None]
    for head, weights in zip(soft, near.T, strict=True):
        np.testing.assert_allclose(head, np.average(points, axis=0, weights=weights), atol=1e-5)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**31), width=st.floats(0.05, 12.0))
def test_neural_gas_weighs_points_by_the_rank_of_heads(seed: int, width: float) -> None:
    rng = np.random.default_rng(seed)
    points, heads = (rng.normal(size=(count, 3)).astype(np.float32) for count in (60, 9))
    weights = np.zeros((len(points), len(heads)))
    for row, point in zip(weights, points, strict=True):
        order = sorted(range(len(heads)), key=lambda i: float(np.linalg.norm(point - heads[i])))
        for rank, head in enumerate(order):
            row[head] = np.exp(-rank / width) if rank <= np.ceil(6 * width) else 0.0
    naive = np.array(
        [np.average(points, axis=0, weights=w) if w.sum() > 1e-9 else h for w, h in zip(weights.T, heads, strict=True)]
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(clustering, "ROWS", 16)  # several parts
        np.testing.assert_allclose(moved_by_rank(points, heads, width), naive, atol=1e-4)


def test_neural_gas_uses_every_head_and_leans_as_far_as_it_is_soft() -> None:
    """Points in two places far apart: a map has nodes between them that no point is near."""
    rng = np.random.default_rng(1)
    points = np.concatenate([rng.normal(size=(900, 6)) * 0.1, 20 + rng.normal(size=(300, 6))]).astype(np.float32)
    hard, soft, softer = (neural_gas(points, 60, softness, seed=0) for softness in (0.0, 1.0, 2.0))

    def used(heads: Float32Array) -> int:
        return len(set(np.linalg.norm(points[:, None] - heads[None], axis=2).argmin(axis=1).tolist()))

    def spread(heads: Float32Array) -> float:
        return float(heads[heads[:, 0] < 10].std())

    assert used(soft) == used(softer) == 60
    assert used(self_organising_map(points, 6, 10, seed=0)) < 57 <= used(hard)
    np.testing.assert_allclose(hard, moved_by_rank(points, hard, 1e-3), atol=0.05)  # centroids, as k-means has them
    assert spread(hard) > spread(soft) > spread(softer)
    np.testing.assert_array_equal(soft, neural_gas(points, 60, 1.0, seed=0))
    assert not np.array_equal(soft, neural_gas(points, 60, 1.0, seed=1))


def test_neural_gas_that_looks_at_a_share_of_the_points_first_ends_where_all_of_them_lead(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    points = np.random.default_rng(2).normal(size=(4 * clustering.ROWS, 4)).astype(np.float32)

    def error(heads: Float32Array) -> float:
        return float(np.min(np.square(points[:, None] - heads[None]).sum(axis=2), axis=1).mean())

    shared = neural_gas(points, 60, 0.5, seed=0)
    monkeypatch.setattr(clustering, "_SHARE", 1)
    whole = neural_gas(points, 60, 0.5, seed=0)
    assert not np.array_equal(shared, whole)
    assert error(shared) == pytest.approx(error(whole), rel=0.01)


@pytest.mark.parametrize("classes", ["information", "critic"])
def test_the_loss_of_a_step_is_its_terms_as_they_are_weighed(classes: ClassTerm) -> None:
    torch.manual_seed(0)
    network, rng = PostureAutoencoder(6, 5, 3, 8), np.random.default_rng(0)
    network.scale.fill_(1.7)
    postures = rng.normal(size=(7, 6)).astype(np.float32)
    recipe = AutoencoderRecipe(
        classes=classes, style=3, hidden=8, class_weight=0.7, sharpness=0.4, style_weight=0.2, from_head=0.5
    )

    def surely(judged: torch.Tensor) -> float:
        return float(np.mean(np.log1p(np.exp(-judged.numpy().astype(np.float64)))))

    def entropy(shares: Float64Array) -> float:
        return float(-(shares * np.log(shares)).sum())

    with torch.no_grad():
        wanted = torch.from_numpy(postures)
        y, z = network.encode(wanted)
        by_code, by_head = network.decode(y @ network.heads + z), network.decode(network.heads[y.argmax(dim=1)])
        expected = float((by_code - wanted).square().mean() + 0.5 * (by_head - wanted).square().mean()) / 1.7**2
        shares = y.numpy().astype(np.float64)
        informed = 0.4 * float(np.mean([entropy(row) for row in shares])) - entropy(shares.mean(axis=0))
        expected += 0.7 * (informed if classes == "information" else surely(network.class_critic(y)))
        expected += 0.2 * surely(network.style_critic(z))
    assert _step(network, postures, recipe, rng, "cpu") == pytest.approx(expected, rel=1e-5)


def test_training_repeats_and_resumes_to_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = fitted()
    np.testing.assert_array_equal(fitted().codes, whole.codes)
    assert not np.array_equal(fitted(seed=1).codes, whole.codes)

    monkeypatch.setattr("motionlake.pesta.autoencoder_training.CHECKPOINT_EVERY", 10)
    monkeypatch.setattr("motionlake.pesta.autoencoder_training.REPORT_EVERY", 5)
    checkpoint = tmp_path / "training.safetensors"

    class KilledError(Exception):
        pass

    def kill(step: int, steps: int, loss: float) -> None:
        if step == 15:
            raise KilledError

    with pytest.raises(KilledError):
        fit_dictionary(clips(), SMALL, recipe=QUICK, checkpoint=checkpoint, device="cpu", progress=kill)
    assert checkpoint.is_file()
    seen: list[int] = []
    resumed = fit_dictionary(
        clips(), SMALL, recipe=QUICK, checkpoint=checkpoint, device="cpu",
        progress=lambda step, steps, loss: seen.append(step),
    )  # fmt: skip
    assert seen == [15, 20, 25, 30]
    assert not checkpoint.exists()
    np.testing.assert_array_equal(resumed.codes, whole.codes)
    np.testing.assert_array_equal(resumed.postures, whole.postures)
    assert resumed.metrics == whole.metrics


def test_training_ends_where_the_loss_on_other_clips_stops_falling(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recipe = replace(QUICK, steps=5000, learning_rate=2e-2, every=5, patience=3)
    whole = fitted(recipe=recipe)
    losses = [loss for _, loss, _ in whole.metrics["curve"]]
    lowest = int(np.argmin(losses))
    assert whole.metrics["steps"] == 5 * len(losses) < 5000
    assert lowest >= 3
    assert len(losses) - 1 - lowest <= 3
    # What is kept had the lowest loss: that of a training which ends there.
    there = fitted(recipe=replace(recipe, steps=5 * (lowest + 1), patience=0))
    np.testing.assert_array_equal(whole.codes, there.codes)
    assert fitted(recipe=replace(recipe, steps=5 * len(losses) + 5, patience=0)).metrics["steps"] == 5 * len(losses) + 5

    # It ends where it would have, interrupted after the lowest loss.
    monkeypatch.setattr("motionlake.pesta.autoencoder_training.CHECKPOINT_EVERY", 1)
    monkeypatch.setattr("motionlake.pesta.autoencoder_training.REPORT_EVERY", 1)
    checkpoint = tmp_path / "training.safetensors"

    def interrupt(step: int, steps: int, loss: float) -> None:
        if step == 5 * (lowest + 2) + 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fit_dictionary(clips(), SMALL, recipe=recipe, checkpoint=checkpoint, device="cpu", progress=interrupt)
    resumed = fit_dictionary(clips(), SMALL, recipe=recipe, checkpoint=checkpoint, device="cpu")
    np.testing.assert_array_equal(resumed.codes, whole.codes)
    assert resumed.metrics == whole.metrics


def test_whole_clips_are_held_out() -> None:
    of = np.repeat(np.arange(8), 20)
    kept_out = held_out(of, QUICK, np.random.default_rng(0))
    assert set(np.bincount(of[kept_out], minlength=8).tolist()) == {0, 20}
    assert kept_out.sum() == 40
    for single in (held_out(of, replace(QUICK, by_posture=True), np.random.default_rng(0)),
                   held_out(np.zeros(160, dtype=np.int64), QUICK, np.random.default_rng(0))):  # fmt: skip
        assert single.sum() == 40
        assert len(np.unique(np.bincount(of[single], minlength=8))) > 2


def test_training_lowers_the_error() -> None:
    before, after = (fitted(recipe=replace(QUICK, steps=steps, learning_rate=5e-3)) for steps in (1, 150))
    assert after.metrics["validation_error"] < 0.7 * before.metrics["validation_error"]


def test_mutual_information_brings_symbols_into_use() -> None:
    recipe = replace(QUICK, steps=400, learning_rate=5e-3, every=100, patience=0)
    spread = [np.random.default_rng(5).normal(size=(300, SMALL.frames.dimension)).astype(np.float32)] * 2
    with_it, without = (
        fitted(recipe=replace(recipe, class_weight=weight), features=spread).metrics for weight in (0.1, 0.0)
    )
    assert with_it["occupied"] == M
    assert with_it["perplexity"] > 1.5 * without["perplexity"]


@pytest.mark.parametrize("kind", KINDS)
def test_every_recipe_says_how_many_symbols_are_in_use(kind: DictionaryKind) -> None:
    dictionary = fitted(kind)
    features, _ = sample_postures(clips(), SMALL)
    used = np.bincount(dictionary.encode(features), minlength=M)
    found = dictionary.metrics
    assert (found["m"], found["occupied"]) == (M, np.count_nonzero(used))
    assert found["largest"] == pytest.approx(used.max() / len(features))
    assert f"{np.count_nonzero(used)} of {M} symbols in use" in line(found)


def test_perplexity_and_scatter() -> None:
    assert use_of(np.array([0, 1, 2, 3], dtype=np.int32), 8)["perplexity"] == pytest.approx(4)
    assert use_of(np.array([5, 5, 5], dtype=np.int32), 8) == {"m": 8, "occupied": 1, "largest": 1.0, "perplexity": 1.0}
    postures = np.array([[0.0], [2.0], [10.0], [12.0]], dtype=np.float32)
    assert scatter(postures, np.array([0, 0, 1, 1], dtype=np.int32), 3) == pytest.approx(4 / 104)


def test_a_collapsed_dictionary_is_warned_of() -> None:
    enough = int(np.ceil(IN_USE * 400))
    assert line({"occupied": enough, "m": 400}) == f"{enough} of 400 symbols in use"
    assert line({"occupied": enough - 1, "m": 400}).startswith(f"only {enough - 1} of 400 symbols in use: ")
    still = [np.zeros((60, SMALL.frames.dimension), dtype=np.float32) + 1e-3 * i for i in range(2)]
    collapsed = fitted("adversarial", features=still)
    assert collapsed.metrics["occupied"] <= 2
    assert line(collapsed.metrics).startswith("only ")


def test_typical_postures_are_means_of_their_symbols() -> None:
    for dictionary in (fitted("kmeans"), fitted(recipe=replace(QUICK, validation=0.0))):
        postures, _ = sample_postures(clips(), SMALL)
        symbols = dictionary.encode(postures)
        for symbol in np.unique(symbols):
            np.testing.assert_allclose(dictionary.postures[symbol], postures[symbols == symbol].mean(axis=0), atol=1e-4)


def test_the_papers_recipe_by_name() -> None:
    paper = recipe_of(PosturesConfig.pesta().dictionary)
    assert (paper.epochs, paper.batch, paper.learning_rate, paper.clip, paper.momentum) == (5000, 64, 1e-4, 5.0, 0.1)
    assert (paper.classes, paper.class_weight, paper.style_weight, paper.patience) == ("critic", 1.0, 1.0, 0)
    assert paper.count(640) == 50_000
    assert PosturesConfig.pesta().frames.representation == "rotations"
    postures, of = sample_postures(clips(), SMALL)
    trained = train_autoencoder(postures, of, SMALL, replace(paper, epochs=2, hidden=24, style=6, every=8))
    assert [step for step, _, _ in trained.metrics["curve"]] == [8, 16]
    assert all(1 <= occupied <= M for _, _, occupied in trained.metrics["curve"])
    assert trained.codes.shape == (M, 6)


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
    with pytest.raises(ValueError, match="softness is -1"):
        PosturesConfig(softness=-1.0)
    with pytest.raises(ValueError, match="classes by 'chance'"):
        AutoencoderRecipe(classes="chance")  # type: ignore[arg-type]
    save_file({"x": np.zeros(1)}, tmp_path / "other.safetensors")
    with pytest.raises(ValueError, match="holds no posture dictionary"):
        load_dictionary(tmp_path / "other.safetensors")


def test_a_dictionary_of_an_earlier_version_is_told_of(tmp_path: Path) -> None:
    kept = {"config": {"dictionary": "aae", "recipe": "default"}, "figures": {}}
    save_tensors(tmp_path / "old.safetensors", {"codes": np.zeros((2, 3))}, DICTIONARY_KEY, kept)
    with pytest.raises(
        ValueError, match="kind 'aae', as earlier versions made them; `motionlake run all` makes another"
    ):
        load_dictionary(tmp_path / "old.safetensors")
