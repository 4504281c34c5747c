"""Lakes of another version than this program reads: what is said of them, and how they are migrated."""

from __future__ import annotations

import hashlib
import re
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import duckdb
import motionlake
import pyarrow.parquet as pq
import pytest
from motionlake.errors import UserError
from motionlake.lake import migrations, working
from motionlake.lake.catalog import SCHEMA_VERSION, reading, writing
from motionlake.lake.catalog_file import announce_catalog
from motionlake.lake.frames import lengths, runs
from motionlake.lake.layout import Lake, open_lake
from motionlake.lake.parts import PartWriter, replacing, sync_folder

from tests.lakes import Changed, assert_same, finish, query, quick_lake, tables
from tests.lakes import motionlake as command
from tests.processes import start


@pytest.fixture
def empty(tmp_path: Path) -> Path:
    return quick_lake(tmp_path / "empty")


def become(lake: Path, version: int) -> None:
    """Make a lake one of another version; 0 stands for those written before there were versions."""
    with Changed(lake) as con:
        con.execute("DROP TABLE schema_version" if version == 0 else f"UPDATE schema_version SET version = {version}")


@pytest.mark.parametrize(
    ("version", "todo"),
    [(0, "bring it up to date with `motionlake migrate {}`"), (SCHEMA_VERSION + 1, "update motionlake")],
)
def test_a_lake_of_another_version_says_what_to_do(empty: Path, version: int, todo: str) -> None:
    become(empty, version)
    said = f"{empty}: is a lake of version {version}, and this motionlake reads version {SCHEMA_VERSION}; "
    expected = said + todo.format(empty)
    before = (empty / "catalog.duckdb").read_bytes()
    for words in (["status"], ["search", "walk"], ["run", "all"], ["sql", "FROM clips"], ["remove", "walk"]):
        run = command(*words, "--lake", empty)
        assert (run.status, run.err.strip()) == (2, f"motionlake: {expected}")
    for opens in (reading, writing):
        with pytest.raises(UserError, match=re.escape(expected)), opens(open_lake(empty)):
            pass
    with pytest.raises(UserError, match=re.escape(expected)):
        motionlake.connect(empty)
    with pytest.raises(UserError, match=re.escape(expected)):
        motionlake.open_lake(empty)
    assert (empty / "catalog.duckdb").read_bytes() == before


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda data: b"", "not a valid DuckDB database file"),
        (lambda data: data[:5000], "Could not read enough bytes"),
        (lambda data: data[:9000] + bytes(9000) + data[18000:], "Corrupt database file"),
    ],
)
def test_a_damaged_catalog_says_so_in_a_line(empty: Path, damage: object, said: str, known: bool) -> None:
    file = empty / "catalog.duckdb"
    if not known:  # then DuckDB's own checksums tell
        (empty / "catalog.sums").unlink()
    assert callable(damage)
    file.write_bytes(damage(file.read_bytes()))
    run = command("status", "--lake", empty)
    assert (run.status, run.err.count("\n")) == (2, 1)
    assert f"{file}: {'' if known else 'cannot be read'}" in run.err
    assert ("were written" if known else said) in run.err
    assert f"`motionlake repair --lake {empty}`" in run.err


# The tables as version 0 had them; a change of `sql/schema/` after version 1 needs a step, not a change here.
VERSION_0 = (Path(__file__).parent / "data" / "catalog_0.sql").read_text(encoding="utf-8")


