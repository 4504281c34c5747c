"""Small parts merged: the same rows, nothing due, and a lake that goes on as if all had been taken in at once."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.lakes import assert_same, files, made_clips, motionlake, on_cluster, query, quick_lake, tables

NIGHTS = 3
# What tells of parts and of files; a merged part has another name.
NAMES = ("part", "key", "files", "spec", "file")


def taken_in(lake: Path, source: Path, scheduler: str, *stages: str) -> None:
    for words in (["ingest", source, "--lake", lake], *(["run", stage, "--lake", lake] for stage in stages)):
        run = on_cluster(words, scheduler)
        assert run.status == 0, run.err


@pytest.fixture(scope="module")
def nights(tmp_path_factory: pytest.TempPathFactory, scheduler: str) -> tuple[Path, Path]:
    """A folder of clips, and a lake that has taken them in over some nights, in parts that interleave."""
    folder = tmp_path_factory.mktemp("nights")
    pool, source = folder / "pool", folder / "clips"
    made_clips(pool, 4)
    found = sorted(path for path in pool.rglob("*") if path.is_file())
    lake = quick_lake(folder / "lake")
    for night in range(NIGHTS):
        for path in found[night::NIGHTS]:
            target = source / path.relative_to(pool)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, target)
        taken_in(lake, source, scheduler, "all")
    run = on_cluster(["run", "quality", "--lake", lake], scheduler)
    assert run.status == 0, run.err
    return source, lake


@pytest.fixture
def lake(nights: tuple[Path, Path], tmp_path: Path) -> Path:
    return Path(shutil.copytree(nights[1], tmp_path / "lake"))


def rows(lake: Path) -> dict[str, list[str]]:
    """Every row of every table and view that does not tell of parts, and those without their names of parts."""
    found = {name: rows for name, rows in tables(lake).items() if name not in ("manifest", "files", "submotion_parts")}
    for name in ("clips", "sources", "words", "word_motifs", "symbol_strings", "descriptors", "submotions"):
        found[name] = sorted(map(repr, query(lake, f"SELECT * EXCLUDE (part) FROM {name}")))
    return found


def made(lake: Path, scheduler: str, *stages: str) -> int:
    """Shards that are made when stages are run."""
    runs = [on_cluster(["run", stage, "--json", "--lake", lake], scheduler) for stage in stages]
    assert all(run.status == 0 for run in runs), [run.err for run in runs]
    return sum(row["shards"] for run in runs for row in run.json)


def compact(lake: Path, *more: object) -> dict[str, object]:
    run = motionlake("compact", "--json", "--lake", lake, *more)
    assert run.status == 0, run.err
    found: dict[str, object] = run.json
    return found


def test_rows_stay_and_nothing_is_due(lake: Path, nights: tuple[Path, Path], scheduler: str) -> None:
    before, held = rows(lake), files(lake)
    order = query(lake, "SELECT clip, frame, root_x FROM frames ORDER BY clip, frame")
    planned = compact(lake, "--dry-run")
    assert files(lake) == held
    found = compact(lake)
    assert found["parts"] == planned["parts"] == [NIGHTS, 1]
    assert found["files"] == planned["files"]
    assert len(list(lake.glob("frames/*/*.parquet"))) == len(list(lake.glob("submotions/*.parquet"))) == 1
    assert sum(path.suffix in (".parquet", ".arrow") for path in lake.rglob("*")) == found["files"][1]  # type: ignore[index]
    assert_same(before, rows(lake))
    assert query(lake, "SELECT clip, frame, root_x FROM frames") == order
    stamps = query(lake, "FROM manifest ORDER BY ALL")
    taken_in(lake, nights[0], scheduler)
    assert made(lake, scheduler, "all", "quality") == 0
    assert query(lake, "FROM manifest ORDER BY ALL") == stamps
    assert_same(before, rows(lake))
    assert motionlake("verify", "--deep", "--lake", lake).status == 0
    assert compact(lake)["parts"] == [0, 0]


def test_it_is_what_one_ingest_makes(lake: Path, nights: tuple[Path, Path], tmp_path: Path, scheduler: str) -> None:
    """Names and bytes of parts are those of a lake that took all clips in at once, with the same models."""
    compact(lake)
    at_once = Path(shutil.copytree(nights[1], tmp_path / "at_once"))
    assert motionlake("remove", "--dataset", "clips", "--lake", at_once).status == 0
    taken_in(at_once, nights[0], scheduler, "all", "quality")
    for folder in ("frames", "raw", "features", "embeddings", "postures", "moves", "submotions", "quality"):
        found = {path.relative_to(lake): path.read_bytes() for path in lake.glob(f"{folder}/**/*.[pa]*")}
        wanted = {path.relative_to(at_once): path.read_bytes() for path in at_once.glob(f"{folder}/**/*.[pa]*")}
        assert found
        assert found.keys() == wanted.keys(), folder
        assert found == wanted, folder
    keys = "SELECT stage, key, part, rows, files FROM manifest ORDER BY ALL"
    assert query(lake, keys) == query(at_once, keys)
    near = "FROM clip_neighbours ORDER BY ALL"
    assert query(lake, near) == query(at_once, near)


def test_a_lake_goes_on(lake: Path, nights: tuple[Path, Path], tmp_path: Path, scheduler: str) -> None:
    """Removal, repair, backup and new clips, after parts were merged."""
    source = Path(shutil.copytree(nights[0], tmp_path / "clips"))
    compact(lake)
    plain = query(lake, "SELECT file, sha256 FROM files ORDER BY file")
    for part in (*lake.glob("frames/*/*.parquet"), *lake.glob("moves/*.arrow")):
        part.write_bytes(part.read_bytes()[:-9] + b"x" * 9)
    assert motionlake("verify", "--lake", lake).status == 1
    assert motionlake("repair", "--lake", lake).status == 0
    assert query(lake, "SELECT file, sha256 FROM files ORDER BY file") == plain
    (first, second), *_ = query(lake, "SELECT min(clip), max(clip) FROM clips")
    assert motionlake("remove", first, "--for-good", "--lake", lake).status == 0
    assert made(lake, scheduler, "all", "quality") > 0  # the graph
    more = source / f"more{Path(second).suffix}"
    shutil.copyfile(source / second.partition("/")[2], more)
    assert compact(lake)["parts"] == [0, 0]
    run = on_cluster(["ingest", more, "--dataset", "more", "--lake", lake], scheduler)
    assert run.status == 0, run.err
    assert made(lake, scheduler, "all", "quality") > 0
    assert motionlake("backup", "-o", tmp_path / "lake.zip", "--clips", "--lake", lake).status == 0
    assert motionlake("restore", tmp_path / "lake.zip", "--lake", tmp_path / "again").status == 0
    assert made(tmp_path / "again", scheduler, "all", "quality") == 0
    assert_same(rows(lake), rows(tmp_path / "again"))
    assert motionlake("search", second, "-k", 3, "--lake", lake).status == 0


def test_what_is_left_alone(lake: Path, nights: tuple[Path, Path], scheduler: str) -> None:
    assert compact(lake, "--clips", 4)["parts"] == [0, 0]  # every part has four: none is small
    (lake / "config.toml").write_text((lake / "config.toml").read_text() + "[words]\nstride = 9\n")
    run = motionlake("compact", "--dry-run", "--lake", lake)
    assert "nothing to merge" in run.out
    assert f"{NIGHTS} small parts stay, since they hold what `motionlake run all` has to make" in run.err
    for words in (["--clips", 1], ["--keep", 1], ["--vacuum", "--keep", -1]):
        run = motionlake("compact", *words, "--lake", lake)
        assert (run.status, run.out) == (2, "")
        assert len(run.err.splitlines()) == 1
