"""Clusters of clips: places that keep distances, groups that are there, one answer however it is asked for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from motionlake.deep_motifs.classification import cluster_clips, mds
from motionlake.errors import UserError
from motionlake.retrieval.sql_functions import connect
from scipy.spatial.distance import cdist
from sklearn.metrics import adjusted_rand_score

from tests.lakes import motionlake, query


def test_places_keep_euclidean_distances() -> None:
    points = np.random.default_rng(0).standard_normal((12, 3))
    distances = cdist(points, points)
    places = mds(distances, 5)
    np.testing.assert_allclose(cdist(places, places), distances, atol=1e-3)
    np.testing.assert_array_equal(places, mds(distances, 5))


def test_groups_are_found_and_numbered_by_size() -> None:
    random = np.random.default_rng(1)
    sizes = [4, 9, 6]
    points = np.concatenate([random.normal(10 * i, 0.5, (n, 2)) for i, n in enumerate(sizes)])
    truth = np.repeat([2, 0, 1], sizes)
    distances = cdist(points, points)
    for k in (3, None):
        found = cluster_clips(distances, k)
        assert found.clusters.tolist() == truth.tolist()
        assert found.silhouette > 0.8
    assert cluster_clips(distances, 5, seed=1).clusters.max() == 4


def test_clusters_do_not_depend_on_how_clips_are_ordered() -> None:
    points = np.concatenate([np.random.default_rng(s).normal(8 * s, 1, (7, 2)) for s in range(3)])
    order = np.random.default_rng(9).permutation(len(points))
    plain = cluster_clips(cdist(points, points), 3).clusters
    mixed = cluster_clips(cdist(points[order], points[order]), 3).clusters
    assert adjusted_rand_score([str(c) for c in plain[order]], mixed.tolist()) == 1


def test_adjusted_rand_index_by_hand() -> None:
    assert adjusted_rand_score(list("aabb"), [7, 7, 3, 3]) == 1
    assert adjusted_rand_score(list("aabb"), [0, 1, 0, 1]) == pytest.approx(-0.5)
    assert adjusted_rand_score(list("aabb"), [0, 0, 0, 0]) == 0


@pytest.mark.parametrize(("n", "k", "says"), [(2, 2, "at least 3"), (5, 1, "2 to 4"), (5, 5, "2 to 4")])
def test_impossible_numbers_are_refused(n: int, k: int, says: str) -> None:
    points = np.arange(n, dtype=np.float64)[:, None]
    with pytest.raises(UserError, match=says):
        cluster_clips(cdist(points, points), k)


def test_command_and_macro_give_the_same_clusters(built_lake: Path) -> None:
    run = motionlake("cluster", "--k", 3, "--lake", built_lake, "--json")
    assert run.status == 0, run.err
    con = connect(built_lake)
    try:
        rows = con.execute("SELECT clip, cluster FROM clip_clusters(k := 3)").fetchall()
    finally:
        con.close()
    assert [(r["clip"], r["cluster"]) for r in run.json] == rows
    assert {r[0] for r in rows} == {r[0] for r in query(built_lake, "SELECT clip FROM clips")}
    sizes = np.bincount([r[1] for r in rows])
    assert len(sizes) == 3
    assert sizes.tolist() == sorted(sizes, reverse=True)
    for words, says in ((["--k", "many"], "a number of clusters"), (["--k", 99], "ask for 2 to")):
        wrong = motionlake("cluster", *words, "--lake", built_lake)
        assert wrong.status == 2
        assert says in wrong.err


@pytest.mark.recordings
def test_classes_of_real_recordings_are_found_without_labels(recordings: Path) -> None:
    """Five classes of hdm05, untrained words: the clusters follow the classes."""
    from motionlake.deep_motifs.emd import emd_matrix, ground_distances
    from motionlake.deep_motifs.motifs import assign, fit_motifs
    from motionlake.deep_motifs.signatures import signatures
    from motionlake.motion.features import WordConfig

    from bench.canonical_sets import features, load
    from bench.representation import shallow

    chosen = [clip for clip in load("hdm05") if clip.label[0] in "hkls"][::3]
    embedded = shallow(features(chosen, WordConfig()), WordConfig(), 0)
    motifs = fit_motifs(np.concatenate(embedded), 60, 0)
    made, _ = signatures([assign(words, motifs) for words in embedded], motifs.k)
    found = cluster_clips(emd_matrix(made, ground_distances(motifs.centroids)), 5)
    assert adjusted_rand_score([clip.label for clip in chosen], found.clusters.tolist()) > 0.75
