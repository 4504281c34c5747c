"""The copy of the catalog that a command changes: who reads what of it, and when it is served."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import duckdb
import pytest
from motionlake.lake import working
from motionlake.lake.catalog import Connection, reading, run_sql, writing
from motionlake.lake.catalog_file import sums_of_file
from motionlake.lake.garbage import remove_stale_copies
from motionlake.lake.integrity import is_listed
from motionlake.lake.layout import Lake, open_lake
from motionlake.lake.working import deferred, serve, version

from tests.lakes import assert_same, motionlake, on_cluster, query, quick_lake, tables
from tests.test_many_at_once import no_file_longer

READ_AGAIN = """
import sys
from motionlake.lake.catalog import reading
from motionlake.lake.layout import open_lake
with reading(open_lake(sys.argv[1])) as con:
    print(*(row[0] for row in con.execute("SELECT dataset FROM roots ORDER BY ALL").fetchall()))
"""

MODEL = "INSERT INTO models VALUES ('a-1', 'a', 1, '', '', '{}', '{}', 'models/a', true, 0, TIMESTAMP '2020-01-01')"

MUCH = "INSERT INTO runs SELECT range, repeat('x' || range, 99), 0, 0, 0, now(), now() FROM range(99999)"


@pytest.fixture
def target(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Lake:
    """A lake whose catalog is not served before a command ends."""
    monkeypatch.setattr(working, "RATIO", 1e9)
    return open_lake(quick_lake(tmp_path / "lake"))


def add_root(lake: Lake, name: str, then: str = "") -> None:
    """Enter a root; `then`: a statement of the same transaction."""
    with writing(lake) as con:
        run_sql(con, "save_root", {"dataset": name, "root": f"/{name}", "options": "{}", "labels_hash": ""})
        if then:
            con.execute(then)


def roots(con: Connection) -> list[str]:
    return [row[0] for row in con.execute("SELECT dataset FROM roots ORDER BY ALL").fetchall()]


def own(lake: Lake) -> list[str]:
    with reading(lake) as con:
        return roots(con)


def others(lake: Lake) -> list[str]:
    """What another process reads."""
    command = [sys.executable, "-c", READ_AGAIN, str(lake.root)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()


def copies(lake: Lake) -> list[Path]:
    return list(lake.root.glob(".catalog*"))


def test_others_read_what_is_served(target: Lake) -> None:
    before, states = target.served(), set()
    with deferred(target):
        for name in ("a", "b"):
            add_root(target, name)
            states.add(version(target))
        assert own(target) == ["a", "b"]
        assert others(target) == []
        assert target.served() == before
        assert len(copies(target)) == 1
        serve(target)
        assert (others(target), copies(target)) == (["a", "b"], [])
        states.add(version(target))
        add_root(target, "c")
        assert (own(target), others(target)) == (["a", "b", "c"], ["a", "b"])
    assert (others(target), copies(target)) == (["a", "b", "c"], [])
    assert len(states | {before, target.served()}) == 5, "every state has a name of its own"
    assert motionlake("verify", "--deep", "--lake", target.root).status == 0


def test_what_is_open_keeps_what_it_opened(target: Lake) -> None:
    with deferred(target):
        add_root(target, "a")
        with reading(target) as con:
            add_root(target, "b")
            assert (roots(con), own(target)) == (["a"], ["a", "b"])
            assert roots(con) == ["a"]
    assert others(target) == ["a", "b"]


def test_a_change_that_fails_takes_nothing_with_it(target: Lake) -> None:
    def fail() -> None:
        add_root(target, "a")
        with writing(target) as con:
            run_sql(con, "save_root", {"dataset": "b", "root": "/b", "options": "{}", "labels_hash": ""})
            raise RuntimeError("stop")

    with pytest.raises(RuntimeError, match="stop"), deferred(target):
        fail()
    assert (others(target), copies(target)) == (["a"], [])


@pytest.mark.parametrize("error", [duckdb.IOException, duckdb.FatalException])
def test_nothing_of_a_copy_that_may_be_broken_is_served(target: Lake, error: type[Exception]) -> None:
    add_root(target, "a")
    with deferred(target):
        add_root(target, "b")
        with pytest.raises(error), writing(target):
            raise error("no space left")
        assert (own(target), copies(target)) == (["a"], [])
        add_root(target, "c")
    assert others(target) == ["a", "c"]


@pytest.mark.parametrize("text", ["INSERT INTO nowhere VALUES (1)", "SELECT error('no')"])
def test_a_statement_that_fails_takes_nothing_with_it(target: Lake, text: str) -> None:
    with deferred(target):
        add_root(target, "a")
        with pytest.raises(duckdb.Error):
            add_root(target, "b", text)
        assert own(target) == ["a"]
        add_root(target, "c")
    assert others(target) == ["a", "c"]


def test_a_copy_that_cannot_be_entered_is_not_served(target: Lake) -> None:
    """What DuckDB says of a full disk as it commits is said, and what was served before is there."""
    add_root(target, "a")
    with deferred(target):
        add_root(target, "b")
        size = max(path.stat().st_size for path in copies(target)) + 4096
        with pytest.raises(OSError, match="too large"), no_file_longer(size):
            add_root(target, "c", MUCH)
        assert (own(target), copies(target)) == (["a"], [])
    assert others(target) == ["a"]
    assert motionlake("verify", "--deep", "--lake", target.root).status == 0


def test_a_small_catalog_is_served_soon(target: Lake, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(working, "RATIO", 0.0)
    with deferred(target):
        add_root(target, "a")
        assert others(target) == ["a"]


def test_nothing_changed_serves_nothing(target: Lake) -> None:
    before = target.served()
    with deferred(target):
        assert own(target) == []
    assert target.served() == before


def test_what_a_killed_command_leaves_is_deleted(target: Lake) -> None:
    with pytest.MonkeyPatch.context() as patched, deferred(target) as work:
        add_root(target, "a")
        patched.setattr(work, "serve", lambda: None)  # as if it were killed before
    assert len(copies(target)) == 1
    assert others(target) == []
    remove_stale_copies(target)
    assert copies(target) == []


def test_files_are_listed_as_the_command_sees_them(target: Lake) -> None:
    with deferred(target):
        assert not is_listed(target, "models/a")
        with writing(target) as con:
            con.execute("INSERT INTO files VALUES ('models/a', 1, 1, 1, '')")
            con.execute(MODEL)
        assert is_listed(target, "models/a")


def test_sums_are_those_of_the_catalog_that_is_served(target: Lake) -> None:
    with deferred(target):
        add_root(target, "a")
        add_root(target, "b")
    assert sums_of_file(target.catalog)["sha256"] in target.sums.read_text()
    assert len(list(target.kept.glob("*.duckdb"))) == 1, "of two changes one catalog was served, and one before it"


def test_stages_that_read_the_catalog_find_what_the_command_made(
    tmp_path: Path, clips_folder: Path, scheduler: str, built_lake: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The neighbour graph is made by workers, of all that stages before it made in the same command."""
    monkeypatch.setattr(working, "RATIO", 1e9)
    root = quick_lake(tmp_path / "lake")
    for words in (["ingest", clips_folder], ["run", "all"]):
        assert on_cluster([*words, "--lake", root], scheduler).status == 0
    assert query(root, "SELECT DISTINCT state FROM manifest WHERE stage = 'graph'") == [("ok",)]
    assert_same(tables(built_lake), tables(root))
