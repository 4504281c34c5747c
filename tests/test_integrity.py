"""A damaged lake: nothing is answered from what is not as it was written, `verify` finds it, `repair` undoes it."""

from __future__ import annotations

import json
import os
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from motionlake.errors import DamagedError
from motionlake.lake import integrity
from motionlake.lake.catalog import fetch, reading, writing
from motionlake.lake.catalog_file import read_sums
from motionlake.lake.file_list import list_files, listed_in, sums_of
from motionlake.lake.integrity import sound, sound_while
from motionlake.lake.layout import Lake, open_lake
from motionlake.lake.loaded import loaded

from tests.lakes import Changed, assert_same, motionlake, query, tables

KINDS = (
    "frames/*/*.parquet", "raw/*/*.parquet", "features/*.arrow", "embeddings/*.parquet", "assigned/*.parquet",
    "postures/*.parquet", "models/*", "kept/*.duckdb", "catalog.duckdb", "catalog.sums", "records.zip", "config.toml",
)  # fmt: skip


@pytest.fixture
def lake(built_lake: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(built_lake, tmp_path / "lake"))


def flip(path: Path, place: int = -1) -> None:
    """Change one byte in the middle (or at a place) and keep the date, as a failing disk does."""
    data, entry = bytearray(path.read_bytes()), path.stat()
    data[len(data) // 2 if place < 0 else place % len(data)] ^= 1
    path.write_bytes(data)
    os.utime(path, ns=(entry.st_atime_ns, entry.st_mtime_ns))


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def test_what_was_touched_is_what_a_look_at_each_file_tells(lake: Path) -> None:
    at = open_lake(lake)
    with reading(at) as con:
        listed = listed_in(con)
        assert integrity.faults_of_now(at) == integrity.touched_faults(at, listed.values()) == []
        frames, model, dated, flipped = (
            next(file for file in sorted(listed) if file.startswith(f"{folder}/"))
            for folder in ("frames", "models", "features", "assigned")
        )
        cut(lake / frames)
        (lake / model).unlink()
        os.utime(lake / dated)
        flip(lake / flipped)
        os.utime(lake / flipped)
        found = integrity.faults_of_now(at)
        assert found == integrity.touched_faults(at, listed.values())
        assert {file.file for file, _ in found} == {frames, model, flipped}


@pytest.mark.parametrize("hurt", [flip, cut, Path.unlink], ids=["flip", "cut", "delete"])
@pytest.mark.parametrize("kind", KINDS)
def test_damage_is_found_and_undone(lake: Path, kind: str, hurt: Callable[[Path], None]) -> None:
    before = tables(lake)
    path = sorted(lake.glob(kind))[0]
    file = path.relative_to(lake).as_posix()
    hurt(path)
    deep = motionlake("verify", "--deep", "--json", "--lake", lake)
    assert (deep.status, [row["file"] for row in deep.json]) == (1, [file])
    repaired = motionlake("repair", "--json", "--lake", lake)
    assert repaired.status == 0, repaired.err + repaired.out
    assert [(row["file"], row["mended"]) for row in repaired.json] == [(file, True)]
    assert motionlake("verify", "--deep", "--lake", lake).status == 0
    assert_same(tables(lake), before)


def test_a_sound_lake_is_left_alone(lake: Path) -> None:
    held = {p: p.read_bytes() for p in lake.rglob("*.parquet")}
    assert motionlake("verify", "--lake", lake).status == 0
    run = motionlake("repair", "--json", "--lake", lake)
    assert (run.status, run.json) == (0, [])
    assert {p: p.read_bytes() for p in lake.rglob("*.parquet")} == held


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("frames/*/*.parquet", ("sql", "SELECT sum(hash(f)) FROM frames f")),
        ("embeddings/*.parquet", ("sql", "SELECT sum(hash(e)) FROM embeddings e")),
        ("frames/*/*.parquet", ("view", "{clip}", "-o", "{out}.html")),
        ("raw/*/*.parquet", ("export", "{clip}", "-o", "{out}.bvh")),
        ("postures/*.parquet", ("run", "all")),
        ("models/network-*", ("run", "all")),
    ],
)
def test_nothing_is_answered_from_damage(lake: Path, tmp_path: Path, kind: str, words: tuple[str, ...]) -> None:
    for path in lake.glob(kind):
        flip(path)
        if words[0] == "run":  # which compares what was touched, before it starts
            path.touch()
    ((clip,),) = query(lake, "SELECT min(clip) FROM clips WHERE format <> 'synthetic'")
    out = tmp_path / "out"
    run = motionlake(*(word.format(clip=clip, out=out) for word in words), "--lake", lake)
    assert run.status == 2, run.out
    said = run.err.splitlines()[-1]
    assert "Error:" not in said
    assert "holds other bytes than were written" in said
    assert f"`motionlake repair --lake {lake}`" in said
    assert not list(tmp_path.glob("out*"))