def of_version_0(lake: Path) -> None:
    """Make a lake one that motionlake wrote before lakes had versions: its tables, and frames parts without rates."""
    for part in lake.glob("frames/*/*.parquet"):
        table = pq.ParquetFile(part).read().drop_columns(["fps"])
        key = (table.schema.metadata or {})[b"key"].decode()
        writer = PartWriter(part, table.schema, {"key": key})
        for _, rows in runs(table):
            writer.append(rows)
        writer.close()
    present = lake / "catalog.duckdb"
    old = lake / "old.duckdb"
    with duckdb.connect(str(old)) as con:
        con.execute(VERSION_0)
        con.execute(f"ATTACH '{present}' AS present (READ_ONLY); SET file_search_path = '{lake}'")
        tables = con.execute("SELECT table_name FROM duckdb_tables() WHERE database_name = 'old'").fetchall()
        for (table,) in tables:
            if table == "submotions":
                continue  # of what a view shows now, the next run makes the rows
            renamed = " RENAME (metrics AS figures)" if table == "models" else ""
            con.execute(f"INSERT INTO {table} BY NAME SELECT *{renamed} FROM present.{table}")
        # As version 0 had it.
        con.execute(
            "CREATE VIEW frames AS SELECT f.* EXCLUDE (part) FROM read_parquet('frames/*/*.parquet', "
            "hive_partitioning = true, hive_types = {'dataset': VARCHAR}) f "
            "SEMI JOIN clips c ON c.clip = f.clip AND c.part = f.part"
        )
    old.replace(present)
    for later in ("catalog.sums", "records.zip"):
        (lake / later).unlink()
    shutil.rmtree(lake / "kept")


@pytest.fixture(scope="module")
def new(tmp_path_factory: pytest.TempPathFactory, built_lake: Path, clips_folder: Path, scheduler: str) -> Path:
    """A lake of this version with parts of two datasets, and rows of a clip that left.

    Without windows of clips, which a migration leaves to the next run.
    """
    lake = Path(shutil.copytree(built_lake, tmp_path_factory.mktemp("lakes") / "new"))
    with Changed(lake) as con:
        con.execute("DROP MACRO TABLE clips_holding; DROP VIEW submotions; DELETE FROM submotion_parts")
        con.execute("DELETE FROM manifest WHERE stage = 'submotions'; DELETE FROM files WHERE file LIKE 'submotions/%'")
    shutil.rmtree(lake / "submotions")
    # With their words, so that a run of these after a migration has nothing to make.
    for words in (("ingest", clips_folder, "--dataset", "again"), ("run", "words")):
        assert command(*words, "--lake", lake, "--scheduler", scheduler).status == 0
    return lake


@pytest.fixture
def old(tmp_path: Path, new: Path) -> Path:
    lake = Path(shutil.copytree(new, tmp_path / "old"))
    of_version_0(lake)
    return lake


def hashes(lake: Path) -> dict[str, str]:
    """Of every file but the catalog, what lies beside it for repairs, and the lock."""
    return {
        path.relative_to(lake).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in lake.rglob("*")
        if path.is_file()
        and path.name not in ("catalog.duckdb", "catalog.sums", "records.zip", ".lock")
        and path.parent.name != "kept"
    }


def macros(lake: Path) -> list[tuple[object, ...]]:
    text = "SELECT function_name, macro_definition FROM duckdb_functions() WHERE NOT internal ORDER BY ALL"
    return query(lake, text)


def test_a_migrated_lake_is_one_made_anew(old: Path, new: Path, scheduler: str) -> None:
    assert hashes(old) != hashes(new)
    run = command("migrate", old, "--json")
    assert run.status == 0, run.err
    parts = len(list(new.glob("frames/*/*.parquet")))
    steps = run.json["steps"]
    assert [(s["from_version"], s["to_version"], s["files"]) for s in steps] == [
        (0, 1, parts),
        (1, 2, 0),
        (2, 3, 0),
        (3, 4, 0),
    ]
    assert_same(tables(old), tables(new))
    assert hashes(old) == hashes(new)
    assert macros(old) == macros(new)
    again = command("migrate", old)
    assert (again.status, f"is of version {SCHEMA_VERSION} already; nothing to do" in again.err) == (0, True)
    assert_same(tables(old), tables(new))
    # Nothing that was made is due again; both lack windows of clips.
    beside = Path(shutil.copytree(new, old.parent / "beside"))
    for lake in (old, beside):
        assert command("run", "all", "--lake", lake, "--scheduler", scheduler).status == 0
        assert query(lake, "SELECT count(DISTINCT clip) FROM submotions") == query(lake, "SELECT count(*) FROM clips")
    assert_same(tables(old), tables(beside))


