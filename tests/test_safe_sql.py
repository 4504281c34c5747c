"""SQL only asks: every way out of a lake that DuckDB knows is refused, unless the caller trusts the query."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from pathlib import Path

import duckdb
import pyarrow.parquet as pq
import pytest
from motionlake.errors import UserError
from motionlake.lake.safe import LakeConnection
from motionlake.retrieval.sql_functions import connect

from tests.lakes import files, motionlake

# {lake}, {inside} (a folder that SQL may read), {away} (one outside), {file} (a CSV file there).
WAYS_OUT = (
    "COPY (SELECT 1) TO '{away}/a.csv'",
    "COPY (SELECT 1) TO '{inside}/a.parquet'",
    "COPY (SELECT 1) TO 'frames/a.parquet'",
    "COPY (SELECT 1) TO '{lake}/catalog.duckdb'",
    "COPY (PIVOT clips ON label USING count(*)) TO '{inside}/a.csv'",
    "COPY (SELECT 1) TO '/dev/stdout'",
    "COPY clips FROM '{file}'",
    "COPY FROM DATABASE lake TO memory",
    "EXPLAIN ANALYZE COPY (SELECT 1) TO '{inside}/a.csv'",
    "PREPARE p AS COPY (SELECT 1) TO '{inside}/a.csv'",
    "SELECT 1; COPY (SELECT 1) TO '{inside}/a.csv'",
    "/* asks */ COPY (SELECT 1) TO '{inside}/a.csv'",
    "EXPORT DATABASE '{away}/all'",
    "EXPORT DATABASE '{inside}/all'",
    "IMPORT DATABASE '{away}'",
    "ATTACH '{away}/new.duckdb'",
    "ATTACH '{inside}/new.duckdb'",
    "ATTACH '{lake}/catalog.duckdb' AS again (READ_WRITE)",
    "ATTACH '{lake}/catalog.duckdb' AS again (READ_ONLY)",
    "ATTACH ':memory:' AS more",
    "DETACH lake",
    "INSTALL httpfs",
    "LOAD icu",
    "LOAD '{away}/x.duckdb_extension'",
    "UPDATE EXTENSIONS",
    "FORCE INSTALL json FROM 'http://localhost:1'",
    "FROM read_text('/etc/passwd')",
    "FROM read_blob('{file}')",
    "FROM read_csv('{file}')",
    "FROM '{file}'",
    "FROM sniff_csv('{file}')",
    "FROM read_json('{file}')",
    "FROM read_parquet('{away}/*.parquet')",
    "FROM parquet_metadata('{away}/a.parquet')",
    "FROM read_duckdb('{away}/other.duckdb')",
    "FROM glob('/etc/*')",
    "FROM query_table('{file}')",
    "FROM query('FROM read_text(''/etc/passwd'')')",
    "FROM read_text('{lake}/config.toml')",
    "FROM read_text('{inside}/../config.toml')",
    "FROM read_text('frames/../config.toml')",
    "FROM read_text('/proc/self/environ')",
    "FROM 'http://localhost:1/a.parquet'",
    "FROM read_text('s3://bucket/a')",
    "SELECT getenv('HOME')",
    "CREATE SECRET key (TYPE s3)",
    "CREATE PERSISTENT SECRET key (TYPE http, BEARER_TOKEN 'x')",
    "CREATE TABLE lake.t (a INT)",
    "CREATE VIEW lake.v AS SELECT 1",
    "CREATE TEMP VIEW v AS FROM read_text('/etc/passwd')",
    "DROP TABLE clips",
    "DELETE FROM clips",
    "UPDATE clips SET label = 'x'",
    "INSERT INTO clips SELECT * FROM clips",
    "ALTER TABLE clips ADD COLUMN x INT",
    "COMMENT ON TABLE clips IS 'x'",
    "SET memory_limit = '1TB'",
    "RESET memory_limit",
    "SET enable_external_access = true",
    "SET allowed_directories = ['/']",
    "SET file_search_path = '/etc'",
    "SET lock_configuration = false",
    "SET profiling_output = '{away}/p'",
    "SET temp_directory = '{away}'",
    "SET log_query_path = '{away}/log'",
    "PRAGMA enable_profiling",
    "PRAGMA profiling_output = '{away}/p'",
    "CALL enable_logging(storage := 'file', storage_path := '{away}/log')",
    "VACUUM",
    "FROM similar_clips('{clip}', 3)",
    "FROM frames_in_python",
)


REFUSED = r"not allowed|Permission|read-only|Cannot|[Nn]o such|does not exist|disabled|not in the catalog|conflict"


@pytest.fixture(scope="module")
def con(built_lake: Path) -> Iterator[LakeConnection]:
    with connect(built_lake) as con:
        yield con


@pytest.fixture
def places(built_lake: Path, tmp_path: Path, clips_folder: Path) -> dict[str, str]:
    (tmp_path / "a.csv").write_text("a\n1\n")
    clip = min(path for path in clips_folder.rglob("*") if path.suffix in {".txt", ".bvh", ".npz"})
    return {
        "lake": str(built_lake), "inside": str(built_lake / "frames"), "away": str(tmp_path),
        "file": str(tmp_path / "a.csv"), "clip": str(clip),
    }  # fmt: skip


@pytest.mark.parametrize("way", WAYS_OUT)
def test_ways_out_are_closed(con: LakeConnection, places: dict[str, str], built_lake: Path, way: str) -> None:
    frames_in_python = con.sql("SELECT 1").to_arrow_table()  # DuckDB would find it by its name
    before, around = files(built_lake), set(Path(places["away"]).iterdir())
    for ask in (con.execute, con.sql, con.cursor().execute):
        with pytest.raises(
            (UserError, duckdb.Error),
            match=REFUSED,
        ):
            ask(way.format(**places)).fetchall()
    assert files(built_lake) == before
    assert set(Path(places["away"]).iterdir()) == around
    assert frames_in_python.num_rows == 1


@pytest.mark.parametrize("way", [way for way in WAYS_OUT if "frames_in_python" not in way][::6])
def test_the_command_refuses_in_one_line(built_lake: Path, places: dict[str, str], way: str) -> None:
    run = motionlake("sql", way.format(**places), "--lake", built_lake)
    assert run.status == 2
    assert run.err.startswith("motionlake: SQL: ")
    assert "Traceback" not in run.err


def test_what_asks_is_answered(con: LakeConnection, built_lake: Path, tmp_path: Path,
                               monkeypatch: pytest.MonkeyPatch) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)  # views name files from the lake's folder on, not from here
    count = con.execute("SELECT count(*) FROM clips").fetchone()[0]
    assert con.execute("SELECT count(DISTINCT clip) FROM frames").fetchone()[0] == count
    assert con.cursor().execute("SELECT count(*) FROM embeddings").fetchone()[0] > 0
    con.execute("CREATE OR REPLACE TEMP TABLE long AS FROM clips WHERE frames > $n", {"n": 10})
    assert con.execute("FROM long").fetchall()
    con.execute("SET VARIABLE least = 10")
    for text in ("PIVOT clips ON format USING count(*)", "EXPLAIN SELECT 1", "SUMMARIZE clips", "SHOW TABLES",
                 "WITH a AS (SELECT 1) FROM a", "FROM similar_clips((SELECT min(clip) FROM clips), 2)"):  # fmt: skip
        assert con.execute(text).fetchall(), text


def test_a_trusted_query_may_do_all(built_lake: Path, places: dict[str, str]) -> None:
    text = "COPY (SELECT clip FROM clips) TO '{away}/clips.csv'".format(**places)
    assert motionlake("sql", text, "--lake", built_lake).status == 2
    assert motionlake("sql", text, "--trusted", "--lake", built_lake).status == 0
    assert (Path(places["away"]) / "clips.csv").stat().st_size > 10
    with connect(built_lake, trusted=True) as con:
        assert con.execute("FROM similar_clips($clip, 3)", {"clip": places["clip"]}).fetchall()


def test_rows_go_into_a_file(built_lake: Path, tmp_path: Path) -> None:
    text = "SELECT clip, seconds, [1, 2] AS some FROM clips ORDER BY clip"
    rows = motionlake("sql", text, "--json", "--lake", built_lake).json
    for suffix in ("parquet", "csv", "json"):
        run = motionlake("sql", text, "--out", tmp_path / f"rows.{suffix}", "--lake", built_lake)
        assert (run.status, run.out) == (0, "")
        assert f"rows.{suffix}: {len(rows)} rows" in run.err
    assert pq.read_table(tmp_path / "rows.parquet").to_pylist() == rows
    with (tmp_path / "rows.csv").open(newline="") as file:
        assert [row["clip"] for row in csv.DictReader(file)] == [row["clip"] for row in rows]
    assert [json.loads(line) for line in (tmp_path / "rows.json").read_text().splitlines()] == rows
    for name, said in (("rows.xls", "written as .parquet"), ("no/rows.csv", "there is no folder")):
        run = motionlake("sql", text, "--out", tmp_path / name, "--lake", built_lake)
        assert (run.status, said in run.err) == (2, True)
    run = motionlake("sql", "SELECT error('no') FROM clips", "--out", tmp_path / "bad.csv", "--lake", built_lake)
    assert run.status == 2
    assert not list(tmp_path.glob("*bad*"))


def test_limits(built_lake: Path) -> None:
    endless = "SELECT count(*) FROM range(100000000000) a, range(1000) b WHERE a.range % 7 = b.range % 5"
    run = motionlake("sql", endless, "--seconds", "0.3", "--lake", built_lake)
    assert (run.status, "stopped after 0.3 s" in run.err) == (2, True)
    big = "SELECT count(DISTINCT range::VARCHAR || 'some text that is long') FROM range(3000000)"
    run = motionlake("sql", big, "--memory", "20MB", "--lake", built_lake)
    assert run.status in (0, 2)
    run = motionlake("sql", "SELECT 1", "--memory", "much", "--lake", built_lake)
    assert (run.status, "give a size such as 4GB" in run.err) == (2, True)