def test_queries_that_read_no_damaged_file_are_answered(lake: Path) -> None:
    for path in lake.glob("frames/*/*.parquet"):
        path.unlink()
    run = motionlake("sql", "SELECT count(*) AS n FROM clips", "--json", "--lake", lake)
    assert run.json[0]["n"] > 0
    status = motionlake("status", "--json", "--lake", lake)
    assert {row["fault"] for row in status.json["damaged"]} == {"is missing"}


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.integers(0, 1 << 30), which=st.integers(0, 1 << 30))
def test_no_byte_of_a_listed_file_can_change_unseen(built_lake: Path, tmp_path: Path, place: int, which: int) -> None:
    copy = tmp_path / "copy"
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(built_lake, copy)
    target = open_lake(copy)
    files = sorted(p for name in ("frames", "raw", "models") for p in copy.joinpath(name).rglob("*.*") if p.is_file())
    path = files[which % len(files)]
    file = path.relative_to(copy).as_posix()
    sound(target, file)
    flip(path, place)
    with pytest.raises(DamagedError, match="holds other bytes than were written"):
        sound(target, file)


def test_labels_outlive_the_catalog_and_its_copies(lake: Path) -> None:
    before = tables(lake)
    (lake / "catalog.duckdb").unlink()
    shutil.rmtree(lake / "kept")
    (lake / "catalog.sums").unlink()
    assert motionlake("status", "--lake", lake).status == 2
    run = motionlake("repair", "--lake", lake)
    assert run.status == 0, run.err
    assert_same(tables(lake), before)


@pytest.fixture
def orphaned(clips_folder: Path, tmp_path: Path) -> Path:
    """A lake whose source files are gone."""
    moved, own = tmp_path / "moved", tmp_path / "own"
    shutil.copytree(clips_folder, moved)
    assert motionlake("ingest", moved, "--lake", own).status == 0
    shutil.rmtree(moved)
    return own


def test_what_only_the_source_gives_back_is_said(orphaned: Path) -> None:
    """Frames and raw channels are lost: a file that is missed is named; exit status 1; its clips can leave."""
    for file in orphaned.glob("*/*/*.parquet"):
        if file.relative_to(orphaned).parts[0] in ("frames", "raw"):
            file.unlink()
    run = motionlake("repair", "--json", "--lake", orphaned)
    assert (run.status, {row["mended"] for row in run.json}) == (1, {False})
    assert all(str(orphaned.parent / "moved") in row["done"] for row in run.json)
    assert "`motionlake remove` takes its clips out" in run.json[0]["done"]
    assert motionlake("run", "frames", "--lake", orphaned).status == 2
    assert motionlake("remove", "--gone", "--lake", orphaned).status == 0
    assert motionlake("verify", "--deep", "--lake", orphaned).status == 0


def test_frames_come_back_from_raw_channels(orphaned: Path) -> None:
    asked = "SELECT clip, frame, COLUMNS('_[xyz]$') FROM frames WHERE frame % 7 = 0 ORDER BY ALL"
    before = query(orphaned, asked)
    for part in orphaned.glob("frames/*/*.parquet"):
        part.unlink()
    run = motionlake("repair", "--json", "--lake", orphaned)
    assert run.status == 0, run.err
    assert all("made again from the raw channels" in row["done"] for row in run.json)
    assert motionlake("verify", "--deep", "--lake", orphaned).status == 0
    after = query(orphaned, asked)
    assert [row[:2] for row in after] == [row[:2] for row in before]
    ((height,),) = query(orphaned, "SELECT min(body_height) FROM clips")
    moved = max(
        abs(a - b) for old, new in zip(before, after, strict=True) for a, b in zip(old[2:], new[2:], strict=True)
    )
    assert moved <= 1e-4 * height


