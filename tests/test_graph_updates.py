"""The neighbour graph when clips come and go: what it takes from the graph before is what it would find anew."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import Float32Array, Int64Array
from motionlake.jobs.session import session
from motionlake.lake.layout import open_lake
from motionlake.stages import graph
from motionlake.stages.graph import lists_of
from motionlake.stages.graph_before import NO_GRAPH, Before, Listed
from motionlake.stages.graph_chosen import Chosen, Vectors, chosen_of
from motionlake.stages.graph_methods import Compared, Search
from motionlake.stages.reader import lake_reader

from tests.lakes import Changed, list_anew, motionlake, query

KEPT = 3
MORE = 1000.0  # than any distance


def compared(points: dict[str, int], asked: list[tuple[str, int]]) -> Compared:
    """Clips at places on a line, many of them equally far apart; `asked`: which clip was compared with how many."""
    clips = sorted(points)

    def few(place: int, rows: Int64Array, k: int) -> tuple[Sequence[int], Sequence[float]]:
        asked.append((clips[place], len(rows)))
        far = [abs(points[clips[row]] - points[clips[place]]) for row in rows.tolist()]
        order = sorted(range(len(rows)), key=lambda at: (far[at], at))[:k]
        return order, [far[at] for at in order]

    def among(rows: Int64Array) -> Search:
        return lambda place, k: few(place, rows, k)

    def vectors() -> Float32Array:
        """Near the points, but not in their order."""
        return np.array([[points[clip], int(clip) * 7 % 5] for clip in clips], dtype=np.float32)

    return Compared(clips, among, few, vectors)


def lists(points: dict[str, int], before: Before, asked: list[tuple[str, int]] | None = None) -> dict[str, Listed]:
    nodes = {clip: node for node, clip in enumerate(sorted(points))}
    found = lists_of(compared(points, [] if asked is None else asked), "moves", nodes, list(nodes), before)
    return dict(zip(nodes, found, strict=True))


def kept_of(points: dict[str, int], changed: set[str]) -> Before:
    """What the graph of these clips tells once some of them are others."""
    names = sorted(points)
    found = lists(points, NO_GRAPH)
    kept = {("moves", c): ([names[n] for n in near], far) for c, (near, far) in found.items() if c not in changed}
    return Before(kept, frozenset(points) - changed, frozenset(points) - changed)


def large(points: dict[str, int], before: Before, count: int) -> tuple[dict[str, Listed], dict[str, Chosen]]:
    """Lists as those of a large lake: `count` clips are chosen for each, by vectors."""
    nodes = {clip: node for node, clip in enumerate(sorted(points))}
    each = compared(points, [])
    vectors = {"moves": Vectors(np.arange(len(nodes)), each.vectors())}
    chosen = dict(zip(nodes, chosen_of(vectors, list(nodes.values()), count), strict=True))
    found = lists_of(each, "moves", nodes, list(nodes), before.among(chosen, nodes), chosen)
    return dict(zip(nodes, found, strict=True)), chosen


def large_before(points: dict[str, int], changed: set[str], count: int) -> Before:
    names = sorted(points)
    found, chosen = large(points, NO_GRAPH, count)
    stayed = frozenset(points) - changed
    kept = {("moves", c): ([names[n] for n in near], far) for c, (near, far) in found.items() if c in stayed}
    return Before(kept, stayed, stayed, {clip: chosen[clip].radii for clip in stayed})


clips = st.sets(st.sampled_from([f"{i:02}" for i in range(24)]), min_size=2)


@settings(deadline=None)
@given(clips, clips, st.integers(0, 1000), st.data())
def test_lists_are_those_that_would_be_found_anew(
    then: set[str], now: set[str], seed: int, data: st.DataObject
) -> None:
    graph_kept, graph.KEPT = graph.KEPT, KEPT  # type: ignore[misc]
    try:
        rng = np.random.default_rng(seed)
        places = {f"{i:02}": int(rng.integers(0, 12)) for i in range(24)}
        changed = data.draw(st.sets(st.sampled_from(sorted(then))))
        was = {clip: places[clip] for clip in then}
        places |= {clip: int(rng.integers(0, 12)) for clip in sorted(changed)}
        today = {clip: places[clip] for clip in now}
        found, anew = lists(today, kept_of(was, changed)), lists(today, NO_GRAPH)
    finally:
        graph.KEPT = graph_kept  # type: ignore[misc]
    for clip in now:
        for one, other in zip(found[clip], anew[clip], strict=True):
            assert one.tolist() == other.tolist()


@settings(deadline=None)
@given(clips, clips, st.integers(0, 1000), st.integers(1, 9), st.data())
def test_lists_of_large_lakes_are_those_that_would_be_found_anew(
    then: set[str], now: set[str], seed: int, count: int, data: st.DataObject
) -> None:
    graph_kept, graph.KEPT = graph.KEPT, KEPT  # type: ignore[misc]
    try:
        rng = np.random.default_rng(seed)
        places = {f"{i:02}": int(rng.integers(0, 40)) for i in range(24)}
        changed = data.draw(st.sets(st.sampled_from(sorted(then))))
        before = large_before({clip: places[clip] for clip in then}, changed, count)
        places |= {clip: int(rng.integers(0, 40)) for clip in sorted(changed)}
        today = {clip: places[clip] for clip in now}
        (found, _), (anew, _) = (large(today, each, count) for each in (before, NO_GRAPH))
    finally:
        graph.KEPT = graph_kept  # type: ignore[misc]
    for clip in now:
        for one, other in zip(found[clip], anew[clip], strict=True):
            assert one.tolist() == other.tolist()


def test_few_lists_of_a_large_lake_are_made_anew_for_a_new_clip() -> None:
    points = {f"{i:03}": 3 * i for i in range(200)}
    before = large_before(points, set(), 8)
    nodes = {clip: node for node, clip in enumerate(sorted(points | {"999": 301}))}
    _, chosen = large(points | {"999": 301}, NO_GRAPH, 8)
    assert len(before.among(chosen, nodes).held) > 180


@given(st.integers(1, 30), st.integers(0, 100), st.integers(8, 12))
def test_clips_are_chosen_that_any_method_finds_near(clips: int, seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    vectors = {}
    for method, width in (("one", 3), ("other", 2)):
        known = np.flatnonzero(rng.random(clips) < 0.8)
        vectors[method] = Vectors(known, rng.integers(-9, 9, (len(known), width)).astype(np.float32))
    own = sorted(set(vectors["one"].nodes.tolist()) | set(vectors["other"].nodes.tolist()))
    for node, found in zip(own, chosen_of(vectors, own, count), strict=True):
        assert node not in found.nodes
        wanted: set[int] = set()
        for method, each in vectors.items():
            at = dict(zip(each.nodes.tolist(), each.rows, strict=True))
            if node not in at:
                assert found.radii[method] < 0
                continue
            far = {other: float(((at[node] - row) ** 2).sum()) for other, row in at.items() if other != node}
            last = sorted(far.values())[:count][-1] if far else -1.0
            wanted |= {other for other, apart in far.items() if apart <= last}
            assert found.radii[method] == last
        assert set(found.nodes.tolist()) == wanted


def test_of_clips_that_are_all_alike_not_all_are_chosen() -> None:
    vectors = {"moves": Vectors(np.arange(500), np.ones((500, 3), dtype=np.float32))}
    (found,) = chosen_of(vectors, [7], 8)
    assert found.nodes.tolist() == [node for node in range(33) if node != 7]
    assert not found.within(found.radii).any(), "whether others were chosen before cannot be told"


def test_the_graph_of_a_large_lake_when_clips_come(grown: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every method's own shards, in this process: from the graph before, and the same bytes from nothing."""
    monkeypatch.setattr(graph, "ALL", 3)
    monkeypatch.setattr(graph, "chosen_of", partial(chosen_of, count=4))
    for stage in ("words", "embed", "motifs", *(stage.name for stage in graph.SOURCES.values())):
        assert motionlake("run", stage, "--lake", grown).status == 0
    lake = open_lake(grown)

    def made() -> list[dict[str, Any]]:
        with session(lake, "test", lambda stage, done, total: None, lambda line: None) as job:
            with lake_reader(lake, job.config) as at:
                shards = graph.GRAPH.plan(at)
            job.execute(graph.GRAPH, shards, here=True, at_once=True)
        files = [file for (file,) in query(grown, "SELECT unnest(files) FROM manifest WHERE stage = 'graph'")]
        return [row for file in files for row in pq.read_table(grown / file).drop_columns("key").to_pylist()]

    found = made()
    assert max(len(row["neighbours"]) for row in found) <= 4 * len({row["method"] for row in found})
    assert {row["clip"] for row in found} == {name for (name,) in query(grown, "SELECT clip FROM clips")}
    assert all(row["radius"] >= 0 for row in found if row["method"] == "moves")
    with Changed(grown) as con:  # of a lake that never had a graph
        con.execute("DELETE FROM manifest WHERE stage = 'graph'")
    assert made() == found


