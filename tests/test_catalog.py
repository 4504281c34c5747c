"""Connections to catalogs: which state each sees, however many are open in a process."""

from __future__ import annotations

import os
import signal
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from motionlake.lake.catalog import Connection, open_once, reading, remembered, run_sql, writing
from motionlake.lake.host import seen_by_thread
from motionlake.lake.layout import Lake, open_lake
from motionlake.retrieval.sql_functions import connect

from tests.lakes import Changed, quick_lake


@pytest.fixture
def target(tmp_path: Path) -> Lake:
    return open_lake(quick_lake(tmp_path / "lake"))


def save_root(con: Connection, name: str) -> None:
    run_sql(con, "save_root", {"dataset": name, "root": f"/{name}", "options": "{}", "labels_hash": ""})


def add_root(lake: Lake, name: str) -> None:
    with writing(lake) as con:
        save_root(con, name)


def roots(con: Connection) -> list[str]:
    return [row[0] for row in con.execute("SELECT dataset FROM roots ORDER BY ALL").fetchall()]


def test_a_reader_sees_the_catalog_of_now_and_keeps_it(target: Lake) -> None:
    add_root(target, "a")
    with reading(target) as con:
        add_root(target, "b")
        assert roots(con) == ["a"]
        with reading(target) as second:
            assert roots(second) == ["a"], "beside one that is open"
        assert roots(con) == ["a"]
    with reading(target) as con:
        assert roots(con) == ["a", "b"]


def test_another_thread_sees_the_catalog_of_now(target: Lake) -> None:
    """However long somebody keeps an earlier one open: readers of a busy service would never see a new one else."""

    def seen() -> list[str]:
        with reading(target) as con:
            return roots(con)

    add_root(target, "a")
    with ThreadPoolExecutor(1) as pool, reading(target) as con:
        assert pool.submit(seen).result() == ["a"]
        add_root(target, "b")
        assert pool.submit(seen).result() == ["a", "b"]
        assert (roots(con), seen()) == (["a"], ["a"])
    assert seen() == ["a", "b"]


def test_what_is_remembered_is_of_the_catalog_that_a_thread_reads(target: Lake) -> None:
    """One that reads an earlier catalog does not have its answers taken for those of now."""
    asked: list[list[str]] = []

    def find(con: Connection) -> list[str]:
        asked.append(roots(con))
        return asked[-1]

    add_root(target, "a")
    with reading(target):
        add_root(target, "b")
        assert remembered(target, "roots", find) == ["a"]
        assert remembered(target, "roots", find) == ["a"]
    assert remembered(target, "roots", find) == ["a", "b"]
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(remembered, target, "roots", find).result() == ["a", "b"]
    assert asked == [["a"], ["a", "b"]]
    with writing(target) as con:
        save_root(con, "c")
    assert remembered(target, "roots", find) == ["a", "b", "c"]


def test_a_connection_reads_on_what_it_opened(target: Lake) -> None:
    with connect(target.root) as con:
        add_root(target, "a")
        with reading(target) as second:
            assert roots(second) == ["a"]
        assert roots(con.own) == []


def test_a_change_that_fails_leaves_nothing(target: Lake) -> None:
    def fail() -> None:
        with writing(target) as con:
            save_root(con, "a")
            raise RuntimeError("stop")

    with pytest.raises(RuntimeError, match="stop"):
        fail()
    add_root(target, "b")
    with reading(target) as con:
        assert roots(con) == ["b"]
    assert not list(target.root.glob(".catalog*"))


def test_two_lakes_are_read_and_written_at_once(target: Lake, tmp_path: Path) -> None:
    other = open_lake(quick_lake(tmp_path / "other"))
    with writing(target) as one, writing(other) as two:
        save_root(one, "a")
        save_root(two, "b")
    with reading(target) as one, reading(other) as two:
        assert (roots(one), roots(two)) == (["a"], ["b"])


def test_threads_and_forks_read(target: Lake) -> None:
    add_root(target, "a")

    def read(_: int) -> list[str]:
        with reading(target) as con:
            return roots(con)

    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(read, range(40))) == [["a"]] * 40
    child = os.fork()
    if child == 0:
        signal.alarm(60)
        os._exit(read(0) != ["a"])
    assert os.waitpid(child, 0)[1] == 0


def test_macros_of_an_earlier_program_are_replaced(target: Lake) -> None:

    add_root(target, "a")
    with Changed(target.root) as con:
        con.execute("CREATE OR REPLACE MACRO find_clip(name) AS TABLE SELECT 'old' AS clip")
    with reading(target) as con:
        assert con.execute("FROM find_clip('x')").fetchall() == [("old",)]
    add_root(target, "b")
    with reading(target) as con:
        assert con.execute("FROM find_clip('x')").fetchall() == []


def test_a_block_opens_a_catalog_when_it_is_read_and_keeps_what_it_sees(target: Lake) -> None:
    add_root(target, "a")
    with open_once(target):
        assert seen_by_thread(target.catalog) is None
        for name in "bc":
            with open_once(target), reading(target) as con:
                assert roots(con) == ["a"]
            add_root(target, name)
            assert seen_by_thread(target.catalog) is not None
    assert seen_by_thread(target.catalog) is None
    with reading(target) as con:
        assert roots(con) == ["a", "b", "c"]
    with pytest.raises(ZeroDivisionError), open_once(target), reading(target):
        raise ZeroDivisionError
    assert seen_by_thread(target.catalog) is None