def test_an_earlier_catalog_says_that_it_is_one(lake: Path) -> None:
    (lake / "catalog.duckdb").unlink()
    (lake / "records.zip").unlink()
    run = motionlake("repair", "--json", "--lake", lake)
    assert run.status == 0, run.err
    assert "of an earlier moment" in next(row["done"] for row in run.json if row["file"] == "catalog.duckdb")
    assert query(lake, "SELECT count(*) FROM clips") > [(0,)]


def test_the_records_of_a_large_catalog_are_written_now_and_then(lake: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They are of an earlier catalog then, which is said where one is made from them; labels come from their files."""
    monkeypatch.setattr("motionlake.lake.records.WHOLE", 0)
    before, (last, *_) = (lake / "records.zip").read_bytes(), query(lake, "SELECT max(clip) FROM clips")[0]
    assert motionlake("remove", last, "--lake", lake).status == 0
    assert (lake / "records.zip").read_bytes() == before
    assert motionlake("verify", "--deep", "--lake", lake).status == 0
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("motionlake.lake.records.EVERY", 0.0)
        assert motionlake("status", "--lake", lake).status == 0
        assert motionlake("compact", "--lake", lake).status == 0
    now = (lake / "records.zip").read_bytes()
    assert now != before
    (lake / "records.zip").write_bytes(before)
    (lake / "catalog.duckdb").unlink()
    shutil.rmtree(lake / "kept")
    run = motionlake("repair", "--json", "--lake", lake)
    assert run.status == 0, run.err
    assert "of an earlier moment" in next(row["done"] for row in run.json if row["file"] == "catalog.duckdb")
    assert query(lake, "SELECT clip FROM clips WHERE clip = $clip", clip=last) == [(last,)]


def test_a_damaged_catalog_without_copies_stays_where_it_is(lake: Path) -> None:
    shutil.rmtree(lake / "kept")
    (lake / "records.zip").unlink()
    flip(lake / "catalog.duckdb")
    held = (lake / "catalog.duckdb").read_bytes()
    run = motionlake("repair", "--lake", lake)
    assert run.status == 2
    assert "`motionlake restore` takes a backup" in run.err
    assert (lake / "catalog.duckdb").read_bytes() == held


@pytest.mark.parametrize("command", [("verify", "--deep"), ("repair",)])
def test_a_lake_of_another_version_is_not_damaged(lake: Path, command: tuple[str, ...]) -> None:
    with Changed(lake) as con:
        con.execute("UPDATE schema_version SET version = version + 1")
    held = (lake / "catalog.duckdb").read_bytes()
    run = motionlake(*command, "--lake", lake)
    assert run.status == 2
    assert "update motionlake" in run.err
    assert (lake / "catalog.duckdb").read_bytes() == held


def test_an_earlier_model_that_tables_were_made_with_is_made_again(lake: Path) -> None:
    with writing(open_lake(lake)) as con:
        model, file = fetch(con, "current_model", {"kind": "descriptors"})[0]["model"], "models/other.safetensors"
        own = con.execute("SELECT file FROM models WHERE model = $model", {"model": model}).fetchone()
        con.execute(
            "INSERT INTO models SELECT 'descriptors-99', kind, 99, 'x', data_hash, config, metrics, $file, true, "
            "seconds, created FROM models WHERE model = $model",
            {"model": model, "file": file},
        )
        con.execute("UPDATE models SET current = false WHERE model = $model", {"model": model})
        assert own is not None
        shutil.copyfile(lake / own[0], lake / file)
        list_files(con, [sums_of(open_lake(lake), file)])
    flip(lake / own[0])
    run = motionlake("repair", "--json", "--lake", lake)
    assert [(row["file"], row["done"], row["mended"]) for row in run.json] == [
        (own[0], "the pretrained file, copied again", True)
    ]
    assert query(lake, "SELECT DISTINCT model FROM descriptors") == [(model,)]


def test_a_changed_setting_is_told_and_taken(lake: Path) -> None:
    file = lake / "config.toml"
    file.write_text(file.read_text("utf-8").replace("k = 12", "k = 11"), encoding="utf-8")
    verify = motionlake("verify", "--json", "--lake", lake)
    assert (verify.status, [row["file"] for row in verify.json]) == (1, ["config.toml"])
    assert "-k = 12; +k = 11" in verify.json[0]["fault"]
    run = motionlake("run", "frames", "--lake", lake)
    assert "config.toml: has changed: -k = 12; +k = 11" in run.err
    assert motionlake("verify", "--lake", lake).status == 0


def test_the_sums_name_three_kept_catalogs(lake: Path) -> None:
    sums = read_sums(open_lake(lake))
    assert [Path(one["file"]).suffix for one in sums["kept"]] == [".duckdb"] * 3
    assert {p.name for p in (lake / "kept").iterdir()} == {Path(one["file"]).name for one in sums["kept"]}


def test_a_backup_makes_the_lake_again(lake: Path, tmp_path: Path) -> None:
    before, archive = tables(lake), tmp_path / "lake.zip"
    assert motionlake("backup", "-o", archive, "--lake", lake).status == 0
    again = tmp_path / "again"
    run = motionlake("restore", archive, "--lake", again)
    assert run.status == 0, run.err + run.out
    assert_same(tables(again), before)
    assert motionlake("verify", "--deep", "--lake", again).status == 0
    assert motionlake("restore", archive, "--lake", again).err.count("there is a lake here already") == 1


@pytest.mark.parametrize("name", ["../outside.txt", "/outside.txt", "catalog.duckdb", "frames/../../outside.txt"])
def test_a_hostile_backup_writes_nothing_outside(tmp_path: Path, name: str) -> None:
    archive, folder = tmp_path / "b.zip", tmp_path / "lake"
    with zipfile.ZipFile(archive, "w") as packed:
        packed.comment = b"motionlake backup 1"
        packed.writestr(name, "x")
    run = motionlake("restore", archive, "--lake", folder)
    assert (run.status, run.err.count("\n")) == (2, 1), json.dumps(run.err)
    assert not (tmp_path / "outside.txt").exists()
    assert not Path("/outside.txt").exists()


def test_a_model_is_read_once_and_again_when_it_changes(lake: Path) -> None:
    held, path, read = open_lake(lake), next(lake.glob("models/*")), []
    file = path.relative_to(lake).as_posix()

    def load(path: Path) -> bytes:
        read.append(path)
        return path.read_bytes()

    assert loaded(load, held, file) is loaded(load, held, file)
    assert len(read) == 1
    os.utime(path, ns=(1, 1))
    assert loaded(load, held, file) == path.read_bytes()
    assert len(read) == 2
    flip(path)
    os.utime(path, ns=(2, 2))
    with pytest.raises(DamagedError):
        loaded(load, held, file)


def test_what_is_read_of_a_damaged_file_is_not_given(tmp_path: Path) -> None:
    """Whether reading it fails or not, the damage is told."""
    lake = Lake(tmp_path)
    lake.path("frames").mkdir()
    path = lake.path("frames/part")
    path.write_bytes(b"as it was written")
    sums = sums_of(lake, "frames/part")
    with integrity.given([sums]):
        assert sound_while(lake, "frames/part", Path.read_bytes) == b"as it was written"
        with pytest.raises(ZeroDivisionError):
            sound_while(lake, "frames/part", lambda _: 1 // 0)
    path.write_bytes(b"as it is now here")
    for read in (Path.read_bytes, lambda _: 1 // 0):
        with integrity.given([sums]), pytest.raises(DamagedError, match="holds other bytes"):
            sound_while(lake, "frames/part", read)
    with integrity.given([]), pytest.raises(DamagedError, match="not listed"):
        sound_while(lake, "frames/part", Path.read_bytes)
