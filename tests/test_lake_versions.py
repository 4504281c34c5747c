"""Lakes of another version than this program reads."""

from __future__ import annotations

import re
from pathlib import Path

import duckdb
import motionlake
import pytest
from motionlake.errors import UserError
from motionlake.lake.catalog import SCHEMA_VERSION, reading, writing
from motionlake.lake.layout import open_lake

from tests.lakes import motionlake as command
from tests.lakes import quick_lake


@pytest.fixture
def empty(tmp_path: Path) -> Path:
    return quick_lake(tmp_path / "empty")


def become(lake: Path, version: int) -> None:
    """Make a lake one of another version; 0 stands for those written before there were versions."""
    with duckdb.connect(str(lake / "catalog.duckdb")) as con:
        con.execute("DROP TABLE schema_version" if version == 0 else f"UPDATE schema_version SET version = {version}")


@pytest.mark.parametrize(
    ("version", "todo"),
    [(0, "take its folders in to a new lake"), (SCHEMA_VERSION + 1, "update motionlake")],
)
def test_a_lake_of_another_version_says_what_to_do(empty: Path, version: int, todo: str) -> None:
    become(empty, version)
    said = f"{empty}: is a lake of version {version}, and this motionlake reads version {SCHEMA_VERSION}; "
    expected = said + todo
    before = (empty / "catalog.duckdb").read_bytes()
    for words in (["status"], ["search", "walk"], ["run", "all"], ["sql", "FROM clips"], ["remove", "walk"]):
        run = command(*words, "--lake", empty)
        assert (run.status, run.err.strip()) == (2, f"motionlake: {expected}")
    for opens in (reading, writing):
        with pytest.raises(UserError, match=re.escape(expected)), opens(open_lake(empty)):
            pass
    with pytest.raises(UserError, match=re.escape(expected)):
        motionlake.connect(empty)
    assert (empty / "catalog.duckdb").read_bytes() == before


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda data: b"", "not a valid DuckDB database file"),
        (lambda data: data[:5000], "Could not read enough bytes"),
        (lambda data: data[:9000] + bytes(9000) + data[18000:], "Corrupt database file"),
    ],
)
def test_a_damaged_catalog_says_so_in_a_line(empty: Path, damage: object, said: str) -> None:
    file = empty / "catalog.duckdb"
    assert callable(damage)
    file.write_bytes(damage(file.read_bytes()))
    run = command("status", "--lake", empty)
    assert (run.status, run.err.count("\n")) == (2, 1)
    assert f"{file}: cannot be opened for reading" in run.err
    assert said in run.err
    assert "put back a copy, or make a new lake" in run.err
