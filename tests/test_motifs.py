"""Clustering of embedded words into motifs."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from motionlake.deep_motifs import motifs as module
from motionlake.deep_motifs.motifs import Motifs, assign, fit_motifs

from tests.lakes import made_clips, motionlake, quick_lake


def blobs(sizes: list[int], spread: list[float], seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    corners = 10 * np.eye(len(sizes), 6)
    parts = [corners[i] + spread[i] * rng.standard_normal((n, 6)) for i, n in enumerate(sizes)]
    return np.concatenate(parts).astype(np.float32)


def test_clusters_are_found_and_dense_ones_come_first() -> None:
    words = blobs([200, 200, 20], [0.5, 0.05, 0.5])
    motifs = fit_motifs(words, 3, seed=1)
    labels = assign(words, motifs)
    assert [len(set(part)) for part in (labels[:200], labels[200:400], labels[400:])] == [1, 1, 1]
    assert [labels[200], labels[0], labels[400]] == [0, 1, 2]
    assert np.all(np.diff(motifs.strength) < 0)
    for label in range(3):
        np.testing.assert_allclose(motifs.centroids[label], words[labels == label].mean(axis=0), atol=1e-4)


def test_assignment_is_the_nearest_centroid_and_ties_go_to_the_lowest() -> None:
    rng = np.random.default_rng(2)
    motifs = Motifs(rng.standard_normal((9, 5)).astype(np.float32), np.ones(9))
    words = rng.standard_normal((500, 5)).astype(np.float32)
    distances = ((words[:, None].astype(float) - motifs.centroids[None]) ** 2).sum(axis=2)
    np.testing.assert_array_equal(assign(words, motifs), distances.argmin(axis=1))
    tied = Motifs(np.array([[1, 0], [0, 1], [1, 0], [-1, 0]], dtype=np.float32), np.ones(4))
    assert assign(np.array([[0, 0], [2, 0], [2, 2]], dtype=np.float32), tied).tolist() == [0, 0, 0]


def test_one_seed_gives_one_vocabulary() -> None:
    words = np.random.default_rng(3).standard_normal((800, 8)).astype(np.float32)
    first, second, other = (fit_motifs(words, 20, seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first.centroids, second.centroids)
    np.testing.assert_array_equal(first.strength, second.strength)
    assert not np.array_equal(first.centroids, other.centroids)


def test_fewer_words_than_motifs_give_fewer_motifs() -> None:
    words = np.array([[0, 0], [0, 0], [1, 1], [5, 5], [5, 5], [5, 5]], dtype=np.float32)
    motifs = fit_motifs(words, 100, seed=0)
    assert motifs.k == 3
    assert motifs.centroids[0].tolist() == [5, 5]
    assert fit_motifs(words[:1], 4, seed=0).k == 1


def test_many_words_are_subsampled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_WORDS", 300)
    words = blobs([2000, 2000], [0.1, 0.1])
    motifs = fit_motifs(words, 2, seed=4)
    np.testing.assert_allclose(np.sort(motifs.centroids[:, 0]), [0, 10], atol=0.05)


def test_words_that_cannot_be_clustered_are_refused() -> None:
    with pytest.raises(ValueError, match="cannot be clustered"):
        fit_motifs(np.empty((0, 4), dtype=np.float32), 3, seed=0)
    with pytest.raises(ValueError, match="not finite"):
        fit_motifs(np.full((4, 2), np.nan, dtype=np.float32), 2, seed=0)


def test_more_motifs_than_words_are_an_error(tmp_path: Path, scheduler: str) -> None:
    source, lake = tmp_path / "clips", quick_lake(tmp_path / "lake", "[motifs]\nk = 500\n")
    made_clips(source, 1)
    assert motionlake("ingest", source, "--lake", lake, "--scheduler", scheduler).status == 0
    run = motionlake("run", "all", "--lake", lake, "--scheduler", scheduler)
    assert run.status == 2
    assert re.search(r"holds \d+ words, too few for 500 motifs; .*set k below \[motifs\] .* to \d+ or less", run.err)
