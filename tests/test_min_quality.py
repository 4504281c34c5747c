"""--min-quality: only clips that stage "quality" found good enough, wherever clips are chosen."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import duckdb
import motionlake as api
import pyarrow.parquet as pq
import pytest
from motionlake.lake.catalog import reading
from motionlake.lake.layout import open_lake
from motionlake.lake.verdicts import good_clips

from tests.lakes import Changed, motionlake, query

VERDICT = "(['ok', 'doubtful', 'bad'])[1 + ascii(name[-5:-5]) % 3]"


@pytest.fixture
def judged(lake: Path) -> Path:
    """A lake whose clips have verdicts by a letter of their names."""
    with Changed(lake) as con:
        con.execute(f"CREATE OR REPLACE MACRO quality_verdict(name) AS {VERDICT}")
    return lake


def commands(lake: Path, tmp_path: Path) -> list[list[Any]]:
    clip = query(lake, "SELECT clip FROM clips JOIN symbol_strings USING (clip) ORDER BY len(symbols) DESC LIMIT 1")[0][
        0
    ]
    return [
        ["search", clip, "-k", 99], ["search", "--text", "walk", "-k", 99], ["find", clip, "--from", 0, "-k", 99],
        ["align", clip, "-k", 99], ["align", clip, "--whole", "-k", 99], ["duplicates", "--max-distance", 0.9],
        ["cluster", "--k", 2], ["classify", clip], ["train", "descriptor"], ["segment", clip], ["suggest", "labels"],
        *(["evaluate", what] for what in ("search", "signatures", "pesta", "descriptor", "segmentation")),
        ["export", "--where", "true", "--format", "csv", "--out", tmp_path / "out"],
    ]  # fmt: skip


def test_every_command_says_how_to_get_verdicts(lake: Path, tmp_path: Path) -> None:
    for words in commands(lake, tmp_path):
        run = motionlake(*words, "--min-quality", "ok", "--lake", lake)
        assert run.status == 2, words
        assert run.out == ""
        (line,) = run.err.strip().splitlines()
        assert "no verdict yet; make them with `motionlake run quality`" in line, words
    assert "use ok or doubtful" in motionlake("cluster", "--min-quality", "fine", "--lake", lake).err


def test_commands_and_sql_leave_out_what_is_worse(judged: Path, tmp_path: Path) -> None:
    good = {row[0] for row in query(judged, "SELECT clip FROM clips WHERE quality_verdict(clip) = 'ok'")}
    names = {row[0] for row in query(judged, "SELECT clip FROM clips")}
    assert 2 < len(good) < len(names)
    for words in commands(judged, tmp_path):
        if words[0] in ("classify", "train", "segment", "suggest", "evaluate"):
            continue
        told = motionlake(*words, "--min-quality", "ok", "--json", "--lake", judged).json
        rows = told["clips"] if isinstance(told, dict) else told
        found = {row[name] for row in rows for name in ("clip", "one", "other") if name in row}
        assert found <= good, words
        assert found or words[0] == "duplicates" or "--text" in words, words
    clip = commands(judged, tmp_path)[0][1]
    with api.connect(judged) as con:
        for function in (
            "similar_clips($clip, k := 99, min_quality := 'ok')", "nearest_clips($clip, k := 99, min_quality := 'ok')",
            "find_motion($clip, 0, 40, k := 99, min_quality := 'ok')", "clip_clusters(2, min_quality := 'ok')",
        ):  # fmt: skip
            rows = con.execute(f"SELECT clip FROM {function}", {"clip": clip} if "$" in function else {}).fetchall()
            assert rows, function
            assert {row[0] for row in rows} <= good, function
    with api.open_lake(judged) as opened:
        found = {row["clip"] for row in opened.search(clip, k=99, min_quality="doubtful")}
        assert found == {row["clip"] for row in opened.search(clip, k=99)} & {
            row[0] for row in query(judged, "SELECT clip FROM clips WHERE good_enough(clip, 'doubtful')")
        }


def test_what_is_learned_and_measured_leaves_out_what_is_worse(judged: Path) -> None:
    """Without a label on any clip that is good, labels of the others teach nothing."""
    with Changed(judged) as con:
        con.execute("UPDATE clips SET label = NULL WHERE quality_verdict(clip) = 'ok'")
        con.execute("DELETE FROM segments WHERE quality_verdict(clip) = 'ok'")
    ((clip,),) = query(judged, "SELECT min(clip) FROM clips WHERE label IS NULL")
    for words in (["suggest", "labels"], ["segment", clip], ["evaluate", "search"]):
        assert motionlake(*words, "--lake", judged).status == 0, words
        run = motionlake(*words, "--min-quality", "ok", "--lake", judged)
        assert run.status == 2, words
        assert "none is as good" in run.err or "nothing to measure" in run.err, words


def test_plain_sql_says_what_is_wrong(lake: Path) -> None:
    for least, said in (("ok", "has no verdict yet"), ("fine", "use ok or doubtful")):
        with pytest.raises(duckdb.Error, match=said):
            query(lake, f"SELECT count(*) FROM clips WHERE good_enough(clip, '{least}')")
    assert query(lake, "SELECT bool_and(good_enough(clip, NULL)) FROM clips") == [(True,)]


def test_the_stage_gives_the_verdicts(lake: Path, scheduler: str) -> None:
    assert motionlake("run", "quality", "--lake", lake, "--scheduler", scheduler).status == 0
    assert query(lake, "SELECT clip, quality_verdict(clip) FROM clips ORDER BY clip") == query(
        lake, "SELECT clip, verdict FROM quality ORDER BY clip"
    )
    worst = {row[0] for row in query(lake, "SELECT clip FROM quality WHERE verdict = 'bad'")}
    with reading(open_lake(lake)) as con:
        assert good_clips(con, "doubtful") == {row[0] for row in query(lake, "SELECT clip FROM clips")} - worst


def test_parts_that_an_earlier_version_wrote_are_told_and_made_again(lake: Path, scheduler: str) -> None:
    assert motionlake("run", "quality", "--lake", lake, "--scheduler", scheduler).status == 0
    before = query(lake, "FROM quality ORDER BY clip")
    for file in (lake / "quality").glob("*.parquet"):
        pq.write_table(pq.read_table(file).drop_columns(["levels", "bad_share"]), file)
    told = query(lake, "SELECT clip, verdict FROM quality ORDER BY clip")
    assert told == query(lake, "SELECT clip, quality_verdict(clip) FROM clips ORDER BY clip")
    assert motionlake("repair", "--lake", lake).status == 0
    assert query(lake, "FROM quality ORDER BY clip") == before
