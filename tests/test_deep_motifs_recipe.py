"""The paper's recipe: its positives and negatives, the loss, what stops it, and that its network learns."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import Float32Array
from motionlake.deep_motifs.config import NetworkConfig
from motionlake.deep_motifs.words import training
from motionlake.deep_motifs.words.deep_motifs import DeepMotifs, drawn, triplet_loss
from motionlake.deep_motifs.words.dtw import word_distances
from motionlake.deep_motifs.words.network import TrainedNetwork
from motionlake.deep_motifs.words.positives import anchors, closest_in_time, split_clips
from motionlake.deep_motifs.words.training import train_words
from motionlake.early_stopping import stands_still
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.config import LakeConfig
from motionlake.lake.layout import Lake, open_lake
from motionlake.motion.features import WordConfig, windows, word_windows
from motionlake.stages.reader import LakeReader
from motionlake.stages.word_network import WORD_NETWORK

from tests.lakes import motionlake
from tests.test_training import CONFIG, KilledError, clips

PAPER = NetworkConfig(recipe="deep_motifs", steps=6)
SMALL = DeepMotifs(batch=6, probes=12, every=2)


def naive_closest(starts: list[int], word: int, length: int, count: int) -> list[int]:
    """Words of one clip by the distance of their first frames from that of a word, the earlier first."""
    apart = sorted((abs(s - starts[word]), i) for i, s in enumerate(starts) if abs(s - starts[word]) >= length)
    near = [i for _, i in apart][:count]
    return [near[i % len(near)] for i in range(count)] if near else [word] * count


@settings(max_examples=60)
@given(
    frames=st.lists(st.integers(1, 90), min_size=1, max_size=5), length=st.integers(1, 16),
    stride=st.integers(1, 5), count=st.integers(1, 6),
)  # fmt: skip
def test_every_positive_in_time_is_the_next_nearest(frames: list[int], length: int, stride: int, count: int) -> None:
    config = replace(CONFIG, length=length, stride=stride)
    cut = [windows(n, config).tolist() for n in frames]
    owners = np.repeat(np.arange(len(cut)), [len(starts) for starts in cut])
    found = closest_in_time(owners, np.concatenate(cut), length, count)
    first = np.cumsum([0, *map(len, cut)])
    expected = [
        [first[clip] + place for place in naive_closest(starts, word, length, count)]
        for clip, starts in enumerate(cut)
        for word in range(len(starts))
    ]
    np.testing.assert_array_equal(found, expected)


def test_positives_lie_beside_a_word_in_its_whole_clip() -> None:
    """Of long clips of which only some can be trained on, whole ones are taken: 4 words within 20 frames."""
    long = [np.concatenate(clips(12, seed)) for seed in range(6)]
    count = sum(len(windows(len(clip), CONFIG)) for clip in long)
    trained, held_out = split_clips([len(windows(len(clip), CONFIG)) for clip in long], count // 2, 0.2, seed=0)
    assert trained
    assert held_out
    assert not set(trained) & set(held_out)
    found = anchors([long[clip] for clip in trained], CONFIG, temporal=4, nearest=5)
    assert len(found.words) == sum(len(windows(len(long[clip]), CONFIG)) for clip in trained)
    apart = np.abs(found.starts[found.temporal] - found.starts[:, None])
    assert (found.clips[found.temporal] == found.clips[:, None]).all()
    assert apart.min() == CONFIG.length
    inside = np.bincount(found.clips)[found.clips] - 1
    place = found.starts // CONFIG.stride
    away_from_ends = (place >= 5) & (place <= inside - 5)
    assert apart[away_from_ends].max() == CONFIG.length + CONFIG.stride
    with pytest.raises(ValueError, match="too few"):
        split_clips([50], 20, 0.1, seed=0)


def test_nearest_positives_are_those_of_any_clip_that_do_not_overlap() -> None:
    found = anchors(clips(6), CONFIG, temporal=4, nearest=3)
    distances = word_distances(found.words, found.words)
    overlap = found.clips[:, None] == found.clips
    overlap &= np.abs(found.starts[:, None] - found.starts) < CONFIG.length
    truth = np.sort(np.where(overlap, np.inf, distances), axis=1)[:, :3]
    reached = np.take_along_axis(distances, found.nearest, axis=1)
    np.testing.assert_allclose(reached, truth, rtol=1e-4, atol=1e-5)
    own = found.clips[found.nearest] == found.clips[:, None]
    assert own.any()
    assert not own.all()
    lone = anchors([clips(1)[0][:16]], CONFIG, temporal=4, nearest=3)
    np.testing.assert_array_equal(lone.nearest, [[0, 0, 0]])


def test_negatives_are_words_of_other_clips_and_far_away_ones() -> None:
    found = anchors(clips(6), CONFIG, temporal=4, nearest=3)
    rows = np.random.default_rng(0).integers(0, len(found.words), 40)
    allowed = found.negatives(rows, far=40)
    for i, one in enumerate(rows):
        for j, other in enumerate(rows):
            away = abs(int(found.starts[one]) - int(found.starts[other])) >= 40
            assert allowed[i, j] == (found.clips[one] != found.clips[other] or away)


def test_a_batch_holds_anchors_with_a_positive_of_either_kind_and_copies() -> None:
    found = anchors(clips(12), CONFIG, temporal=4, nearest=3)
    rows, batch = drawn(found, 50, np.random.default_rng(0), CONFIG, reversible=False)
    anchor, temporal, near, copy = np.split(batch, 4)
    np.testing.assert_array_equal(anchor, found.words[rows])
    np.testing.assert_allclose(copy[:, [0, -1]], anchor[:, [0, -1]], atol=1e-5)
    for row, *seen in zip(rows, temporal, near, strict=True):
        for word, positives in zip(seen, (found.temporal[row], found.nearest[row]), strict=True):
            assert (found.words[positives] == word).all(axis=(1, 2)).any()
    for words, table in ((temporal, found.temporal), (near, found.nearest)):
        here = (found.words[table[rows]] == words[:, None]).all(axis=(2, 3))
        assert here.any(axis=0).all(), "every positive of an anchor may be drawn"


def naive_loss(near: Float32Array, apart: Float32Array, allowed: np.ndarray, margin: float, negatives: str) -> float:
    losses = []
    for kind in near:
        for i, positive in enumerate(kind):
            others = [float(apart[i, j]) for j in range(len(apart)) if allowed[i, j]]
            if negatives == "semi-hard" and others:
                farther = [other for other in others if other > positive]
                others = [min(farther) if farther else max(others)]
            losses += [max(float(positive) - other + margin, 0.0) for other in others]
    return float(np.mean(losses)) if losses else 0.0


@pytest.mark.parametrize("negatives", ["random", "semi-hard"])
@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_the_loss_is_that_of_every_triplet(negatives: str, share: float) -> None:
    random = np.random.default_rng(1)
    near, apart = random.random((3, 7)).astype(np.float32), random.random((7, 7)).astype(np.float32)
    near[0, 0] = 2.0  # no negative is farther
    allowed = random.random((7, 7)) < share
    given = (torch.from_numpy(near), torch.from_numpy(apart), torch.from_numpy(allowed))
    found = float(triplet_loss(*given, 0.2, negatives))
    assert found == pytest.approx(naive_loss(near, apart, allowed, 0.2, negatives), abs=1e-6)


def test_training_stops_when_the_loss_stands_still() -> None:
    def hundredth(least: float) -> float:
        return least * 0.99

    assert not stands_still([], 2, hundredth)
    assert not stands_still([3.0, 2.0, 1.0], 2, hundredth)
    assert not stands_still([3.0, 4.0, 2.9, 3.5], 2, hundredth)
    assert stands_still([3.0, 4.0, 2.99, 3.5], 2, hundredth)  # falls by less than a hundredth
    assert stands_still([0.0, 0.0, 0.0], 2, hundredth)
    assert not stands_still([0.0, 0.0, 0.0], 0, hundredth)
    assert stands_still([-1.0, -1.0005, -1.0009], 2, lambda least: least - 1e-3)
    assert not stands_still([-1.0, -1.0005, -1.002], 2, lambda least: least - 1e-3)


def test_a_network_that_learns_no_more_stops_early_with_its_best_weights() -> None:
    words = word_windows(clips(12)[3], CONFIG)
    still = replace(SMALL, learning_rate=0.0, patience=3)
    found = train_words(clips(12), CONFIG, replace(PAPER, steps=500), deep_motifs=still)
    assert found.metrics["stopped"]
    assert found.metrics["steps"] < 500
    losses = found.metrics["held_out_loss"]
    assert len(losses) == found.metrics["steps"] / still.every
    best = (1 + int(np.argmin(losses))) * still.every
    again = train_words(clips(12), CONFIG, replace(PAPER, steps=best), deep_motifs=still)
    np.testing.assert_array_equal(again.embed(words), found.embed(words))


def kinds(seed: int) -> tuple[list[Float32Array], np.ndarray]:
    """Twelve clips of four movements, each at its own speed, while the posture drifts, which tells nothing."""
    random = np.random.default_rng(seed)
    mixes = np.random.default_rng(7).standard_normal((4, 2, CONFIG.dimension)) * 0.1
    time, labels = np.arange(120), np.arange(12) % 4
    made = []
    for label in labels:
        turn = time[:, None] * random.uniform(0.25, 0.5) + random.uniform(0, 6)
        places = random.standard_normal((CONFIG.dimension, 6)) * 0.1
        drift = np.stack([np.interp(time, np.arange(6) * 24, place) for place in places], axis=1)
        made.append((np.hstack([np.sin(turn), np.cos(turn)]) @ mixes[label] + drift).astype(np.float32))
    return made, labels


def agreement(network: TrainedNetwork, seed: int) -> float:
    """Share of words of unseen clips whose nearest word of another clip is of the same movement."""
    made, labels = kinds(seed)
    cut = [word_windows(clip, CONFIG) for clip in made]
    owners = np.repeat(np.arange(len(cut)), [len(words) for words in cut])
    places = network.embed(np.concatenate(cut)).astype(np.float64)
    apart = np.square(places[:, None] - places[None]).sum(axis=2)
    apart[owners[:, None] == owners] = np.inf
    return float(np.mean(labels[owners] == labels[owners[apart.argmin(axis=1)]]))


@pytest.mark.parametrize("negatives", ["random", "semi-hard"])
def test_the_paper_s_network_learns(negatives: str) -> None:
    config, recipe = replace(PAPER, negatives=negatives, steps=80), DeepMotifs(batch=24, probes=48, every=10)
    made, _ = kinds(0)
    start, trained = (
        train_words(made, CONFIG, each, deep_motifs=recipe) for each in (replace(config, steps=0), config)
    )
    losses = trained.metrics["held_out_loss"]
    assert losses[-1] < 0.5 * losses[0]
    assert agreement(trained, 9) > agreement(start, 9) + 0.3


def test_resumed_training_gives_the_same_weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training, "CHECKPOINT_EVERY", 3)
    monkeypatch.setattr(training, "REPORT_EVERY", 3)
    kept = tmp_path / "checkpoint"

    def train(progress: object = None, checkpoint: Path | None = None) -> bytes:
        found = train_words(
            clips(12), CONFIG, PAPER, deep_motifs=SMALL, checkpoint=checkpoint, progress=progress  # type: ignore[arg-type]
        )  # fmt: skip
        found.save(tmp_path / "network")
        return (tmp_path / "network").read_bytes()

    def killed(step: int, steps: int, loss: float) -> None:
        if step == 3:
            raise KilledError

    whole = train()
    assert train() == whole
    with pytest.raises(KilledError):
        train(killed, kept)
    assert kept.is_file()
    seen: list[int] = []
    assert train(lambda step, steps, loss: seen.append(step), kept) == whole
    assert seen == [6]
    assert not kept.exists()


def test_the_configuration_chooses_the_paper_s_network(built_lake: Path) -> None:
    assert NetworkConfig().built == "moves"
    assert NetworkConfig(recipe="deep_motifs").built == "inception736"
    assert NetworkConfig("conv", recipe="deep_motifs").built == "conv"
    with pytest.raises(ValueError, match="not metric or deep_motifs"):
        NetworkConfig(recipe="paper")
    with pytest.raises(ValueError, match="not random or semi-hard"):
        NetworkConfig(negatives="hard")
    target, config = open_lake(built_lake), LakeConfig()
    with reading(target) as con:
        keys = {
            WORD_NETWORK.key(LakeReader(con, target, replace(config, network=network)))
            for network in (
                NetworkConfig(), PAPER, replace(PAPER, negatives="semi-hard"), NetworkConfig("inception736"),
            )
        }  # fmt: skip
        assert len(keys) == 4
        paper = replace(config, network=PAPER)
        assert not WORD_NETWORK.takes_pretrained(LakeReader(con, target, paper))
        assert "inception736, at most 6 steps" in WORD_NETWORK.announce(LakeReader(con, target, paper))


def test_a_lake_trains_the_paper_s_network_and_embeds_with_it(lake: Path, scheduler: str) -> None:
    (lake / "config.toml").write_text(
        '[postures]\ndictionary = "kmeans"\nm = 40\n'
        '[network]\nrecipe = "deep_motifs"\nsteps = 3\nmax_words = 300\n[motifs]\nk = 8\n',
        encoding="utf-8",
    )
    trained = motionlake("train", "words", "--lake", lake, "--json")
    assert trained.status == 0, trained.err
    assert trained.json["metrics"]["steps"] == 3
    assert len(trained.json["metrics"]["held_out_loss"]) == 1
    with reading(Lake(lake)) as con:
        assert fetch(con, "current_model", {"kind": "network"})[0]["model"] == trained.json["model"]
    run = motionlake("run", "signatures", "--lake", lake, "--scheduler", scheduler)
    assert run.status == 0, run.err


def test_words_of_rotations_are_trained_on_too() -> None:
    rotations = WordConfig.deep_motifs()
    random = np.random.default_rng(0)
    made = []
    for _ in range(6):
        turned = random.standard_normal((40, 16, 4)).cumsum(axis=0)
        turned /= np.linalg.norm(turned, axis=2, keepdims=True)
        made.append(turned.reshape(40, -1).astype(np.float32))
    assert made[0].shape[1] == rotations.dimension
    found = train_words(made, rotations, replace(PAPER, steps=2), deep_motifs=SMALL)
    assert found.embed(word_windows(made[0], rotations)).shape == (7, 736)
