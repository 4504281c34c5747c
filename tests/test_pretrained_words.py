"""The pretrained word network, and `motionlake train words`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from motionlake.deep_motifs.config import PRETRAINED_WORDS, NetworkConfig
from motionlake.deep_motifs.words.network import load_network
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.config import LakeConfig
from motionlake.lake.layout import Lake, open_lake
from motionlake.motion.features import WordConfig
from motionlake.stages import word_network
from motionlake.stages.reader import LakeReader
from motionlake.stages.word_network import WORD_NETWORK

from tests.lakes import motionlake, quick_lake


def current_network(lake: Path) -> dict[str, object]:
    with reading(Lake(lake)) as con:
        return fetch(con, "current_model", {"kind": "network"})[0]


def test_the_pretrained_network_is_the_one_its_description_names() -> None:
    network = load_network(PRETRAINED_WORDS.file)
    about = PRETRAINED_WORDS.about()
    assert PRETRAINED_WORDS.fits(WordConfig(), NetworkConfig())
    assert not PRETRAINED_WORDS.fits(WordConfig(length=16), NetworkConfig())
    assert not PRETRAINED_WORDS.fits(WordConfig(), NetworkConfig(weights="own"))
    assert not PRETRAINED_WORDS.fits(WordConfig(), NetworkConfig("conv"))
    assert network.words == WordConfig()
    assert network.metrics["data_sha256"] == about["data_sha256"]
    assert set(about["sets"]) == {"cmu_dance", "cmu_bvh", "cmu_exercises", "cmu_86"}
    assert PRETRAINED_WORDS.file.stat().st_size < 20_000_000
    words = np.random.default_rng(0).standard_normal((3, 12, 88)).astype(np.float32)
    assert np.linalg.norm(network.embed(words), axis=1).min() > 0


@pytest.mark.parametrize("counts", [[], [1], [3, 1, 90, 64, 200], [1500, 2, 1100], [40] * 60])
def test_clips_embedded_together_are_the_same_bits_as_each_alone(counts: list[int]) -> None:
    network, rng = load_network(PRETRAINED_WORDS.file), np.random.default_rng(1)
    clips = [(str(i), rng.standard_normal((count, 12, 88)).astype(np.float32)) for i, count in enumerate(counts)]
    together = list(network.embed_clips(iter(clips)))
    assert [clip for clip, _ in together] == [clip for clip, _ in clips]
    for (_, words), (_, vectors) in zip(clips, together, strict=True):
        np.testing.assert_array_equal(vectors, network.embed(words))


def test_a_lake_is_embedded_pretrained_then_fine_tuned_then_afresh(
    tmp_path: Path, clips_folder: Path, scheduler: str
) -> None:
    lake = quick_lake(tmp_path / "lake")
    (lake / "config.toml").write_text(
        '[postures]\ndictionary = "kmeans"\nm = 40\n[network]\nmax_words = 500\n[motifs]\nk = 8\n', encoding="utf-8"
    )
    assert motionlake("train", "words", "--lake", lake).status == 2  # no words yet
    assert motionlake("ingest", clips_folder, "--lake", lake, "--scheduler", scheduler).status == 0
    run = motionlake("run", "all", "--lake", lake, "--scheduler", scheduler)
    assert run.status == 0, run.err
    assert "the pretrained word network embeds the words" in run.err
    taken = current_network(lake)
    assert motionlake("report", "--out", tmp_path / "report.html", "--lake", lake).status == 0
    assert "pretrained, from cmu_dance" in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert (lake / str(taken["file"])).read_bytes() == PRETRAINED_WORDS.file.read_bytes()
    signatures = motionlake("sql", "SELECT signature FROM signatures ORDER BY clip", "--json", "--lake", lake).json
    for words in (["--fine-tune"], []):
        trained = motionlake("train", "words", *words, "--json", "--lake", lake)
        assert trained.status == 0, trained.err
        assert trained.json["metrics"].get("fine_tuned_from") == (taken["model"] if words else None)
        assert trained.json["metrics"]["words"] <= 500
        assert current_network(lake)["model"] == trained.json["model"]
    again = motionlake("run", "all", "--lake", lake, "--scheduler", scheduler)
    assert again.status == 0, again.err
    after = motionlake("sql", "SELECT signature FROM signatures ORDER BY clip", "--json", "--lake", lake).json
    assert len(after) == len(signatures)
    assert after != signatures


def test_a_lake_with_words_enough_trains_a_network_of_its_own(
    built_lake: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target, config = open_lake(built_lake), LakeConfig()
    with reading(target) as con:
        ((count,),) = con.execute("SELECT count(*) FROM words").fetchall()
        for enough, taken in ((count + 1, True), (count, False)):
            monkeypatch.setattr(word_network, "ENOUGH", enough)
            assert WORD_NETWORK.takes_pretrained(LakeReader(con, target, config)) is taken
            wanted = replace(config, network=replace(config.network, weights="pretrained"))
            assert WORD_NETWORK.takes_pretrained(LakeReader(con, target, wanted))
        monkeypatch.setattr(word_network, "ENOUGH", 10**9)
        wanted = replace(config, network=replace(config.network, weights="own"))
        assert not WORD_NETWORK.takes_pretrained(LakeReader(con, target, wanted))


def test_configurations_of_the_network_without_meaning_are_refused() -> None:
    assert LakeConfig().network.weights == "auto"
    with pytest.raises(ValueError, match="auto, pretrained or own"):
        NetworkConfig(weights="theirs")
    with pytest.raises(ValueError, match="two words"):
        NetworkConfig(max_words=1)
