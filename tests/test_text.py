"""Search in words in a lake: alone, beside a clip, in SQL and Python, by an encoder of one's own."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Sequence
from pathlib import Path

import motionlake as library
import numpy as np
import pytest
from motionlake.errors import UserError
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.layout import open_lake
from motionlake.retrieval.sql_functions import connect
from motionlake.retrieval.text import LakeText
from motionlake.retrieval.text_words import numbers

from tests.lakes import Changed, motionlake, query
from tests.text_queries import (
    read_clips,
)


def test_a_lake_says_what_its_label_files_say(built_lake: Path, clips_folder: Path) -> None:
    with reading(open_lake(built_lake)) as con:
        rows = {row["clip"]: row["says"] for row in fetch(con, "clip_texts")}
    said = {clip.name: clip.text for clip in read_clips(clips_folder.parent, [clips_folder.name])}
    assert rows.keys() == said.keys()
    for clip, parts in said.items():
        assert sorted(rows[clip].splitlines()) == sorted(parts)


def label_of(lake: Path) -> str:
    return str(query(lake, "SELECT label FROM clips ORDER BY clip LIMIT 1")[0][0])


def test_the_command_finds_labels_and_says_where(built_lake: Path) -> None:
    label = label_of(built_lake)
    run = motionlake("search", "--text", label, "-k", 50, "--json", "--lake", built_lake)
    assert run.status == 0, run.err
    first = run.json[0]
    assert (first["label"], first["distance"], first["rank"]) == (label, 0.0, 1)
    assert f"label: {label}" in first["text"]
    assert [row["distance"] for row in run.json] == sorted(row["distance"] for row in run.json)
    shown = motionlake("search", "--text", label, "-k", 1, "--lake", built_lake)
    assert "text" in shown.out.splitlines()[0].split()


def test_segments_and_attributes_are_found(lake: Path) -> None:
    names = [row[0] for row in query(lake, "SELECT clip FROM clips ORDER BY clip LIMIT 2")]
    with Changed(lake) as con:
        con.execute("INSERT INTO segments VALUES ($1, 0, 5, 'handstand')", [names[0]])
        con.execute(
            "UPDATE clips SET attributes = MAP {'mood': 'utterly \x1b[31m cheerful'} WHERE clip = $1", [names[1]]
        )
    segment = motionlake("search", "--text", "upside down", "-k", 1, "--json", "--lake", lake).json[0]
    assert (segment["clip"], segment["text"]) == (names[0], "segment: handstand")
    mood = motionlake("search", "--text", "joyful", "-k", 1, "--lake", lake)
    assert names[1] in mood.out.replace("\n", "")
    assert "\x1b" not in mood.out


def test_a_number_finds_the_clips_that_are_named_by_it(built_lake: Path) -> None:
    says = LakeText(open_lake(built_lake))
    names = [row[0] for row in query(built_lake, "SELECT clip FROM clips ORDER BY clip")]
    subjects = dict(query(built_lake, "SELECT clip, subject FROM clips"))
    number = next(found for name in names for found in numbers(name))
    found = {hit.clip for hit in says.search(f"take 0{number}", 100)}
    assert found == {name for name in names if number in numbers(f"{name} {subjects[name] or ''}")}


def test_scopes_leave_clips_out(built_lake: Path) -> None:
    label = label_of(built_lake)
    dataset = query(built_lake, "SELECT DISTINCT dataset FROM clips")[0][0]
    with library.open_lake(built_lake) as lake:
        assert lake.search(text=label, k=50, dataset=dataset).df().equals(lake.search(text=label, k=50).df())
        assert len(lake.search(text=label, dataset="nothing")) == 0
        assert len(lake.search(text=label, split="train")) == 0
        assert len(lake.search(text=label, k=0)) == 0


def test_beside_a_clip_both_count(built_lake: Path) -> None:
    label = label_of(built_lake)
    other = query(built_lake, "SELECT clip FROM clips WHERE label <> $label ORDER BY clip LIMIT 1", label=label)[0][0]
    run = motionlake("search", other, "--text", label, "-k", 50, "--explain", "--json", "--lake", built_lake)
    assert run.status == 0, run.err
    alone = {row["clip"]: row for row in motionlake("search", other, "-k", 50, "--json", "--lake", built_lake).json}
    assert {row["clip"] for row in run.json} == alone.keys()
    last, first = (of(row["distance"] for row in alone.values()) for of in (max, min))
    for row in run.json:
        *alike, text = row["shares"]
        assert text["method"] == "text"
        assert sum(share["weight"] for share in row["shares"]) == pytest.approx(1)
        like = (last - alone[row["clip"]]["distance"]) / (last - first)
        assert row["distance"] == pytest.approx(1 - (like + text["near"]) / 2)
        assert alike
    named = [row for row in run.json if row["label"] == label]
    best = min(named, key=lambda row: alone[row["clip"]]["rank"])
    assert run.json[0]["clip"] == best["clip"]  # of those that are called so, the one most like the example


def test_sql_answers_the_same(built_lake: Path) -> None:
    label = label_of(built_lake)
    told = motionlake("search", "--text", label, "--json", "--lake", built_lake).json
    con = connect(built_lake)
    text = "SELECT s.clip FROM clips_saying($text) s JOIN clips USING (clip) WHERE frames > 0 ORDER BY rank"
    assert con.sql(text, params={"text": label}).fetchall() == [(row["clip"],) for row in told]
    assert con.sql("FROM clips_saying($text)", params={"text": "'; DROP TABLE zzzz; --"}).fetchall() == []
    beside = motionlake("search", told[0]["clip"], "--text", label, "--json", "--lake", built_lake).json
    named = con.sql("SELECT clip FROM clips_saying($1, query := $2)", params=[label, told[0]["clip"]]).fetchall()
    assert named == [(row["clip"],) for row in beside]


def test_an_encoder_of_ones_own(built_lake: Path) -> None:
    label = label_of(built_lake)

    def encoder(texts: Sequence[str]) -> np.ndarray:
        return np.array([[float(label in text or text == "ambulation"), 0.1] for text in texts])

    with library.open_lake(built_lake) as lake:
        assert len(lake.search(text="ambulation")) == 0
        assert lake.search(text="ambulation", encoder=encoder)[0]["label"] == label
        with pytest.raises(UserError, match=r"must give .* a row of finite numbers"):
            lake.search(text="ambulation", encoder=lambda texts: np.zeros(3))


def test_an_encoder_of_a_package(built_lake: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    point = importlib.metadata.EntryPoint("ones", "numpy:ones_like", "motionlake.text_encoders")
    broken = importlib.metadata.EntryPoint("broken", "no_such_module:encode", "motionlake.text_encoders")
    found = importlib.metadata.EntryPoints([point, broken])
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: found.select(group=group))
    refused = motionlake("search", "--text", "walk", "--encoder", "other", "--lake", built_lake)
    assert (refused.status, refused.err.count("\n")) == (2, 1)
    assert "broken, ones" in refused.err
    failed = motionlake("search", "--text", "walk", "--encoder", "broken", "--lake", built_lake)
    assert (failed.status, failed.err.count("\n")) == (2, 1)
    wrong = motionlake("search", "--text", "walk", "--encoder", "ones", "--lake", built_lake)
    assert wrong.status == 2


@pytest.mark.parametrize(
    ("words_", "says"),
    [
        (["--text", "the of a"], "no word"),
        (["--text", " ".join(f"w{'x' * i}" for i in range(101))], "the most is 100"),
        (["--text", "walk", "--explain"], "--explain: is for a clip"),
        (["--text", "walk", "--picture", "a.png"], "--picture: is for a clip"),
        (["--text", "walk", "--method", "moves"], "--method: is for a clip"),
        (["--text", "walk", "--from", "0"], "--from: is for a clip"),
        (["--text", "walk", "--below", "1"], "--below: is for a clip"),
        (["--encoder", "one"], "--encoder: is for --text"),
        ([], "give --text WORDS"),
    ],
)
def test_mistakes_are_said_in_one_line(built_lake: Path, words_: list[str], says: str) -> None:
    run = motionlake("search", *words_, "--lake", built_lake)
    assert (run.status, run.err.count("\n")) == (2, 1)
    assert says in run.err
