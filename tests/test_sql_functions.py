"""Functions in SQL from Python functions, and one resolution of names for all of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import duckdb
import pytest
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, reading
from motionlake.lake.layout import open_lake
from motionlake.lake.resolve import resolve_clip
from motionlake.lake.safe import LakeConnection
from motionlake.retrieval import sql_functions
from motionlake.retrieval.sql_functions import connect

from tests.lakes import motionlake, query


@dataclass(frozen=True)
class Word:
    """A row of a function made for the test."""

    word: str
    length: int
    share: float | None


ADDED = '''
from motionlake.retrieval.sql_functions import Served, columns, sql_function
from tests.test_sql_functions import Word


@sql_function(columns(Word))
def letters(served: Served, words: list[str], least: int = 2, *, twice: bool = False, none: float | None = None):
    """The longer words."""
    return [Word(word * (2 if twice else 1), len(word), none) for word in words if len(word) >= least]


@sql_function()
def frames_of(served: Served, clip: str) -> float:
    """A number for each row."""
    return float(len(served.query(clip).name))
'''


@pytest.fixture
def con(built_lake: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[LakeConnection]:
    """A connection with one file more among the modules of functions, and nothing else."""
    (tmp_path / "functions").mkdir()
    (tmp_path / "functions" / "letters.py").write_text(ADDED, encoding="utf-8")
    monkeypatch.setattr(sql_functions, "__path__", [*sql_functions.__path__, str(tmp_path / "functions")])
    with connect(built_lake) as con:
        yield con


def test_a_function_is_one_file(con: LakeConnection) -> None:
    assert con.execute("FROM letters(['a', 'bb', 'ccc'])").fetchall() == [("bb", 2, None), ("ccc", 3, None)]
    assert con.execute("FROM letters(['a'], least := 1, twice := true, none := 0.5)").fetchall() == [("aa", 1, 0.5)]
    assert con.execute("FROM letters(['a', 'bb'], NULL)").fetchall() == [("bb", 2, None)], "NULL is the default"
    assert con.execute("FROM letters(NULL)").fetchall() == []
    rows = con.execute("SELECT w, length FROM (VALUES ('dd'), ('e')) v(w), letters([w], 1) ORDER BY w").fetchall()
    assert rows == [("dd", 2), ("e", 1)]
    columns = con.execute("DESCRIBE FROM letters(['a'])").fetchall()
    assert [column[:2] for column in columns] == [("word", "VARCHAR"), ("length", "BIGINT"), ("share", "DOUBLE")]
    (clip,) = con.execute("SELECT min(clip) FROM clips").fetchall()[0]
    assert con.execute("SELECT frames_of($clip)", {"clip": clip}).fetchall() == [(float(len(clip)),)]
    assert con.execute("SELECT frames_of(NULL)").fetchall() == [(None,)]


def test_what_functions_share_is_made_once(con: LakeConnection, monkeypatch: pytest.MonkeyPatch) -> None:
    from motionlake.lake import strings

    made: list[object] = []
    read = strings.read_strings

    def counted(con: Connection) -> strings.LakeStrings:
        made.append(con)
        return read(con)

    monkeypatch.setattr("motionlake.retrieval.alignment.read_strings", counted)
    text = "SELECT s.clip FROM (FROM symbol_strings WHERE len(symbols) > 2) q, aligned_clips(q.clip, 1) s"
    assert len(con.execute(text).fetchall()) > 3
    assert con.execute(text).fetchall()
    assert len(made) == 1


def test_a_process_may_connect_twice(con: LakeConnection, built_lake: Path) -> None:
    with connect(built_lake) as other:
        text = "SELECT count(*) FROM similar_clips((SELECT min(clip) FROM clips), 2)"
        assert other.execute(text).fetchall() == con.execute(text).fetchall() == [(2,)]


def stem(clip: str) -> str:
    return clip.rpartition("/")[2].partition(".")[0]


def nearly(clip: str) -> str:
    """What a person may type instead: another case, another suffix, one letter more."""
    name = stem(clip)
    return f"{name[0].upper()}{name[1:]}{name[-1]}.Xyz"


def longest(lake: Path) -> str:
    text = "SELECT clip FROM clips JOIN symbol_strings USING (clip) ORDER BY len(symbols) DESC, clip LIMIT 1"
    return str(query(lake, text)[0][0])


def test_names_are_resolved_alike_everywhere(built_lake: Path, con: LakeConnection, tmp_path: Path) -> None:
    """By commands and in SQL: an end of a name will do, and an unknown one is one error with suggestions."""
    clip = longest(built_lake)
    short = clip.partition("/")[2]
    wrong = nearly(clip)
    with reading(open_lake(built_lake)) as plain:
        with pytest.raises(UserError, match="did you mean") as error:
            resolve_clip(plain, wrong)
        assert clip in str(error.value)
    said = str(error.value)
    for call in ("similar_clips({})", "aligned_clips({})", "find_motion({})", "find_submotion({})",
                 "align_motion({})", "classify_clip({})", "segment_clip({})"):  # fmt: skip
        expected = con.execute(f"FROM {call.format('$name')}", {"name": clip}).fetchall()
        assert expected, call
        assert con.execute(f"FROM {call.format('$name')}", {"name": short}).fetchall() == expected, call
        with pytest.raises(duckdb.Error) as failed:
            con.execute(f"FROM {call.format('$name')}", {"name": wrong}).fetchall()
        assert said in str(failed.value), call
    assert con.execute("FROM nearest_clips($name, 3)", {"name": short}).fetchall()
    with pytest.raises(duckdb.Error, match="no such clip"):
        con.execute("FROM nearest_clips($name, 3)", {"name": wrong}).fetchall()
    commands: tuple[tuple[str, ...], ...] = (
        ("search",), ("find",), ("align",), ("classify",), ("segment",), ("view",), ("export",), ("remove",),
    )  # fmt: skip
    for words in commands:
        run = motionlake(*words, wrong, "--lake", built_lake)
        assert (run.status, run.err) == (2, f"motionlake: {said}\n"), words


def test_suggestions(built_lake: Path) -> None:
    with duckdb.connect() as names:
        names.execute((Path(__file__).parents[1] / "sql/macros/find_clip.sql").read_text(encoding="utf-8").replace(
            "CREATE OR REPLACE MACRO find_clip", "CREATE TABLE clips (clip VARCHAR); CREATE MACRO find_clip"
        ))  # fmt: skip
        names.execute(
            "INSERT INTO clips VALUES ('d/humanoid3d_walk.txt'), ('d/humanoid3d_run.txt'), ('a/x.bvh'), ('b/x.bvh')"
        )
        assert resolve_clip(names, "humanoid3d_walk") == "d/humanoid3d_walk.txt"
        for wrong in ("walkk", "Walk.bvh", "WALK", "humanoid3d_wolk.txt"):
            with pytest.raises(UserError, match=r"did you mean d/humanoid3d_walk\.txt"):
                resolve_clip(names, wrong)
        with pytest.raises(UserError, match=r"means 2 clips: a/x\.bvh, b/x\.bvh; name one in full"):
            resolve_clip(names, "x")
        with pytest.raises(UserError, match="lists the clips"):
            resolve_clip(names, "qqqqq")


def test_a_range_that_is_too_short_says_what_to_do(built_lake: Path, con: LakeConnection) -> None:
    clip = longest(built_lake)
    said = "too short to compare; take a range of at least 0.6 s"
    run = motionlake("find", clip, "--to", 2, "--lake", built_lake)
    assert run.status == 2
    assert said in run.err
    with pytest.raises(duckdb.Error, match=said):
        con.execute("FROM find_motion($clip, 0, 2)", {"clip": clip}).fetchall()
    with pytest.raises(duckdb.Error, match=r"take a longer range"):
        con.execute("FROM find_submotion($clip, 0, 2)", {"clip": clip}).fetchall()
