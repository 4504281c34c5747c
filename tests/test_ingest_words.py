"""What `ingest`, `remove` and `status` say to people."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.lakes import motionlake, query, quick_lake


@pytest.fixture
def folder(tmp_path: Path, clips_folder: Path) -> Path:
    """Two clips of one folder."""
    found = tmp_path / "two"
    found.mkdir()
    kind = ".bvh" if any(clips_folder.rglob("*.bvh")) else ".npz"  # of real clips, of made ones
    for source in sorted(clips_folder.rglob(f"*{kind}"))[:2]:
        shutil.copyfile(source, found / source.name)
    return found


def test_taking_in_says_what_became_of_labels_rigs_and_removed_clips(
    folder: Path, tmp_path: Path, scheduler: str
) -> None:
    lake = quick_lake(tmp_path / "lake")
    first, second = sorted(path.name for path in folder.iterdir())
    labels = tmp_path / "labels.csv"
    labels.write_text("file,label\nelsewhere/a.bvh,walk\nelsewhere/b.bvh,kick\n", encoding="utf-8")

    def ingest(*words: str | Path) -> tuple[int, str, str]:
        run = motionlake("ingest", folder, "--lake", lake, "--scheduler", scheduler, *words)
        return run.status, run.err, run.out

    status, err, out = ingest("--labels", labels)
    assert status == 1
    assert "2 of 2 rows name no clip file; its first row names 'elsewhere/a.bvh'" in err
    assert f"a path that matches is 'two/{first}'" in err
    assert out.strip().endswith(f"2 clips taken in ({frames(lake)} frames), 0 files unchanged")
    labels.write_text(f"file,label\ntwo/{first},walk\n", encoding="utf-8")
    assert ingest()[0] == 0

    lake.joinpath("rigs").mkdir(exist_ok=True)
    shutil.copyfile(next(Path("pipeline/motion/rigs").glob("*.toml")), lake / "rigs" / "mine.toml")
    assert "2 files are read again, since rigs/mine.toml is new" in ingest()[1]

    run = motionlake("remove", first, "--lake", lake)
    assert "takes them in again; --for-good keeps them out" in run.err
    ingest()
    assert len(query(lake, "FROM clips")) == 2
    assert motionlake("remove", first, "--for-good", "--lake", lake).status == 0
    ingest()
    assert query(lake, "SELECT path FROM clips") == [(second,)]
    said = motionlake("status", "--lake", lake, "--json").json
    assert next(s["rows"] for s in said["stages"] if s["stage"] == "frames") == frames(lake)
    ingest("--take-back")
    assert len(query(lake, "FROM clips")) == 2


def frames(lake: Path) -> int:
    return int(query(lake, "SELECT sum(frames)::BIGINT FROM clips")[0][0])


def test_status_is_for_people(built_lake: Path) -> None:
    said = motionlake("status", "--lake", built_lake)
    assert said.status == 0
    assert "batches to do" in said.out
    assert "{" not in said.out
    stages = {row["stage"]: row for row in motionlake("status", "--lake", built_lake, "--json").json["stages"]}
    assert stages["signatures"]["rows"] == len(query(built_lake, "FROM signatures"))