def test_a_clip_that_stays_is_compared_with_new_ones_alone() -> None:
    points = {f"{i:03}": 2 * i for i in range(100)}
    asked: list[tuple[str, int]] = []
    lists(points | {"x": 31, "y": 55}, kept_of(points, set()), asked)
    assert {clip for clip, others in asked if others == 102} == {"x", "y"}
    assert {others for clip, others in asked if clip not in ("x", "y")} == {2}
    lists({clip: at for clip, at in points.items() if clip != "050"}, kept_of(points, set()), asked := [])
    assert all(abs(int(clip) - 50) <= graph.KEPT for clip, others in asked), "the others lost no neighbour"


@pytest.fixture
def grown(built_lake: Path, clips_folder: Path, tmp_path: Path) -> Path:
    """A lake that has lost a clip since its graph was made, and got one that is another's under a new name."""
    lake = Path(shutil.copytree(built_lake, tmp_path / "lake"))
    ((gone,),) = query(lake, "SELECT min(clip) FROM symbol_strings")
    assert motionlake("remove", gone, "--lake", lake).status == 0
    more = tmp_path / "more"
    more.mkdir()
    source = next(path for path in sorted(clips_folder.rglob("*")) if path.suffix in (".npz", ".bvh"))
    shutil.copy(source, more / source.name)
    assert motionlake("ingest", more, "--lake", lake).status == 0
    return lake


