"""Clusters of clips: places that keep distances, groups that are there, one answer however it is asked for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from motionlake.deep_motifs.classification import cluster_clips, mds
from motionlake.errors import UserError
from motionlake.motion.diffusion import joined_of, way_between
from motionlake.retrieval import clusters
from motionlake.retrieval.clusters import fused, group
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


def test_the_way_between_clips_is_that_of_a_walk() -> None:
    """Steps counted one by one, weights by loops; also where clips coincide."""
    points = np.random.default_rng(3).standard_normal((14, 2))
    points[5] = points[6]
    distances = cdist(points, points)
    n, joined = len(points), joined_of(len(points))
    order = [[int(j) for j in np.argsort(row) if j != i] for i, row in enumerate(distances)]
    scales = [max(distances[i, order[i][joined - 1]], 1e-12) for i in range(n)]
    weights = np.zeros((n, n))
    for i in range(n):
        edges = {j: np.exp(-(distances[i, j] ** 2) / (scales[i] * scales[j])) for j in order[i]}
        least = sorted(edges.values())[-joined]
        for j in (j for j, edge in edges.items() if edge >= least):
            weights[i, j] = weights[j, i] = edges[j]
    root = np.diag(1 / np.sqrt(weights.sum(axis=1)))
    step, walk, total = 0.95 * root @ weights @ root, np.eye(n), np.eye(n)
    for _ in range(2000):
        walk = walk @ step
        total += walk
    lengths = np.sqrt(np.diag(total))
    np.testing.assert_allclose(way_between(distances), total / np.outer(lengths, lengths), atol=1e-6)


def test_chains_are_told_apart_along_the_graph() -> None:
    """Two rows of points side by side: by distance alone they are cut across."""
    places = np.linspace(0, 2.4, 24)
    points = np.concatenate([np.column_stack([places, np.full(24, side)]) for side in (0.0, 1.0)])
    truth = np.repeat([0, 1], 24)
    apart, way = fused({"moves": cdist(points, points)})
    by_both, silhouette = group(apart, way, 2)
    assert adjusted_rand_score(truth, by_both) == 1
    assert silhouette > 0
    by_distance, _ = group(apart, np.zeros_like(apart), 2)
    assert adjusted_rand_score(truth, by_distance) < 0.5


def test_groups_by_several_methods_do_not_depend_on_their_units() -> None:
    random = np.random.default_rng(5)
    points = np.concatenate([random.normal(6 * i, 1, (n, 3)) for i, n in enumerate((9, 5, 7))])
    truth = np.repeat([0, 2, 1], (9, 5, 7))
    moves, signatures = cdist(points, points), cdist(points[:, :1], points[:, :1])
    plain, scaled = (
        fused({"moves": moves, "signature": signatures}),
        fused({"moves": 50 * moves, "signature": signatures}),
    )
    for one, other in zip(plain, scaled, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)
    for k in (3, None):
        assert group(*plain, k)[0].tolist() == truth.tolist()
    same = np.zeros((6, 6))
    assert len(group(*fused({"moves": same}), 2)[0]) == 6


def test_pairs_that_cannot_be_compared_are_as_far_as_the_median() -> None:
    found = np.array([[0.0, 2, 6], [4, 0, 9], [6, 9, 0]])
    spread = clusters._spread(found, np.array([True, False, True, True]))
    assert spread is not None
    assert spread.tolist() == [[0, 6, 3, 6], [6, 0, 6, 6], [3, 6, 0, 9], [6, 6, 9, 0]]
    assert clusters._spread(np.zeros((1, 1)), np.array([True, False])) is None


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
    paper = motionlake("cluster", "--k", 3, "--method", "signatures", "--lake", built_lake, "--json")
    assert {r["clip"] for r in paper.json} == {r[0] for r in rows}
    for words, says in (
        (["--k", "many"], "a number of clusters"),
        (["--k", 99], "ask for 2 to"),
        (["--method", "luck"], "fused, signatures"),
    ):
        wrong = motionlake("cluster", *words, "--lake", built_lake)
        assert wrong.status == 2
        assert says in wrong.err


@pytest.mark.recordings
def test_classes_of_real_recordings_are_found_without_labels(recordings: Path) -> None:
    """Eleven classes of hdm05, which the pretrained words never saw: the clusters are the classes.

    With the columns of the weights shuffled the index is .89.
    """
    from bench.canonical_sets import load
    from tests.pretrained_words import signature_distances

    chosen = load("hdm05")[::2]
    labels = [clip.label for clip in chosen]
    assert len(set(labels)) == 11
    found = cluster_clips(signature_distances(chosen, 100), 11)
    assert adjusted_rand_score(labels, found.clusters.tolist()) > 0.95
