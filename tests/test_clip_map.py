"""The map of all clips: what lies where, and the stage that keeps it."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from motionlake.deep_motifs.clip_map import PLACED, places
from motionlake.lake.config import load_config
from motionlake.lake.layout import open_lake
from motionlake.stages.clip_map import CLIP_MAP, clip_vectors
from motionlake.stages.reader import lake_reader
from motionlake.stages.stage import Shard

from tests.lakes import Changed, motionlake, query
from tests.services import serving
from tests.test_service import patient


@pytest.fixture
def mapped(built_lake: Path, tmp_path: Path, scheduler: str) -> Path:
    lake = Path(shutil.copytree(built_lake, tmp_path / "lake"))
    run_map(lake, scheduler)
    return lake


def run_map(lake: Path, scheduler: str) -> None:
    run = motionlake("run", "map", "--lake", lake, "--scheduler", scheduler)
    assert run.status == 0, run.err


def planned(lake: Path) -> list[Shard]:
    target = open_lake(lake)
    with lake_reader(target, load_config(target.config_file)) as at:
        assert CLIP_MAP.due(at) == len(CLIP_MAP.plan(at))
        return CLIP_MAP.plan(at)


def parts(lake: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (lake / "map").glob("*.parquet")}


@pytest.fixture
def kinds() -> tuple[Any, list[str]]:
    """Vectors of more clips than t-SNE places, of five kinds, and the clips' names."""
    rng = np.random.default_rng(0)
    kind = np.arange(PLACED + 700) % 5
    middles = rng.normal(0, 3, (5, 64))
    return (middles[kind] + rng.normal(0, 1, (len(kind), 64))).astype(np.float32), [f"c/{i}" for i in range(len(kind))]


def test_clips_of_a_kind_lie_together(kinds: tuple[Any, list[str]]) -> None:
    vectors, names = kinds
    found = places(vectors, names)
    assert found.shape == (len(names), 2)
    assert np.abs(found).max() == pytest.approx(1)
    apart = np.linalg.norm(found[::7, None] - found[None], axis=2)
    apart[np.arange(len(apart)), np.arange(0, len(names), 7)] = np.inf
    same = apart.argmin(axis=1) % 5 == np.arange(0, len(names), 7) % 5
    assert same.mean() > 0.98
    np.testing.assert_array_equal(places(vectors, names), found)


@pytest.mark.parametrize("count", [1, 3, 4, 5])
def test_a_few_clips_have_places_of_their_own(count: int) -> None:
    vectors = np.random.default_rng(0).normal(size=(count, 512)).astype(np.float32)
    found = places(vectors, [str(i) for i in range(count)])
    assert np.isfinite(found).all()
    assert len(np.unique(found, axis=0)) == count


def test_the_map_of_a_lake_is_kept(mapped: Path, scheduler: str) -> None:
    rows = query(mapped, "SELECT clip, x, y FROM clip_map ORDER BY clip")
    assert [clip for clip, _, _ in rows] == [clip for (clip,) in query(mapped, "SELECT clip FROM clips ORDER BY clip")]
    with lake_reader(open_lake(mapped), load_config(open_lake(mapped).config_file)) as at:
        names, vectors = clip_vectors(at.con, "descriptors")
    np.testing.assert_array_equal([row[1:] for row in rows], places(vectors, names))
    assert planned(mapped) == []
    kept = parts(mapped)
    with Changed(mapped) as con:
        con.execute("DELETE FROM manifest WHERE stage = 'map'")
    assert len(planned(mapped)) == 1
    run_map(mapped, scheduler)
    assert parts(mapped) == kept


def test_a_clip_that_comes_or_goes_makes_it_due(mapped: Path, scheduler: str) -> None:
    gone = query(mapped, "SELECT min(clip) FROM clips")[0][0]
    before = query(mapped, "FROM clip_map ORDER BY clip")
    assert motionlake("remove", "--where", f"clip = '{gone}'", "--lake", mapped).status == 0
    assert query(mapped, "FROM clip_map ORDER BY clip") == [row for row in before if row[0] != gone]
    assert len(planned(mapped)) == 1
    run_map(mapped, scheduler)
    assert len(parts(mapped)) == 1
    after = query(mapped, "FROM clip_map ORDER BY clip")
    assert [row[0] for row in after] == [row[0] for row in before if row[0] != gone]
    assert after != [row for row in before if row[0] != gone]


def test_without_descriptors_it_is_by_signatures(mapped: Path, scheduler: str) -> None:
    with Changed(mapped) as con:
        con.execute("DELETE FROM manifest WHERE stage = 'descriptors'")
        con.execute("DELETE FROM descriptors")
    (shard,) = planned(mapped)
    assert shard.spec == {"source": "signatures"}
    run_map(mapped, scheduler)
    assert query(mapped, "SELECT count(*) FROM clip_map") == query(mapped, "SELECT count(*) FROM signatures")


def test_a_lake_without_vectors_has_no_map(tmp_path: Path, clips_folder: Path, scheduler: str) -> None:
    assert motionlake("ingest", clips_folder, "--lake", tmp_path / "lake", "--scheduler", scheduler).status == 0
    assert planned(tmp_path / "lake") == []
    run = motionlake("run", "map", "--lake", tmp_path / "lake", "--scheduler", scheduler)
    assert "run all" in run.err + run.out


def test_a_lost_file_is_made_again_as_it_was(mapped: Path) -> None:
    kept = parts(mapped)
    for path in (mapped / "map").glob("*.parquet"):
        path.unlink()
    assert motionlake("verify", "--lake", mapped).status == 1
    assert motionlake("repair", "--lake", mapped).status == 0
    assert parts(mapped) == kept


def test_the_service_shows_the_kept_map(mapped: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: Any) -> Any:
        raise AssertionError("made anew")

    monkeypatch.setattr("motionlake.service.clip_map.places", never)
    with serving(mapped) as client:
        found = client.get("/api/map").json()
    rows = query(mapped, "SELECT clip, x, y FROM clip_map ORDER BY clip")
    assert found["ready"]
    assert found["clips"] == [row[0] for row in rows]
    np.testing.assert_allclose(found["points"], [row[1:] for row in rows], atol=1e-4)


def test_the_service_makes_a_map_where_that_of_the_lake_is_old(mapped: Path) -> None:
    gone = query(mapped, "SELECT min(clip) FROM clips")[0][0]
    assert motionlake("remove", "--where", f"clip = '{gone}'", "--lake", mapped).status == 0
    left = query(mapped, "FROM clip_map ORDER BY clip")
    with serving(mapped) as client:
        found = patient(client, "/api/map")
    assert found["clips"] == [row[0] for row in left]
    assert not np.allclose(found["points"], [row[1:] for row in left], atol=1e-3)
