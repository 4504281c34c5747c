"""The neighbour graph when clips come and go: what it takes from the graph before is what it would find anew."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import Int64Array
from motionlake.stages import graph
from motionlake.stages.graph import lists_of
from motionlake.stages.graph_before import NO_GRAPH, Before, Listed
from motionlake.stages.graph_methods import Compared, Search

from tests.lakes import list_anew, motionlake, query

KEPT = 3


def compared(points: dict[str, int], asked: list[tuple[str, int]]) -> Compared:
    """Clips at places on a line, many of them equally far apart; `asked`: which clip was compared with how many."""
    clips = sorted(points)

    def among(rows: Int64Array) -> Search:
        def nearest(place: int, k: int) -> tuple[Sequence[int], Sequence[float]]:
            asked.append((clips[place], len(rows)))
            far = [abs(points[clips[row]] - points[clips[place]]) for row in rows.tolist()]
            order = sorted(range(len(rows)), key=lambda at: (far[at], at))[:k]
            return order, [far[at] for at in order]

        return nearest

    return Compared(clips, among)


def lists(points: dict[str, int], before: Before, asked: list[tuple[str, int]] | None = None) -> dict[str, Listed]:
    nodes = {clip: node for node, clip in enumerate(sorted(points))}
    found = lists_of(compared(points, [] if asked is None else asked), "moves", nodes, list(nodes), before)
    return dict(zip(nodes, found, strict=True))


def kept_of(points: dict[str, int], changed: set[str]) -> Before:
    """What the graph of these clips tells once some of them are others."""
    names = sorted(points)
    found = lists(points, NO_GRAPH)
    kept = {("moves", c): ([names[n] for n in near], far) for c, (near, far) in found.items() if c not in changed}
    return Before(kept, frozenset(points) - changed)


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
    for path in sorted(clips_folder.rglob("*.bvh"))[:1]:
        shutil.copy(path, more / path.name)
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
    farther = pa.array([[far + 9 for far in row] for row in before["distances"].to_pylist()], pa.list_(pa.float64()))
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
    assert sum(d > 9 for d in far) > len(far) / 2
    assert all(d < 9 for row in taken if row["clip"] not in stayed for d in row["distances"])
