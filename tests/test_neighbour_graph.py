"""The neighbour graph: what the stage keeps, what search makes of it, and diffusion against a naive one."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motionlake.arrays import Float64Array
from motionlake.evaluation.ranking import Questions, score_search
from motionlake.lake.config import LakeConfig
from motionlake.lake.layout import open_lake
from motionlake.motion.diffusion import (
    AGAIN,
    FEWEST,
    NOWHERE,
    RECIPROCAL,
    RESTART,
    SHARPNESS,
    UNIT,
    NeighbourGraph,
    diffused,
    diffused_again,
)
from motionlake.retrieval.fused import FusedSearcher
from motionlake.retrieval.hits import TOGETHER
from motionlake.retrieval.lake_neighbours import read_neighbours
from motionlake.retrieval.protocol import Query, Scope
from motionlake.retrieval.registry import searcher
from motionlake.retrieval.views import View, near_again
from motionlake.retrieval.weighing import AGREEMENT, DIRECT, WEIGHTS, weights_of
from motionlake.stages.graph import GRAPH, KEPT
from motionlake.stages.reader import lake_reader

from tests.lakes import Changed, list_anew, motionlake, query


def apart(points: Float64Array) -> Float64Array:
    return np.asarray(np.linalg.norm(points[:, None] - points[None], axis=-1))


def graph_of(distances: Float64Array, kept: int) -> NeighbourGraph:
    others = distances + np.diag(np.full(len(distances), np.inf))
    order = np.argsort(others, axis=1, kind="stable")[:, :kept]
    return NeighbourGraph(order, np.take_along_axis(others, order, axis=1), len(distances))


def naive(
    distances: Float64Array, start: int, reciprocal: int = RECIPROCAL, sharpness: float = SHARPNESS
) -> Float64Array:
    """[n] diffusion over the graph of all clips, edge by edge and step by step."""
    n = len(distances)
    unit, most = (max(1, min(k, n // FEWEST)) for k in (UNIT, reciprocal))
    others = [sorted(set(range(n)) - {i}, key=lambda j: (distances[i, j], j)) for i in range(n)]
    scales = [distances[i, others[i][min(unit, n - 1) - 1]] for i in range(n)]
    radii = [distances[i, others[i][min(most, n - 1) - 1]] for i in range(n)]
    weights = np.zeros((n, n))
    for i in range(n):
        for j in others[i]:
            if distances[i, j] <= min(radii[i], radii[j]) * (1 + 1e-6):  # as lists in single precision need
                weights[i, j] = np.exp(-sharpness * distances[i, j] ** 2 / (scales[i] * scales[j]))
    degrees = weights.sum(axis=1)
    degrees[degrees == 0] = 1
    steps = np.eye(n)
    passed = np.eye(n)
    for _ in range(600):
        passed = (1 - RESTART) * (weights / np.sqrt(np.outer(degrees, degrees))) @ passed
        steps += passed
    return np.asarray(steps[start] / np.sqrt(steps[start, start] * np.diag(steps)))


@given(st.integers(3, 120), st.integers(0, 1000))
def test_diffusion_against_a_naive_one(count: int, seed: int) -> None:
    distances = apart(np.random.default_rng(seed).normal(size=(count, 3)))
    nodes = np.argsort(distances[0], kind="stable")[1:]
    found = diffused(graph_of(distances, count - 1), nodes, distances[0, nodes], own=0)
    np.testing.assert_allclose(found[-1, :-1], naive(distances, 0)[nodes], atol=1e-6)
    np.testing.assert_allclose(found[0, 1:-1], naive(distances, int(nodes[0]))[nodes[1:]], atol=1e-6)
    # A query that is no clip of the lake is joined to it for the moment.
    rest = distances[1:, 1:]
    outside = diffused(graph_of(rest, count - 2), nodes - 1, distances[0, nodes])
    assert ((outside >= 0) & (outside <= 1 + 1e-9)).all()


@given(st.integers(3, 60), st.integers(0, 1000))
def test_a_further_way_against_a_naive_one(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    near = np.exp(-apart(rng.normal(size=(count, 3))))
    found = diffused_again(near, count)
    distances = 1 - near
    np.fill_diagonal(distances, 0)
    for clip in (0, count - 1):
        np.testing.assert_allclose(found[clip], naive(distances, clip, AGAIN, 1.0), atol=1e-6)


@given(st.integers(2, 60), st.integers(0, 1000), st.integers(1, 30))
def test_how_many_neighbours_are_mutual(count: int, seed: int, kept: int) -> None:
    distances = apart(np.random.default_rng(seed).normal(size=(count, 2)))
    graph = graph_of(distances, min(kept, count - 1))
    most = max(1, min(UNIT, count // FEWEST))
    near = [set(row[:most].tolist()) for row in graph.neighbours]
    pairs = [(clip, other) for clip in range(count) for other in near[clip]]
    assert graph.mutual() == pytest.approx(np.mean([clip in near[other] for clip, other in pairs]))


def test_a_lake_counts_what_tells_its_clips_apart() -> None:
    """The weights of methods without a graph stay as they are beside the others."""
    assert weights_of(["moves", "other"], {}) == {"moves": WEIGHTS["moves"], "other": 1.0}
    found = weights_of(["moves", "signature", "other"], {"moves": 0.4, "signature": 0.8})
    assert found["moves"] == pytest.approx(WEIGHTS["moves"] * (0.4 / 0.6) ** AGREEMENT)
    assert found["signature"] == pytest.approx(WEIGHTS["signature"] * (0.8 / 0.6) ** AGREEMENT)
    assert found["other"] == 1.0
    assert weights_of(["moves"], {"moves": 0.0}) == {"moves": WEIGHTS["moves"]}
    assert NeighbourGraph(np.full((3, 1), NOWHERE), np.full((3, 1), np.inf), 3).mutual() == 1.0


def test_a_clip_is_joined_only_to_those_that_it_is_near_to() -> None:
    """Of a small class all that is left over is far: to it the others are the nearest, but not it to them."""
    rng = np.random.default_rng(0)
    many, few = rng.normal(size=(100, 2)), rng.normal(size=(3, 2)) * 0.1 + 30
    distances = apart(np.concatenate([many, few]))
    nodes = np.argsort(distances[100], kind="stable")[1:]
    found = diffused(graph_of(distances, 32), nodes, distances[100, nodes], own=100)[-1, :-1]
    assert (found[:2] > 0.5).all()
    assert not found[2:].any()


def test_the_ways_of_several_methods_are_put_together() -> None:
    one = np.array([[1.0, 0.2, 0.5], [0.2, 1.0, 0.1], [0.5, 0.1, 1.0]])
    other = np.array([[1.0, 0.8], [0.8, 1.0]])
    nothing = np.zeros(0)
    views = {
        "one": View(["a", "b"], nothing, nothing, one),
        "other": View(["c"], nothing, nothing, other),
        "without": View(["d"], nothing, nothing, None),
    }
    near = np.array([[0.75, 0.15, 0, 0.375], [0.15, 0.75, 0, 0.075], [0, 0, 0.25, 0.2], [0.375, 0.075, 0.2, 1]])
    expected = diffused_again(near, 40)
    found = near_again(views, {"one": 3, "other": 1, "without": 5}, 40)
    assert found == pytest.approx(dict(zip("abc", expected[-1, :-1].tolist(), strict=True)))
    assert near_again({"without": views["without"]}, {"without": 5}, 40) == {}


def test_a_chain_is_followed() -> None:
    """Of two clips as far from the query, that one is nearer along the graph to which others lead."""
    chain = np.column_stack([np.arange(0, 21.0), np.zeros(21)])
    alone = np.column_stack([np.full(12, -1.0), 20 + 0.1 * np.arange(12)])
    points = np.concatenate([chain, alone])
    points[20], points[21] = (20.0, 0.0), (0.0, 20.0)
    distances = apart(points)
    nodes = np.argsort(distances[0], kind="stable")[1:]
    ways = diffused(graph_of(distances, 20), nodes, distances[0, nodes], 0)[-1, :-1]
    found = dict(zip(nodes.tolist(), ways.tolist(), strict=True))
    assert distances[0, 20] == distances[0, 21]
    assert found[20] > 3 * found[21]


def test_clips_that_the_graph_does_not_hold() -> None:
    empty = NeighbourGraph(np.full((0, 1), NOWHERE), np.full((0, 1), np.inf), 0)
    found = diffused(empty, np.full(3, NOWHERE), np.array([1.0, 1.5, 2.0]))
    assert found.shape == (4, 4)
    assert found[-1, 0] > 0 == found[-1, 2]  # of so small a lake one neighbour counts
    assert diffused(empty, np.zeros(0, dtype=np.int64), np.zeros(0)) == 1
    one = diffused(empty, np.full(1, NOWHERE), np.zeros(1))
    assert 0 < one[-1, 0] <= 1


def test_the_stage_keeps_the_nearest_clips(built_lake: Path) -> None:
    lake = open_lake(built_lake)
    known = read_neighbours(lake)
    assert set(known.methods) == set(WEIGHTS)
    clips = [row[0] for row in query(built_lake, "SELECT clip FROM clips ORDER BY clip")]
    assert set(known.nodes) == set(clips)
    for method in known.methods:
        found = searcher("clip", method, lake)
        strings = dict(query(built_lake, "SELECT clip, len(symbols) FROM symbol_strings"))
        for clip in clips[::3]:
            rows = query(
                built_lake,
                "SELECT neighbour, distance FROM clip_neighbours WHERE clip = $clip AND method = $method ORDER BY rank",
                clip=clip, method=method,
            )  # fmt: skip
            if method == "alignment" and strings[clip] < 2:
                assert rows == []
                continue
            (hits,) = found.search([Query(clip)], KEPT)
            assert [row[1] for row in rows] == pytest.approx([hit.distance for hit in hits], abs=1e-5)
            nearer = {hit.clip for hit in hits if hit.distance < hits[-1].distance - 1e-6}
            assert nearer <= {row[0] for row in rows}


def test_search_by_its_definition(built_lake: Path) -> None:
    lake = open_lake(built_lake)
    names = "SELECT clip FROM symbol_strings JOIN signatures USING (clip) WHERE len(symbols) > 3 ORDER BY clip LIMIT 1"
    ((clip,),) = query(built_lake, names)
    (hits,) = FusedSearcher(lake, explain=True).search([Query(clip)], 6)
    for hit in hits:
        assert hit.shares is not None
        assert [share.method for share in hit.shares] == [*WEIGHTS, TOGETHER]
        assert sum(share.weight for share in hit.shares) == pytest.approx(1)
        near = 0.0
        for share in hit.shares:
            assert share.along is not None
            near += share.weight * (share.along + DIRECT * share.near) / (1 + DIRECT)
        assert hit.distance == pytest.approx(1 - near)
    (plain,) = FusedSearcher(lake, graph=False, explain=True).search([Query(clip)], 6)
    assert all(share.along is None for hit in plain for share in hit.shares or ())
    assert [hit.distance for hit in plain] != [hit.distance for hit in hits]


def test_the_command_says_why(built_lake: Path, lake: Path) -> None:
    ((clip,),) = query(built_lake, "SELECT max(clip) FROM symbol_strings WHERE len(symbols) > 3")
    words = ("search", clip, "-k", 2, "--lake", built_lake)
    rows = motionlake(*words, "--explain", "--json").json
    assert all({share["method"] for share in row["shares"]} <= {*WEIGHTS, TOGETHER} for row in rows)
    said = motionlake(*words, "--explain").out
    (moves,) = (share["weight"] for share in rows[0]["shares"] if share["method"] == "moves")
    assert f"moves ({moves:.0%})" in said
    assert "graph 0." in said
    assert "together (43%)" in said
    without = motionlake(*words, "--no-graph", "--json").json
    assert "shares" not in without[0]
    assert [row["distance"] for row in without] != [row["distance"] for row in rows]
    with Changed(lake) as con:
        con.execute("DELETE FROM manifest WHERE stage = 'graph'")
    assert motionlake("search", clip, "-k", 2, "--lake", lake, "--json").json == without, "a lake without a graph"
    for flag in ("--explain", "--no-graph"):
        run = motionlake(*words, flag, "--method", "signature")
        assert (run.status, f"{flag}: is for --method fused" in run.err) == (2, True)


@pytest.fixture
def lake(built_lake: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(built_lake, tmp_path / "lake"))


def test_clips_that_come_and_go(lake: Path) -> None:
    """The graph is due when clips come or go; until then those that are gone are no answers."""
    ((gone, clip),) = query(lake, "SELECT min(clip), max(clip) FROM symbol_strings WHERE len(symbols) > 3")
    assert motionlake("remove", gone, "--lake", lake).status == 0
    rows = motionlake("search", clip, "-k", 99, "--lake", lake, "--json").json
    assert gone not in {row["clip"] for row in rows}
    assert query(lake, "SELECT count(*) FROM clip_neighbours WHERE $clip IN (clip, neighbour)", clip=gone) == [(0,)]
    assert motionlake("run", "graph", "--lake", lake).status == 0
    assert gone not in read_neighbours(open_lake(lake)).nodes
    assert motionlake("run", "graph", "--lake", lake, "--json").status == 0


def test_a_damaged_graph_is_made_again(lake: Path) -> None:
    (part,) = lake.glob("graph/*.parquet")
    before = part.read_bytes()
    part.write_bytes(before[:-60] + bytes(byte ^ 0x5A for byte in before[-60:-8]) + before[-8:])  # its footer
    assert motionlake("search", "anything", "--lake", lake).status == 2
    assert motionlake("repair", "--lake", lake).status == 0
    assert part.read_bytes() == before
    assert motionlake("verify", "--deep", "--lake", lake).status == 0


def test_a_graph_of_which_a_shard_failed(lake: Path) -> None:
    """Clips without lists of their own are neighbours of others; they are found by their distances."""
    whole = read_neighbours(open_lake(lake))
    last = max(whole.nodes, key=lambda clip: whole.nodes[clip])
    (part,) = lake.glob("graph/*.parquet")
    rows = pq.read_table(part)
    pq.write_table(rows.filter(pc.field("clip") != last), part)
    list_anew(lake)
    assert last not in read_neighbours(open_lake(lake)).nodes
    ((clip,),) = query(lake, "SELECT min(clip) FROM symbol_strings WHERE len(symbols) > 3")
    (hits,) = FusedSearcher(open_lake(lake)).search([Query(clip)], 99)
    assert last in {hit.clip for hit in hits}


def test_search_is_measured(lake: Path) -> None:
    """By hand from what the command answers: labels of every other clip, by name."""
    with Changed(lake) as con:
        con.execute("UPDATE clips SET label = if(rowid % 2 = 0, 'even', 'odd'), subject = NULL, split = NULL")
    words = ("--label-column", "label", "--lake", lake)
    found = motionlake("evaluate", "search", *words, "--json").json
    assert set(found) == {"map", "nn", "top5", "cross_subject_nn", "n", "protocol", "methods"}
    assert list(found["methods"]) == [
        "fused", "fused without graph", "signature", "alignment", "descriptor", "moves", "dtw",
    ]  # fmt: skip
    labels = dict(query(lake, "SELECT clip, label FROM clips JOIN signatures USING (clip)"))
    for method, scores in found["methods"].items():
        if method not in ("fused", "signature"):
            continue
        precisions, firsts = [], []
        for clip, label in labels.items():
            asked = ("search", clip, "-k", 999, "--method", method, "--recorded-only", "--lake", lake, "--json")
            right = [labels[row["clip"]] == label for row in motionlake(*asked).json if row["clip"] in labels]
            ranks = [rank for rank, is_right in enumerate(right, start=1) if is_right]
            precisions.append(np.mean([count / rank for count, rank in enumerate(ranks, start=1)]))
            firsts.append(right[0])
        assert scores["map"] == pytest.approx(np.mean(precisions))
        assert scores["nn"] == pytest.approx(np.mean(firsts))
        assert 0.1 < scores["map"] < 0.9
    assert found["map"] == found["methods"]["fused"]["map"]
    run = motionlake("evaluate", "search", "--split", "test", *words)
    assert (run.status, "no labelled clip has split test" in run.err) == (2, True)


def test_scores_of_search_by_hand() -> None:
    questions = Questions.of(["a", "b"], ["a", "b", "a"])
    distances = np.array([[1.0, 2.0, 3.0], [3.0, 2.0, 1.0]])
    found = score_search(distances, questions, ["x", "y"], ["x", "y", "z"])
    assert found.map == pytest.approx((5 / 6 + 1 / 2) / 2)
    assert (found.nn, found.top5, found.n) == (0.5, 0.5, 2)
    assert found.cross_subject_nn == 0.0, (
        "the first has b before the a of another; the second has its b by itself alone"
    )
    assert score_search(distances, questions, ["x", None], ["x", "y", "z"]).cross_subject_nn is None


def test_a_lake_with_too_many_clips_for_a_graph(lake: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ((clip,),) = query(lake, "SELECT max(clip) FROM symbol_strings WHERE len(symbols) > 3")
    for module in ("stages.graph", "retrieval.fused"):
        monkeypatch.setattr(f"motionlake.{module}.MOST", 3)
    (hits,) = FusedSearcher(open_lake(lake), explain=True, graph=False).search([Query(clip)], 4)
    assert {share.method for hit in hits for share in hit.shares or ()} == {"signature"}
    (alone,) = searcher("clip", "signature", open_lake(lake)).search([Query(clip)], 4)
    assert [hit.clip for hit in hits] == [hit.clip for hit in alone]
    with Changed(lake) as con:
        con.execute("DELETE FROM manifest WHERE stage = 'graph'")
    with lake_reader(open_lake(lake), LakeConfig()) as at:
        assert GRAPH.plan(at) == []


def test_scope_of_the_answers(built_lake: Path) -> None:
    ((clip,),) = query(built_lake, "SELECT max(clip) FROM symbol_strings WHERE len(symbols) > 3")
    (own,) = FusedSearcher(open_lake(built_lake)).search([Query(clip)], 1, Scope(own=True))
    assert (own[0].clip, own[0].distance) == (clip, 0.0)