def test_a_dry_run_says_what_and_changes_nothing(old: Path) -> None:
    before, catalog = hashes(old), (old / "catalog.duckdb").read_bytes()
    run = command("migrate", old, "--dry-run")
    assert run.status == 0
    assert re.search(r"version 0 to 1: frames carry their rate .*; \d+ parts would be rewritten", run.out)
    assert (hashes(old), (old / "catalog.duckdb").read_bytes()) == (before, catalog)


def as_it_was(lake: Path) -> tuple[object, ...]:
    """What a program of version 0 reads."""
    frames = query(lake, "SELECT clip, frame, dataset, root_x, head_y, hips_qw FROM frames ORDER BY ALL")
    return frames, query(lake, "SELECT * FROM clips ORDER BY clip"), query(lake, "SELECT * FROM words ORDER BY ALL")


def test_a_migration_that_is_cut_short(old: Path, new: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Before and after every file it writes: the lake reads as the old one; in the end it is the new one."""
    moment, last, cuts, expected = 0, 0, 0, as_it_was(old)

    def pass_by() -> None:
        nonlocal moment
        if moment == last:
            raise InterruptedError
        moment += 1

    @contextmanager
    def watched(path: Path) -> Iterator[Path]:
        with replacing(path) as temporary:
            yield temporary
            pass_by()
        pass_by()

    def announced(lake: Lake, temporary: Path) -> None:
        announce_catalog(lake, temporary)
        pass_by()

    def synced(folder: Path) -> None:
        sync_folder(folder)
        pass_by()

    monkeypatch.setattr(migrations, "replacing", watched)
    monkeypatch.setattr(working, "announce_catalog", announced)  # before the catalog takes its name
    monkeypatch.setattr(working, "sync_folder", synced)  # and after it has
    while "motionlake migrate" in command("status", "--lake", old).err:
        assert as_it_was(old) == expected
        with pytest.raises(InterruptedError):
            migrations.migrate(open_lake(old), lambda *_: None)
        moment, last, cuts = 0, 1 - last, cuts + 1
    assert cuts == 2 * (len(list(new.glob("frames/*/*.parquet"))) + 1)
    assert_same(tables(old), tables(new))
    assert hashes(old) == hashes(new)


def test_a_killed_migration(old: Path, new: Path) -> None:
    process = start("migrate", old)
    while process.poll() is None and not list(old.glob("frames/*/.*.tmp")):
        time.sleep(0.001)
    process.kill()
    finish(process)
    as_it_was(old)
    assert command("migrate", old).status == 0
    assert_same(tables(old), tables(new))
    assert command("run", "words", "--lake", old).status == 0, "which sweeps up what the killed one left"
    assert hashes(old).keys() == hashes(new).keys()


def test_what_cannot_be_migrated(old: Path, empty: Path) -> None:
    become(empty, SCHEMA_VERSION + 1)
    run = command("migrate", empty)
    assert (run.status, "update motionlake" in run.err) == (2, True)
    with Changed(old) as con:
        con.execute("DROP TABLE synthetic")
    catalog = (old / "catalog.duckdb").read_bytes()
    run = command("migrate", old)
    assert (run.status, run.err.count("\n")) == (2, 1)
    assert "its tables synthetic are of no known version" in run.err
    assert (old / "catalog.duckdb").read_bytes() == catalog
    part = min(old.glob("frames/*/*.parquet"))
    part.write_bytes(part.read_bytes()[:-9])
    run = command("migrate", old)
    assert (run.status, f"{part}: is a damaged frames part" in run.err) == (2, True)


def test_rows_of_clips_that_left_go(old: Path) -> None:
    clip, part, frames = query(
        old, "SELECT clip, part, frames FROM clips WHERE dataset = 'again' ORDER BY clip LIMIT 1"
    )[0]
    with Changed(old) as con:
        con.execute("DELETE FROM clips WHERE clip = $clip", {"clip": clip})
    file = next(old.glob(f"frames/*/{part}.parquet"))
    before = pq.read_metadata(file).num_rows
    assert command("migrate", old).status == 0
    assert pq.read_metadata(file).num_rows == before - frames
    assert clip not in lengths(file)