def made_anew(lake: Path) -> list[dict[str, Any]]:
    """The graph of a lake once its stages have followed its clips."""
    for stage in ("words", "embed", "motifs", *(stage.name for stage in graph.SOURCES.values()), "graph"):
        assert motionlake("run", stage, "--lake", lake).status == 0
    files = [file for (files,) in query(lake, "SELECT files FROM manifest WHERE stage = 'graph'") for file in files]
    rows: list[dict[str, Any]] = (
        pa.concat_tables([pq.read_table(lake / f) for f in files]).drop_columns("key").to_pylist()
    )
    return sorted(rows, key=lambda row: (row["method"], row["clip"]))


def test_a_lake_that_has_changed(grown: Path, tmp_path: Path) -> None:
    """The same as anew; and that it is taken from the graph before shows where the distances of that are others."""
    other = Path(shutil.copytree(grown, tmp_path / "other"))
    (part,) = other.glob("graph/*.parquet")
    before = pq.read_table(part)
    at = before.schema.get_field_index("distances")
    farther = pa.array([[far + MORE for far in row] for row in before["distances"].to_pylist()], pa.list_(pa.float64()))
    pq.write_table(before.set_column(at, before.schema.field(at), farther), part)
    list_anew(other)
    made_anew(grown)
    taken = made_anew(other)
    files = {file: file.read_bytes() for file in grown.glob("graph/*.parquet")}
    for file in files:
        file.unlink()
    assert motionlake("repair", "--lake", grown).status == 0, "made anew, with nothing taken from before"
    assert {file: file.read_bytes() for file in files} == files
    stayed = set(before["clip"].to_pylist())
    far = [d for row in taken if row["clip"] in stayed for d in row["distances"]]
    assert sum(d > MORE for d in far) > len(far) / 2
    assert all(d < MORE for row in taken if row["clip"] not in stayed for d in row["distances"])
